// How far corners that two views saw at once are from their epipolar lines.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "calib/fundamental/line_distances.h"
#include "calib/report/held_out.h"
#include "calib/report/quality_report.h"

namespace silhouette {

class PairDistances {
 public:
  explicit PairDistances(const PoseProblem& problem) : problem_(problem) {}

  // What the cameras of `task.training` say of its sightings; not of tags with an outlier.
  void Add(const HeldOutTask& task);

  // All pairs of views that do not move.
  std::vector<ReportPair> Result() const;

 private:
  LineDistanceSum& SumOf(size_t a, size_t b);

  const PoseProblem& problem_;
  std::map<std::pair<size_t, size_t>, LineDistanceSum> sums_;
};

}  // namespace silhouette
