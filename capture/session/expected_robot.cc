// SPDX-License-Identifier: Apache-2.0
#include "capture/session/expected_robot.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {

absl::StatusOr<ExpectedRobot> ExpectedRobot::Create(const RobotModel& robot,
                                                    const PartSettings& settings,
                                                    const Calibration& calibration,
                                                    const storage::v1::CellDescription& cell) {
  if (static_cast<int>(calibration.cameras.size()) != cell.views_size()) {
    return absl::InvalidArgumentError("the calibration has no camera model for each view");
  }
  ASSIGN_OR_RETURN(const RobotParts parts, RobotParts::Of(robot, settings));
  std::vector<PartDrawer> views;
  for (int v = 0; v < cell.views_size(); ++v) {
    const storage::v1::View& view = cell.views(v);
    views.emplace_back(
        calibration.cameras[static_cast<size_t>(v)],
        MaskSize{static_cast<int>(view.mask_width()), static_cast<int>(view.mask_height())});
  }
  ExpectedRobot expected(robot, DrawnRobot(parts.parts(), std::move(views)));
  std::vector<std::string> names;
  for (const auto& joint : cell.grid_joints()) names.push_back(joint.name());
  for (const auto& joint : cell.fixed_joints()) names.push_back(joint.name());
  for (const RobotJoint& joint : robot.joints()) {
    const auto found = std::ranges::find(names, joint.name);
    if (found == names.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("joint '", joint.name, "' of the model is not in the cell file"));
    }
    expected.places_.push_back(static_cast<size_t>(found - names.begin()));
  }
  expected.joints_ = names.size();
  return expected;
}

std::vector<Mask> ExpectedRobot::At(std::span<const double> measured) const {
  if (measured.size() != joints_) throw std::invalid_argument("not a value for each joint");
  std::vector<double> positions;
  for (const size_t place : places_) positions.push_back(measured[place]);
  const std::vector<Eigen::Isometry3d> base_from_link = robot_.LinkPoses(positions);
  std::vector<Mask> masks;
  for (size_t view = 0; view < drawn_.views().size(); ++view) {
    masks.push_back(drawn_.Touched(view, base_from_link, 0));
  }
  return masks;
}

}  // namespace silhouette
