// The session of `silhouette-calibrate run`: drives the robot from pose to pose, takes images and
// finds the tags in them. Everything is on the disk before the robot moves on.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/board.h"
#include "calib/camera/camera_model.h"
#include "calib/robot/pose_plan.h"
#include "calib/robot/robot_model.h"
#include "capture/devices/devices.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/run_record.h"

namespace silhouette {

struct SessionSettings {
  std::string folder;
  size_t frames = 30;  // that show the board of the flange
  std::vector<Board> boards;
  std::string flange_board;
  size_t flange = 0;                // the link that carries it
  std::vector<MovingJoint> joints;  // that are moved; the others stay
  PosePlan::Positions rest;
  // Instead of poses of its own choice: these, one after the other.
  std::vector<PosePlan::Positions> given;
  double floor = 0;  // height under which nothing of robot and board may go, metres
  // Lenses where they are known, by view, in the order of the cell; or empty.
  std::vector<CameraIntrinsics> lenses;
  uint64_t seed = 1;
};

// Goes on with `record` until it has as many frames as it shall, or all given poses were driven to.
// Cancelled: a signal came, and the robot was told to stop. What was recorded is on the disk.
// FailedPrecondition: no pose that is allowed, or the cameras see too little of the board.
// Otherwise the devices' errors.
absl::Status RecordSession(const Cell& cell, const RobotModel& robot,
                           const SessionSettings& settings, Robot& driver, CameraRig& cameras,
                           SessionRecord& record);

// Whether the robot may go from one pose to another: the joints' limits, the cell's forbidden
// regions, and the floor; nothing, or what is in the way.
std::optional<std::string> InTheWay(const Cell& cell, const RobotModel& robot,
                                    const SessionSettings& settings,
                                    const PosePlan::Positions& from, const PosePlan::Positions& to);

}  // namespace silhouette
