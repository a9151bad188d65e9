// SPDX-License-Identifier: Apache-2.0
// The files that the commands read and write.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/camera/camera_model.h"
#include "calib/camera/epipolar_angles.h"
#include "calib/camera/lens_region.h"
#include "calib/poses/pose_problem.h"
#include "calib/robot/robot_model.h"
#include "tools/program/joint_values.h"

namespace silhouette {

// Errors of the readers: NotFound, and InvalidArgument with file and line.
absl::StatusOr<std::vector<Board>> ReadBoards(const std::string& file);
// `sigma`: of all corners, in place of the file's; 0: the file's.
absl::StatusOr<std::vector<TagSighting>> ReadSightings(const std::string& file, double sigma = 0);

// --sigma, for ReadSightings.
void AddSigmaOption(CLI::App& command, double& sigma);

// A line of text for each file that was written.
std::string TextOfFiles(const std::vector<std::string>& files);

// "640x480"; InvalidArgument, naming `option`, if it is not so.
absl::StatusOr<PixelSize> SizeFromText(const std::string& text, const std::string& option);
// Takes such sizes, also with a view's name and = before: option->check(SizeInPixels()).
CLI::Validator SizeInPixels();

// Camera models: a folder has VIEW.cameramodel of each view.
struct CameraFile {
  std::string view;
  CameraModel camera;
  std::optional<LensRegion> known;  // where the lens is
};

// The view that CameraFileName made a file's name of.
std::string ViewOfCameraFile(const std::string& path);

// NotFound: no such file; InvalidArgument with file and line: not a camera model.
absl::StatusOr<CameraModel> ReadCameraFile(const std::string& file);

// By the views' names. NotFound: no such folder, or no camera model in it; InvalidArgument with
// file and line: not a camera model, or one with a region that is none.
absl::StatusOr<std::vector<CameraFile>> ReadCameraFolder(const std::string& folder);

// Makes the folder if it is not there. Returns the file's path.
absl::StatusOr<std::string> WriteCameraFile(const std::string& folder, const std::string& view,
                                            const CameraModel& camera,
                                            const std::optional<LensRegion>& known = std::nullopt);

// The joints that move the link, from the base outward.
std::vector<size_t> JointsTo(const RobotModel& robot, size_t link);

// The link that carries a board or camera: `name`; if empty, the link `flange`, else the one that
// most joints move, of several the last. InvalidArgument: there is no link `name`.
absl::StatusOr<size_t> FlangeLink(const RobotModel& robot, const std::string& name);
// A sentence that names the link, if FlangeLink took it by its joints; else empty.
std::string GuessedFlangeLink(const RobotModel& robot, const std::string& name);

// The robot's joint values as a CSV file: a column `frame`, and one per joint by its name.
//
//   frame,joint_1,joint_2,joint_3
//   0007,0.5,-30deg,1.2
//
// Values are radians (prismatic: metres) unless they state a unit.
struct JointFileSettings {
  std::vector<FixedJoint> fixed_joints;  // of joints that have no column
  AngleUnit unit = AngleUnit::kRadians;  // of values that state none
  std::string flange_link;               // as FlangeLink
};

// base_from_flange of every line, in the order of the file. InvalidArgument with file and line: a
// joint that is missing or unknown, a frame twice, a value that is none, beyond its limits or looks
// like degrees.
absl::StatusOr<std::vector<RobotPose>> RobotPosesOfJoints(const std::string& text,
                                                          const std::string& file,
                                                          const RobotModel& robot,
                                                          const JointFileSettings& settings);

}  // namespace silhouette
