// SPDX-License-Identifier: Apache-2.0
// The session of `run`: drives the robot from pose to pose, takes images and finds the tags in
// them. Everything is on the disk before the robot moves on.
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/detection/tag_detector.h"
#include "calib/poses/pose_problem.h"
#include "calib/robot/pose_plan.h"
#include "calib/robot/robot_model.h"
#include "capture/devices/devices.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/detect.h"

namespace silhouette {

// In the session's folder corners.csv, robot_poses.csv, joints.csv and images/VIEW/FRAME.png.
struct SessionRecord {
  std::vector<std::string> frames;
  std::vector<PosePlan::Positions> positions;  // of all joints, by frame
  std::vector<RobotPose> robot_poses;          // by frame
  std::vector<TagSighting> sightings;
};

// The record of a folder; empty if there is none. Its frames are those of joints.csv, its robot
// poses those of the link `flange` by `robot` at the joint values there, whatever robot_poses.csv
// says. Without corners.csv it has no sightings: DetectAgain finds them. NotFound: there is only
// corners.csv. InvalidArgument: a file is wrong, or of a robot with other joints, or a frame is no
// number.
absl::StatusOr<SessionRecord> ReadRecord(const std::string& folder, const RobotModel& robot,
                                         size_t flange);

// A file that was there is whole at any time. Errors: those of WriteWholeFile.
absl::Status WriteRecord(const std::string& folder, const RobotModel& robot,
                         const SessionRecord& record);

// Looks at the images images/VIEW/FRAME.png in the folder again, as when lenses are known since:
// corners are more accurate with them. NotFound: an image is missing. Cancelled: a stop signal
// came.
absl::StatusOr<std::vector<TagSighting>> DetectAgain(const std::string& folder,
                                                     const std::vector<std::string>& frames,
                                                     const std::vector<std::string>& views,
                                                     const DetectSettings& settings);

struct SessionSettings {
  std::string folder;
  size_t frames = 0;    // that show the board of the flange
  DetectSettings tags;  // boards, and lenses if they are known
  std::string flange_board;
  size_t flange = 0;  // the link that carries it
  // That are moved. The others stand where the cell has them fixed; those of the grid stay where
  // they are, or go to the nearest end of their range in the cell.
  std::vector<MovingJoint> joints;
  // Instead of poses of its own choice: these, one after the other.
  std::vector<PosePlan::Positions> given;
  // Height in the base, metres, under which no link that a joint raises or lowers, and not the
  // board, may be driven (FloorCheck).
  double floor = 0;
  uint64_t seed = 1;
};

// Adds frames to `record` until it has `frames`, or until the robot was at all given poses. A frame
// has a number that no other and no image in the folder has; of given poses, the pose's.
// Cancelled: a stop signal came; the robot is stopped, all records are on the disk.
// FailedPrecondition: the robot stands below the floor, no pose is allowed, an image has not the
// size that the cell says, or the cameras see too little of the board. Aborted: the robot moves
// when it should stand still. Otherwise the devices' errors.
absl::Status RecordSession(const Cell& cell, const RobotModel& robot,
                           const SessionSettings& settings, Robot& driver, CameraRig& cameras,
                           SessionRecord& record);

}  // namespace silhouette
