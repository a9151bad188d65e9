#include "server/live/joint_poller.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/session/cell_robot.h"
#include "db/status/status_macros.h"
#include "server/live/pause.h"

namespace silhouette {
namespace {

std::vector<std::string> JointNames(const storage::v1::CellDescription& cell) {
  std::vector<std::string> names;
  for (const auto& joint : cell.grid_joints()) names.push_back(joint.name());
  for (const auto& joint : cell.fixed_joints()) names.push_back(joint.name());
  return names;
}

std::vector<bool> Continuous(const storage::v1::CellDescription& cell) {
  std::vector<bool> continuous;
  for (const auto& joint : cell.grid_joints()) continuous.push_back(joint.continuous());
  continuous.resize(continuous.size() + static_cast<size_t>(cell.fixed_joints_size()), false);
  return continuous;
}

}  // namespace

JointPoller::JointPoller(const storage::v1::CellDescription& cell, const LiveSettings& settings,
                         Clock clock, OpenRobotFunction open, std::unique_ptr<Robot> robot,
                         LiveRecord& record)
    : cell_(cell),
      settings_(settings),
      clock_(std::move(clock)),
      open_(std::move(open)),
      record_(record),
      joints_(JointNames(cell)),
      robot_(std::move(robot)),
      history_({.gap = settings.joints_gap, .max_movement = settings.max_joint_movement},
               Continuous(cell)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

absl::StatusOr<std::vector<JointPosition>> JointPoller::Between(absl::Duration first,
                                                                absl::Duration last) const {
  ASSIGN_OR_RETURN(const std::vector<double> positions,
                   history_.Between(first, last, settings_.joints_gap));
  std::vector<JointPosition> joints;
  for (size_t i = 0; i < joints_.size(); ++i) joints.push_back({joints_[i], positions[i]});
  return joints;
}

absl::Status JointPoller::Ask() {
  if (robot_ == nullptr) {
    ASSIGN_OR_RETURN(std::unique_ptr<Robot> opened, open_());
    // The same joints as at capture, whatever their order.
    RETURN_IF_ERROR(CellRobot::Create(cell_, *opened).status());
    robot_ = std::move(opened);
  }
  const absl::Duration asked = clock_().running;
  const absl::StatusOr<RobotState> state = robot_->State();
  const Moment answered = clock_();
  if (!state.ok()) return state.status();
  const std::vector<std::string>& known = robot_->joints();
  if (state->positions.size() != known.size()) {
    return absl::InternalError(absl::StrCat("the robot told the positions of ",
                                            state->positions.size(), " joints and has ",
                                            known.size()));
  }
  std::vector<double> positions;
  for (const std::string& joint : joints_) {
    positions.push_back(
        state->positions[static_cast<size_t>(std::ranges::find(known, joint) - known.begin())]);
  }
  const absl::Status added = history_.Add(asked, answered.running, positions);
  if (added.ok()) record_.NoteJoints(answered);
  return added;
}

void JointPoller::Run(const std::stop_token& stop) {
  Backoff backoff(settings_.first_retry, settings_.longest_retry);
  absl::Duration last_good = clock_().running;
  while (!stop.stop_requested()) {
    const absl::Duration begun = clock_().running;
    absl::Status status;
    try {
      status = Ask();
    } catch (const std::exception& error) {
      status = absl::InternalError(absl::StrCat("internal error: ", error.what()));
    }
    const absl::Duration now = clock_().running;
    if (status.ok()) {
      last_good = now;
      backoff.Reset();
      Pause(stop, settings_.joints_interval - (now - begun));
      continue;
    }
    history_.Fail(status);
    record_.NoteJointsError(status);
    if (now - last_good > settings_.reopen_after) {
      robot_.reset();
      last_good = now;
    }
    Pause(stop, backoff.Next());
  }
}

}  // namespace silhouette
