// SPDX-License-Identifier: Apache-2.0
// cell.yaml: the one file that describes a cell to every program. The commented sample is
// docs/cell.yaml.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/robot/drawn_cell.h"
#include "calib/robot/parts.h"
#include "calib/robot/robot_model.h"
#include "capture/devices/camera_settings.h"
#include "capture/drivers/robots/robot_driver_settings.h"
#include "capture/segmentation/settings.h"
#include "capture/session/capture_settings.h"
#include "capture/verification/model_comparison.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/joint_regions.h"
#include "db/mask/mask.h"
#include "server/collision/policy.h"
#include "server/gate/gate_settings.h"
#include "server/live/live_settings.h"
#include "server/scene/client_limits.h"
#include "server/scene/scene_settings.h"
#include "server/scene/sound_settings.h"
#include "server/scene/view_treatment.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// Metres by which a point of the robot moves at most from one grid value to the next. People are
// 0.3 to 0.5 m thick.
inline constexpr double kMostMove = 0.5;

struct RobotSettings {
  std::shared_ptr<const RobotModel> model;  // null: bare joints
  std::string urdf;                         // file of the model; empty: bare joints
  RobotDriver driver;
  // How far, in metres, tool and payload reach beyond the model's last link.
  double payload_radius = 0;
  // How robot images are drawn; nothing: they are captured.
  std::optional<PartSettings> drawn;
  // Of drawn images: the number of joints, from the first on, that have steps in the grid. Each of
  // the others has one value that stands for any. 0: all have steps.
  int arm_joints = 0;
};

struct ViewSettings {
  std::string name;
  ImageSource source;
  bool has_noise = true;  // whether the images of the source have noise
  int image_width = 0;
  int image_height = 0;
  MaskSize mask_size;
  Margin margin;
  std::string ignore;  // image file of the pixels that prove nothing; empty: none
};

// A box in the robot's base frame, metres.
using Workspace = Eigen::AlignedBox3d;

struct ServerSettings {
  std::string listen = "127.0.0.1:50051";  // address:port, or unix:path
  SceneSettings scene;
  // How long the map of the default policy is worked out after each scene, before anybody asks.
  absl::Duration map_time = absl::Milliseconds(20);
  // Bytes of robot images that memory may hold (LoadSettings); nothing: a share of what there is.
  std::optional<uint64_t> robot_image_memory;
  // Whether variants beside the default one are among them.
  bool variants_in_memory = false;
  IndexCheckSettings index_check;
  ClientLimits limits;
  // File of the newest check of the calibration; empty: it is taken to hold. Older checks are none.
  std::string calibration_check;
  absl::Duration calibration_check_max_age = absl::InfiniteDuration();
  // How images are taken, where the server takes them itself.
  LiveSettings live;
  std::string metrics;  // address:port where metrics are served; empty: nowhere
  GateSettings gate;    // without `insecure`, which only the command line gives
  std::string audit;    // file where changes are recorded; empty: nowhere
};

// Paths are absolute, or relative to the working directory; those in the file are relative to it.
struct Cell {
  std::string file;
  std::string name;
  std::string database;    // folder; empty: not said
  std::string simulation;  // file that describes the simulated cell; empty: none
  RobotSettings robot;
  ConfigurationGrid grid;
  // How far any point of the robot moves at most in a grid step of one joint, metres; 0: there is
  // no model, or the file states no grid.
  double grid_move = 0;
  std::vector<FixedJoint> fixed_joints;  // the joints outside the grid
  // By the name of each joint of the model: whether it slides. Without a model: the joints whose
  // values the file states as lengths.
  std::map<std::string, bool> joint_slides;
  std::vector<ViewSettings> views;
  // What the robot never leaves; nothing: not said.
  std::optional<Workspace> workspace;
  CaptureSettings capture;
  ComparisonSettings verification;  // when a drawn robot's model is refused
  SegmentationSettings segmentation;
  Policy policy;
  bool choose_preset = true;  // `policy` names no preset: the best that the database can serve
  CalibrationSettings calibration;
  std::optional<SoundSettings> sound;        // nothing: the sound presets are not served
  std::optional<SeparationCell> separation;  // only with `sound`
  ServerSettings server;
};

// Reads and checks a file. InvalidArgument with file, line and the mend in its message; nothing in
// a cell that was read is left unchecked. `database`: in place of the one that the file names, if
// not empty. If it is there already, and of such a grid, the grid's tiles are those that it has.
absl::StatusOr<Cell> LoadCell(const std::string& path, const std::string& database = "");

// Whether the file states a grid of all joints that move. If not, the cell's grid has little but
// the joints' limits, where no robot is to be driven or captured.
bool StatesAGrid(const Cell& cell);

// Whether any view has camera images; otherwise all masks come from elsewhere.
bool HasSources(const Cell& cell);

// InvalidArgument, in one sentence with the mend: at some joint values of the cell, outside its
// forbidden regions, a link that they move is beyond the workspace that the file states. Without
// workspace or model there is nothing to compare. Takes a second at most.
absl::Status WorkspaceHoldsRobot(const Cell& cell);

// The box that the robot never leaves: the workspace that the file states, else the reach of its
// model. InvalidArgument: there is neither, or, where robot images are captured, as
// WorkspaceHoldsRobot. A drawn robot may leave the stated one: SoundCell::robot_may_leave.
absl::StatusOr<Workspace> WorkspaceOf(const Cell& cell);

// What the file states, or leaves at its default, and its author probably did not mean: a sentence
// each, with the mend.
std::vector<std::string> Doubts(const Cell& cell);

// What the sound presets are served with; nothing if the file does not say. Errors: as those of
// WorkspaceOf.
absl::StatusOr<std::optional<SoundCell>> SoundCellOf(const Cell& cell);

// Where the robot must never be, of the grid's joints. InvalidArgument: forbidden regions that
// cannot be.
absl::StatusOr<JointRegions> ForbiddenOf(const Cell& cell);

// What robot images are drawn from; nothing if they are captured. Errors: those of ForbiddenOf.
absl::StatusOr<std::optional<DrawnCell>> DrawnCellOf(const Cell& cell);

// What the cell's database must say of it.
storage::v1::CellDescription DescriptionOf(const Cell& cell);

}  // namespace silhouette
