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

// Metres: drawings of one shape may differ at their rims; what a reversed axis may cost.
constexpr double kRim = 0.005;
constexpr double kLeastMatter = 0.02;

// Whether the robot with the joint turned the other way would show a pixel that is farther than
// `beyond` from what is drawn at `q`.
bool ShowsDirection(const DrawnRobot& bare, const DrawnRobot& grown, std::vector<double> q,
                    size_t joint, double beyond) {
  const std::vector<Mask> drawn = grown.Touched(q, beyond);
  q[joint] = -q[joint];
  const std::vector<Mask> reversed = bare.Touched(q);
  for (size_t view = 0; view < drawn.size(); ++view) {
    if ((reversed[view] & ~drawn[view]).Count() > 0) return true;
  }
  return false;
}

// At some values of the joint, with the others as in some samples.
bool DirectionMatters(const DrawnRobot& bare, const DrawnRobot& grown, const GridJoint& range,
                      size_t joint, std::span<const ModelSample> samples) {
  constexpr int kValues = 32;
  constexpr size_t kSamples = 8;
  for (const ModelSample& sample : samples.first(std::min(kSamples, samples.size()))) {
    std::vector<double> q = sample.q;
    for (int i = 0; i <= kValues; ++i) {
      q[joint] = range.lower + (range.upper - range.lower) * i / kValues;
      if (ShowsDirection(bare, grown, q, joint, kLeastMatter)) return true;
    }
  }
  return false;
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

std::vector<std::string> UndirectedJoints(const DrawnRobot& bare, const DrawnRobot& grown,
                                          std::span<const GridJoint> joints,
                                          std::span<const ModelSample> samples) {
  std::vector<std::string> faults;
  for (size_t joint = 0; joint < joints.size(); ++joint) {
    const auto shown = [&](const ModelSample& sample) {
      return ShowsDirection(bare, grown, sample.q, joint, kRim);
    };
    if (Slides(bare.chain(), joint) || std::ranges::any_of(samples, shown)) continue;
    if (!DirectionMatters(bare, grown, joints[joint], joint, samples)) continue;
    faults.push_back(absl::StrFormat(
        "joint '%s': at all its captured values the robot would look the same if it turned the "
        "other way, so its axis may be reversed: capture it at values in between, or let "
        "verify-model drive the robot (without --captured)",
        joints[joint].name));
  }
  return faults;
}

}  // namespace silhouette
