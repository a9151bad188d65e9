// Epipolar bands between all pairs of views, as the calibrated test needs them: for every pixel of
// a view, which pixels of another may show the same point.
//
// Per pair of views the epipolar-plane angles (calib/epipolar_angles.h) are cut into bins; a pixel
// covers one run of bins, or two where its interval passes the end of the period. Two pixels may
// show the same point if they share a bin. There are as many bins as the pixels' intervals have
// different ends, which loses nothing, but at most kMaxBins: beyond that the runs are rounded
// outward. Cannot be changed once made; used by any number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "calib/calibration.h"
#include "db/mask.h"

namespace silhouette {

class EpipolarBands {
 public:
  static constexpr int kMaxBins = 16384;

  // Bins [begin, end).
  struct Run {
    uint16_t begin = 0;
    uint16_t end = 0;
  };
  // The second is empty but where the interval passes the end of the period.
  using Runs = std::array<Run, 2>;

  // No pair of views has lines.
  EpipolarBands() = default;

  // `mask_sizes`: one per view. `margin`: pixels, as in calib/epipolar_angles.h. Throws
  // std::invalid_argument if there are cameras, but not one per view, if a fundamental matrix names
  // a view that is not there or a pair comes twice, and as AnglesBetween does.
  EpipolarBands(const Calibration& calibration, std::span<const MaskSize> mask_sizes,
                double margin = 0);

  int views() const { return views_; }
  // Whether epipolar lines are known between the views.
  bool Known(int view, int other) const { return bins(view, other) > 0; }
  // Number of bins of the pair, 0 if no lines are known; the same in either order.
  int bins(int view, int other) const;
  // Per pixel of `view`, its bins in the pair with `other`. Known(view, other) must hold.
  std::span<const Runs> runs(int view, int other) const;

  // Whether pixel `p` of `view` and pixel `q` of `other`, numbered as in db/mask.h, may show the
  // same point.
  bool Meet(int view, int p, int other, int q) const;

 private:
  struct Pair {
    int bins = 0;
    std::array<std::vector<Runs>, 2> runs;  // of the view with the lower number first
  };
  const Pair& PairOf(int view, int other) const;

  int views_ = 0;
  std::vector<Pair> pairs_;
};

}  // namespace silhouette
