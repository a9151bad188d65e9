// SPDX-License-Identifier: Apache-2.0
#include "capture/session/cell_robot.h"

#include <algorithm>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "capture/devices/joint_deviation.h"
#include "capture/devices/state_since.h"
#include "db/status/status_macros.h"

namespace silhouette {

absl::StatusOr<CellRobot> CellRobot::Create(const storage::v1::CellDescription& cell,
                                            Robot& robot) {
  CellRobot result(robot);
  const std::vector<std::string>& known = robot.joints();
  std::vector<std::string>& names = result.names_;
  for (const storage::v1::GridJoint& joint : cell.grid_joints()) {
    names.push_back(joint.name());
    result.continuous_.push_back(joint.continuous());
  }
  for (const storage::v1::FixedJoint& joint : cell.fixed_joints()) {
    names.push_back(joint.name());
    result.fixed_.push_back(joint.position());
  }
  for (const std::string& name : names) {
    const auto place = std::find(known.begin(), known.end(), name);
    if (place == known.end()) {
      return absl::InvalidArgumentError(absl::StrCat("the robot has no joint '", name,
                                                     "' that the cell names; it has ",
                                                     absl::StrJoin(known, ", ")));
    }
    result.place_.push_back(static_cast<size_t>(place - known.begin()));
  }
  for (const std::string& name : known) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the robot's joint '", name,
                       "' is not in the cell; say where it stands, in 'fixed' of the robot"));
    }
  }
  return result;
}

std::vector<double> CellRobot::Commanded(const Configuration& configuration) const {
  std::vector<double> values = configuration;
  values.insert(values.end(), fixed_.begin(), fixed_.end());
  return values;
}

absl::Status CellRobot::MoveTo(const Configuration& configuration) {
  const std::vector<double> values = Commanded(configuration);
  std::vector<double> positions(values.size());
  for (size_t i = 0; i < values.size(); ++i) positions[place_[i]] = values[i];
  return robot_->MoveTo(positions);
}

absl::StatusOr<std::vector<double>> CellRobot::Measure(absl::Duration since) {
  ASSIGN_OR_RETURN(RobotState state, StateSince(*robot_, since));
  if (state.moving) return absl::AbortedError("the robot moves when it should stand still");
  std::vector<double> values;
  for (const size_t place : place_) values.push_back(state.positions[place]);
  return values;
}

double CellRobot::Deviation(const std::vector<double>& commanded,
                            const std::vector<double>& measured) const {
  return GreatestDeviation(commanded, measured, continuous_).deviation;
}

std::string CellRobot::WhichDeviates(const std::vector<double>& commanded,
                                     const std::vector<double>& measured) const {
  const size_t most = GreatestDeviation(commanded, measured, continuous_).joint;
  return absl::StrFormat("the joint '%s' is at %.4f instead of %.4f", names_[most], measured[most],
                         commanded[most]);
}

}  // namespace silhouette
