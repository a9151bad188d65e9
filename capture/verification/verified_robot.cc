// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/verified_robot.h"

#include <iterator>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/robot/drawn_digest.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// As VerifiedRobot::unverified: that a joint's range is wider than it was; empty: none is.
std::string WiderRange(std::span<const ChainJoint> chain, std::span<const GridJoint> joints,
                       const storage::v1::ModelVerification& verification) {
  if (verification.ranges_size() != std::ssize(joints)) {
    return "an earlier version compared captured robot images with it, and did not store in which "
           "ranges of the joints";
  }
  for (size_t i = 0; i < joints.size(); ++i) {
    const GridJoint& joint = joints[i];
    const storage::v1::VerifiedRange& range = verification.ranges(static_cast<int>(i));
    // All round, wherever the turn begins.
    const bool whole_turn = chain[i].continuous &&
                            range.upper() - range.lower() >= 2 * std::numbers::pi - kLimitTolerance;
    const bool within = joint.name == range.joint() &&
                        joint.lower >= range.lower() - kLimitTolerance &&
                        joint.upper <= range.upper() + kLimitTolerance;
    if (whole_turn || within) continue;
    return absl::StrFormat(
        "its joint '%s' moves from %g to %g, but only from %g to %g when captured robot images "
        "were compared with it",
        joint.name, joint.lower, joint.upper, range.lower(), range.upper());
  }
  return "";
}

}  // namespace

absl::StatusOr<DrawnRobot> BareRobotOf(const DrawnCell& cell, const Database& database,
                                       const std::optional<Calibration>& calibration,
                                       double margin) {
  if (!calibration || calibration->cameras.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "'", database.path(),
        "': robot images can be drawn only with a calibration with camera models, which the "
        "database does not have; import one with 'silhouette-db calibration import', or state "
        "'images: captured' of the robot in the cell file"));
  }
  std::vector<std::string> moving;
  for (const GridJoint& joint : database.grid().joints()) moving.push_back(joint.name);
  std::vector<FixedJoint> fixed;
  for (const auto& joint : database.cell().fixed_joints()) {
    fixed.push_back({joint.name(), joint.position()});
  }
  absl::StatusOr<DrawnRobot> robot =
      DrawnRobotOf(cell, moving, fixed, *calibration, database.mask_sizes(), margin);
  if (robot.ok()) return robot;
  return absl::Status(robot.status().code(),
                      absl::StrCat("'", database.path(), "': its robot images cannot be drawn: ",
                                   robot.status().message()));
}

absl::StatusOr<VerifiedRobot> VerifiedRobotOf(
    const DrawnCell& cell, DrawnRobot bare, std::span<const GridJoint> joints,
    const std::optional<storage::v1::ModelVerification>& verification) {
  if (!verification) {
    return VerifiedRobot{std::move(bare), "no captured robot images were compared with it"};
  }
  if (verification->digest() != DigestOf(bare)) {
    return VerifiedRobot{
        std::move(bare),
        "model, tolerance, payload, calibration, its margin or mask sizes are others than "
        "when captured robot images were compared with it"};
  }
  std::string wider = WiderRange(bare.chain().joints(), joints, *verification);
  if (!wider.empty()) return VerifiedRobot{std::move(bare), std::move(wider)};
  std::vector<double> growth(cell.robot->links().size());
  for (const storage::v1::LinkGrowth& grown : verification->link_growth()) {
    size_t link = 0;
    while (link < growth.size() && cell.robot->links()[link].name != grown.link()) ++link;
    if (link == growth.size()) {
      return VerifiedRobot{std::move(bare),
                           absl::StrCat("its link '", grown.link(),
                                        "' had another name when captured robot images were "
                                        "compared with it")};
    }
    growth[link] = grown.growth();
  }
  ASSIGN_OR_RETURN(DrawnRobot robot, Grown(bare, growth));
  return VerifiedRobot{std::move(robot), "", std::move(growth)};
}

}  // namespace silhouette
