// What a session of `silhouette-calibrate run` has so far, and its files.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/tag_sighting.h"
#include "calib/poses/pose_problem.h"
#include "calib/robot/pose_plan.h"
#include "calib/robot/robot_model.h"

namespace silhouette {

// In the session's folder corners.csv, robot_poses.csv, joints.csv and images/VIEW/FRAME.png.
struct SessionRecord {
  std::vector<std::string> frames;
  std::vector<PosePlan::Positions> positions;  // of all joints, by frame
  std::vector<RobotPose> robot_poses;          // by frame
  std::vector<TagSighting> sightings;
};

// The record of a folder; empty if there is none. InvalidArgument: its files contradict each other.
absl::StatusOr<SessionRecord> ReadRecord(const std::string& folder, const RobotModel& robot);

// Each file is whole at any time. Errors: those of WriteWholeFile.
absl::Status WriteRecord(const std::string& folder, const RobotModel& robot,
                         const SessionRecord& record);

}  // namespace silhouette
