// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/unmoved_joints.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_format.h"

namespace silhouette {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

bool Slides(const KinematicChain& chain, size_t joint) {
  return std::ranges::any_of(chain.links(), [&](const ChainLink& link) {
    return link.joint == static_cast<int>(joint) && link.slides;
  });
}

// At least one value.
double Moved(std::vector<double> values, bool slides) {
  if (!slides) {
    for (double& value : values) value -= kTurn * std::floor(value / kTurn);
  }
  std::ranges::sort(values);
  const double whole = values.back() - values.front();
  if (slides) return whole;
  double widest_gap = kTurn - whole;
  for (size_t i = 1; i < values.size(); ++i) {
    widest_gap = std::max(widest_gap, values[i] - values[i - 1]);
  }
  return kTurn - widest_gap;
}

}  // namespace

std::vector<std::string> UnmovedJoints(const KinematicChain& chain,
                                       std::span<const GridJoint> joints,
                                       std::span<const ModelSample> samples, double least_moved) {
  std::vector<std::string> faults;
  for (size_t joint = 0; joint < joints.size() && !samples.empty(); ++joint) {
    const bool slides = Slides(chain, joint);
    std::vector<double> values;
    for (const ModelSample& sample : samples) values.push_back(sample.q[joint]);
    const double moved = Moved(std::move(values), slides);
    double range = joints[joint].upper - joints[joint].lower;
    if (!slides) range = std::min(range, kTurn);
    if (moved >= least_moved * range) continue;
    const double unit = slides ? 0.001 : std::numbers::pi / 180;
    const char* name = slides ? "mm" : "deg";
    faults.push_back(absl::StrFormat(
        "joint '%s' moved through only %.1f %s of %.1f %s, less than least_moved, %.0f %%: capture "
        "it moving, or let verify-model drive the robot (without --captured); narrow its 'lower' "
        "and 'upper' if it cannot go farther",
        joints[joint].name, moved / unit, name, range / unit, name, 100 * least_moved));
  }
  return faults;
}

}  // namespace silhouette
