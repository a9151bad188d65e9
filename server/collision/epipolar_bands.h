// SPDX-License-Identifier: Apache-2.0
// Epipolar bands between all pairs of views, as the calibrated test needs them: for every pixel of
// a view, which pixels of another may show the same point.
//
// Per pair of views the epipolar-plane angles (calib/camera/epipolar_angles.h) are cut into bins; a
// pixel covers one run of bins, or two where its interval passes the end of the period. Two pixels
// may show the same point if they share a bin. There are as many bins as the pixels' intervals have
// different ends, which loses nothing, but at most kMaxBins: beyond that the runs are rounded
// outward. Cannot be changed once made; used by any number of threads.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "calib/camera/calibration.h"
#include "calib/camera/epipolar_angles.h"
#include "db/mask/mask.h"

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

  // A pair of views that the calibration does not speak of has one bin, which all pixels share: any
  // two of them may show the same point. `mask_sizes`: one per view. `margin`: pixels, as in
  // calib/camera/epipolar_angles.h. With margin 0, squares of which only edges lie in a common
  // epipolar plane do not meet: a point on an edge is in the squares on both sides of it, and
  // any-touch masks have both. Throws std::invalid_argument if there are cameras, but not one
  // per view, if a fundamental matrix names a view that is not there or a pair comes twice, and as
  // AnglesBetween does.
  EpipolarBands(const Calibration& calibration, std::span<const MaskSize> mask_sizes,
                double margin = 0);

  int views() const { return static_cast<int>(mask_sizes_.size()); }
  std::span<const MaskSize> mask_sizes() const { return mask_sizes_; }

  // Whether the calibration speaks of the pair.
  bool Known(int view, int other) const { return PairOf(view, other).known; }
  // Number of bins of the pair, at least 1; the same in either order.
  int bins(int view, int other) const { return PairOf(view, other).bins; }
  // Per pixel of `view`, its bins in the pair with `other`, which is another view.
  std::span<const Runs> runs(int view, int other) const {
    return PairOf(view, other).runs[view < other ? 0 : 1];
  }

  // Whether pixel `p` of `view` and pixel `q` of `other`, numbered as in db/mask/mask.h, may show
  // the same point.
  bool Meet(int view, int p, int other, int q) const;

 private:
  struct Pair {
    bool known = false;
    int bins = 1;
    std::array<std::vector<Runs>, 2> runs;  // of the view with the lower number first
  };
  const Pair& PairOf(int view, int other) const {
    return pairs_[static_cast<size_t>(std::min(view, other) * views() + std::max(view, other))];
  }
  static Pair Cut(const EpipolarAngles& angles);

  std::vector<MaskSize> mask_sizes_;
  std::vector<Pair> pairs_;  // by lower and higher number of the views
};

}  // namespace silhouette
