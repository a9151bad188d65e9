// SPDX-License-Identifier: Apache-2.0
#include "db/mask/segment_places.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace silhouette {
namespace {

constexpr double kSnapSteps = 1e-6;   // as in the grid
constexpr double kFarthest = 1e9;     // in steps; beyond it doubles become coarser than kSnapSteps
constexpr double kSamePlace = 1e-12;  // fractions nearer than this are one place

// The first value offset + integer that comes after `from` in the direction of `delta`; what lies
// at `from` itself, up to the snap, does not come after it.
double FirstCrossing(double from, double delta, double offset) {
  return delta > 0 ? std::floor(from - offset + kSnapSteps) + 1 + offset
                   : std::ceil(from - offset - kSnapSteps) - 1 + offset;
}

void RequireOneValuePerJoint(const ConfigurationGrid& grid, std::span<const double> q) {
  if (q.size() != static_cast<size_t>(grid.dimensions())) {
    throw std::invalid_argument("a configuration has one value per joint");
  }
}

}  // namespace

SegmentPlaces::SegmentPlaces(const ConfigurationGrid& grid, std::span<const double> from,
                             std::span<const double> to, Border border) {
  RequireOneValuePerJoint(grid, from);
  RequireOneValuePerJoint(grid, to);
  const double offset = border == Border::kHalfWay ? 0.5 : 0;
  for (size_t j = 0; j < from.size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    if (!std::isfinite(to[j] - from[j])) resolvable_ = false;
    if (to[j] == from[j]) continue;
    if (joint.steps == 1) {  // it moves only to leave the grid
      const double way = std::abs(to[j] - from[j]);
      if (way > kSnapSteps) leaves_grid_ = std::min(leaves_grid_, kSnapSteps / way);
      continue;
    }
    Axis axis;
    axis.from = (from[j] - joint.lower) / joint.step();
    axis.delta = (to[j] - from[j]) / joint.step();
    axis.next = FirstCrossing(axis.from, axis.delta, offset);
    const double end = axis.from + axis.delta;
    if (!std::isfinite(axis.delta) ||
        (joint.continuous && std::max(std::abs(axis.from), std::abs(end)) > kFarthest)) {
      resolvable_ = false;
    }
    const double last = joint.steps - 1;
    if (!joint.continuous && (end < 0 || end > last)) {
      const double rim = end < 0 ? 0 : last;
      leaves_grid_ = std::min(leaves_grid_, (rim - axis.from) / axis.delta);
    }
    axes_[moving_++] = axis;
  }
  if (leaves_grid_ <= 0) leaves_grid_ = 2;
  if (moving_ == 0 && leaves_grid_ > 1) last_crossing_ = 1;  // nothing moves
}

double SegmentPlaces::NextCrossing() {
  double crossing = leaves_grid_;
  for (int j = 0; j < moving_; ++j) crossing = std::min(crossing, axes_[j].fraction());
  for (int j = 0; j < moving_; ++j) {
    Axis& axis = axes_[j];
    if (axis.fraction() <= crossing + kSamePlace) axis.next += axis.delta > 0 ? 1 : -1;
  }
  if (leaves_grid_ <= crossing + kSamePlace) leaves_grid_ = 2;
  return crossing;
}

std::optional<double> SegmentPlaces::Next() {
  if (!resolvable_) return std::nullopt;
  if (pending_) {
    const double crossing = *pending_;
    pending_.reset();
    last_crossing_ = crossing;
    return crossing;
  }
  if (last_crossing_ >= 1) return std::nullopt;
  const double crossing = NextCrossing();
  const double middle = last_crossing_ + (std::min(crossing, 1.0) - last_crossing_) / 2;
  if (crossing < 1) {
    pending_ = crossing;
  } else {
    last_crossing_ = 1;
  }
  return middle;
}

}  // namespace silhouette
