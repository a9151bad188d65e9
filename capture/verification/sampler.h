// SPDX-License-Identifier: Apache-2.0
// ModelSampler: configurations all over a robot's joint space, and whether it can go there
// straight.
//
// A gap is what two links keep between them, or a link and a face of the workspace. Why no gap
// closes on a way that the sampler permits, as far as the model without its tolerance holds the
// robot:
//
// * Every gap is looked at, whatever was found at other configurations. No gap are links that no
//   joint moves against each other, links that are next to each other with no more than one joint
//   between them, whose limits keep them apart, and links that the operator names.
// * The width of a gap is the distance of the links' convex parts, or less (HullDistance).
// * A gap keeps the clearance. One that is narrow by the robot's construction keeps half of its
//   median width if that is less, and at least kLeastKept. So links that are near each other at
//   nearly all configurations still never touch at the others.
// * Where the robot stands it touches nothing. If a gap is narrower there than what it keeps, the
//   robot may leave: until it arrives at a configuration where all gaps are kept, that gap stays as
//   wide as it was, to half a millimetre. Where a gap is narrower than kLeastKept, the model does
//   not tell whether it closes: there is no way from there.
// * A way is proven, not sampled: from a place where a gap is looked at, the next look comes before
//   the joints can have closed it to half of what it keeps.
// * Forbidden regions are compared with the whole box of joint values between two configurations.
//
// The proof holds for robots whose joints start and end a motion together.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/joint_regions.h"

namespace silhouette {

// Metres. Robots agree with their data sheets to a millimetre or two.
inline constexpr double kLeastKept = 0.003;

struct SamplerSettings {
  // What gaps keep: cables and hoses are not in the model. Metres.
  double clearance = 0.08;
  // The same between links with no more than two joints between them: wrists are built close.
  double clearance_of_near = 0.02;
  // What of the parts' radii is the model's tolerance (PartSettings). Gaps between links are
  // without it, gaps to faces with it.
  double tolerance = 0;
  // Links that touch by the model, but cannot, as the operator knows: no gaps.
  std::vector<std::pair<size_t, size_t>> not_checked = {};
  // Configurations that are tried until one can be reached.
  int most_tries = 20'000;
};

// A gap that is narrower than what it keeps.
struct NarrowGap {
  size_t link = 0;
  size_t other = 0;  // the same: a face of the workspace
  int face = -1;     // the lower ones across x, y and z, then the upper ones; -1: between links
  // Metres. With 0 or less the links touch, or the link is beyond the face.
  double width = 0;
  double kept = 0;
};

// For one thread.
class ModelSampler {
 public:
  // `joints`: the ranges that the joints of the robot are driven in. `workspace`: what the robot
  // must not leave, in its base's frame; what no joint moves may. `forbidden`: what it must not
  // move through, by its joints. The same seed gives the same configurations. Throws
  // std::invalid_argument if there is not a range for each joint.
  ModelSampler(const DrawnRobot& robot, std::span<const GridJoint> joints,
               const Eigen::AlignedBox3d& workspace, JointRegions forbidden,
               SamplerSettings settings, uint64_t seed);

  // The next one, to which the way from `here`, where the robot stands, is clear; nothing if chance
  // finds none.
  std::optional<Configuration> Next(const Configuration& here);

  // Gaps that were narrower than kLeastKept wherever chance put the robot, as wide as they ever
  // were: links that touch by their model's construction, or are beyond a face. The model cannot
  // show whether they meet, and while they are gaps no way is clear.
  std::span<const NarrowGap> AlwaysNarrow() const { return always_narrow_; }

  // The narrowest first; none: the robot is clear of itself and the workspace's faces.
  std::vector<NarrowGap> NarrowGapsAt(std::span<const double> q);
  bool IsClear(std::span<const double> q) { return IsClear(q, gaps_); }
  // Whether it is so all along the straight motion, and no forbidden region is in the way. No joint
  // that turns without end makes half a turn: so it is the same motion for robots that take the
  // shorter way round.
  bool IsClearWay(std::span<const double> from, std::span<const double> to) {
    return IsClearWay(from, to, gaps_);
  }

 private:
  struct Gap {
    size_t link = 0;
    size_t other = 0;
    int face = -1;
    double kept = 0;
    std::vector<std::pair<size_t, size_t>> parts;  // twice the same: to the face
    // By joint, how much the gap closes at most, metres per radian or metre.
    std::vector<double> levers;
  };

  // The joints that move one link against the other.
  std::vector<size_t> JointsBetween(size_t first, size_t second) const;
  // Whether a link hangs on the other, or on links without a body that do.
  bool IsNextTo(size_t link, size_t other) const;
  void AddGapBetween(size_t link, size_t other);
  void AddGapToFace(size_t link, int face);
  static NarrowGap Narrow(const Gap& gap, double width);
  void LearnWhatIsNarrow();
  Configuration Any();
  void Place(std::span<const double> q);
  // Where the robot is placed; `enough` stands for that and all that is wider.
  double Width(const Gap& gap, double enough) const;
  bool BallsAreApart(size_t part, size_t other, double enough) const;
  double PartsApart(size_t part, size_t other, double enough) const;
  double WithinFace(size_t part, int face) const;
  bool IsClear(std::span<const double> q, std::span<const Gap> gaps);
  bool IsClearWay(std::span<const double> from, std::span<const double> to,
                  std::span<const Gap> gaps);
  bool Keeps(const Gap& gap, std::span<const double> from, std::span<const double> to);
  // What the robot keeps on its way from where it stands; nothing: it must not leave.
  std::optional<std::vector<Gap>> GapsFrom(std::span<const double> here);

  const DrawnRobot& robot_;
  const std::vector<GridJoint> joints_;
  const Eigen::AlignedBox3d workspace_;
  const JointRegions forbidden_;
  const SamplerSettings settings_;
  std::mt19937_64 random_;
  std::vector<std::vector<size_t>> parts_;  // by link
  std::vector<std::vector<size_t>> balls_;  // by part
  std::vector<Gap> gaps_;
  std::vector<NarrowGap> always_narrow_;
  PlacedBalls placed_;
  std::vector<Eigen::Isometry3d> poses_;
};

}  // namespace silhouette
