// SPDX-License-Identifier: Apache-2.0
#include "server/collision/epipolar_bands.h"

#include <cmath>
#include <stdexcept>
#include <string>

namespace silhouette {
namespace {

// Ends of intervals that are closer together than this share of the period are the same: squares
// whose edges lie on one line only touch, and computing blurs that.
constexpr double kSame = 1e-9;

// Angles from 0 to the period, cut at the ends of all intervals.
class Cuts {
 public:
  explicit Cuts(const EpipolarAngles& angles) : period_(angles.period) {
    std::vector<double> ends = {0, period_};
    for (const auto* intervals : {&angles.a, &angles.b}) {
      for (const AngleInterval& interval : *intervals) {
        ends.push_back(Wrapped(interval.from));
        ends.push_back(Wrapped(interval.to));
      }
    }
    std::sort(ends.begin(), ends.end());
    for (double end : ends) {
      if (at_.empty() || end - at_.back() > kSame * period_) at_.push_back(end);
    }
    if (period_ - at_.back() > 0) at_.back() = period_;
    all_ = static_cast<int64_t>(at_.size()) - 1;
    bins_ = std::min<int64_t>(all_, EpipolarBands::kMaxBins);
  }

  int bins() const { return static_cast<int>(bins_); }

  EpipolarBands::Runs RunsOf(const AngleInterval& interval) const {
    if (interval.to - interval.from >= period_ * (1 - kSame)) return {Between(0, all_), {}};
    const int64_t from = CutAt(Wrapped(interval.from)) % all_;
    int64_t to = CutAt(Wrapped(interval.to));
    if (to == 0) to = all_;
    if (from < to) return {Between(from, to), {}};
    if (from == to) return {Between(from, from + 1), {}};  // narrower than a bin
    return {Between(from, all_), Between(0, to)};
  }

 private:
  double Wrapped(double angle) const { return angle > period_ ? angle - period_ : angle; }

  // The cut that stands for `angle`.
  int64_t CutAt(double angle) const {
    const auto after = std::upper_bound(at_.begin(), at_.end(), angle + kSame * period_ / 2);
    return std::max<int64_t>(after - at_.begin() - 1, 0);
  }

  EpipolarBands::Run Between(int64_t from, int64_t to) const {
    return {static_cast<uint16_t>(from * bins_ / all_),
            static_cast<uint16_t>((to * bins_ + all_ - 1) / all_)};
  }

  const double period_;
  std::vector<double> at_;
  int64_t all_ = 1;  // bins, if there were no limit
  int64_t bins_ = 1;
};

bool Overlap(EpipolarBands::Run a, EpipolarBands::Run b) {
  return std::max(a.begin, b.begin) < std::min(a.end, b.end);
}

PixelSize Pixels(MaskSize size) { return {size.width, size.height}; }

}  // namespace

EpipolarBands::Pair EpipolarBands::Cut(const EpipolarAngles& angles) {
  const Cuts cuts(angles);
  Pair pair{.known = true, .bins = cuts.bins(), .runs = {}};
  for (size_t side = 0; side < 2; ++side) {
    const std::vector<AngleInterval>& intervals = side == 0 ? angles.a : angles.b;
    pair.runs[side].reserve(intervals.size());
    for (const AngleInterval& interval : intervals) {
      pair.runs[side].push_back(cuts.RunsOf(interval));
    }
  }
  return pair;
}

EpipolarBands::EpipolarBands(const Calibration& calibration, std::span<const MaskSize> mask_sizes,
                             double margin)
    : mask_sizes_(mask_sizes.begin(), mask_sizes.end()) {
  const size_t count = mask_sizes_.size();
  pairs_.resize(count * count);
  for (size_t a = 0; a < count; ++a) {
    if (!mask_sizes_[a].valid()) throw std::invalid_argument("a view's mask size is not valid");
    for (size_t b = a + 1; b < count; ++b) {
      pairs_[a * count + b].runs = {std::vector<Runs>(mask_sizes_[a].pixels(), {Run{0, 1}, Run{}}),
                                    std::vector<Runs>(mask_sizes_[b].pixels(), {Run{0, 1}, Run{}})};
    }
  }
  if (!calibration.cameras.empty()) {
    if (calibration.cameras.size() != count) {
      throw std::invalid_argument("there must be one camera model per view");
    }
    std::vector<CameraModel> cameras;
    for (size_t view = 0; view < count; ++view) {
      cameras.push_back(
          calibration.cameras[view].ScaledTo(mask_sizes_[view].width, mask_sizes_[view].height));
    }
    for (size_t a = 0; a < count; ++a) {
      for (size_t b = a + 1; b < count; ++b) {
        pairs_[a * count + b] = Cut(AnglesBetween(cameras[a], cameras[b], margin));
      }
    }
    return;
  }
  for (const FundamentalMatrix& matrix : calibration.fundamental_matrices) {
    const int a = std::min(matrix.view_a, matrix.view_b);
    const int b = std::max(matrix.view_a, matrix.view_b);
    if (a < 0 || b >= views() || a == b) {
      throw std::invalid_argument("a fundamental matrix is not between two of the views");
    }
    Pair& pair = pairs_[static_cast<size_t>(a) * count + static_cast<size_t>(b)];
    if (pair.known) {
      throw std::invalid_argument("there are two fundamental matrices between views " +
                                  std::to_string(a) + " and " + std::to_string(b));
    }
    const Eigen::Matrix3d f = a == matrix.view_a ? matrix.f : Eigen::Matrix3d(matrix.f.transpose());
    pair = Cut(AnglesBetween(f, Pixels(mask_sizes_[static_cast<size_t>(a)]),
                             Pixels(mask_sizes_[static_cast<size_t>(b)]), margin));
  }
}

bool EpipolarBands::Meet(int view, int p, int other, int q) const {
  const Runs& a = runs(view, other)[static_cast<size_t>(p)];
  const Runs& b = runs(other, view)[static_cast<size_t>(q)];
  return Overlap(a[0], b[0]) || Overlap(a[0], b[1]) || Overlap(a[1], b[0]) || Overlap(a[1], b[1]);
}

}  // namespace silhouette
