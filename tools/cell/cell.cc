// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/cell.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/robot/reach.h"
#include "calib/robot/robot_model.h"
#include "capture/session/travel.h"
#include "capture/verification/samples.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"
#include "db/store/store.h"
#include "tools/cell/sections.h"

namespace silhouette {
namespace {

// The server must be able to use what a capture takes.
void CheckTolerances(const Cell& cell, const std::optional<YamlNode>& section) {
  const double most = cell.server.scene.fixed_joint_tolerance;
  if (cell.fixed_joints.empty() || cell.capture.joint_tolerance <= most || !section) return;
  section->Fail(absl::StrCat(
      "joint_tolerance, ", cell.capture.joint_tolerance, ", is more than the server's ",
      "fixed_joint_tolerance, ", most, ": robot images would be captured with fixed joints where ",
      "the server does not use them; state a larger fixed_joint_tolerance, too"));
}

// What rests on a model needs masks of all that touches a mask pixel.
void CheckMinCover(const Cell& cell, const std::optional<YamlNode>& section) {
  if (!section || cell.segmentation.min_cover == 0) return;
  if (!cell.sound && !cell.robot.drawn) return;
  section->Fail(
      "min_cover must be 0 with the section 'sound' and with drawn robot images: they rest on "
      "masks of all that touches a mask pixel; leave it out");
}

Cell ReadCell(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  YamlMap map(YamlNode::FromFile(path));
  const std::string name = map.Get<std::string>("name");
  const auto file_of = [&](const std::string& key) {
    const std::string value = map.Get<std::string>(key, "");
    return value.empty() ? value : ResolvePath(folder, value);
  };
  std::string database = file_of("database");
  std::string simulation = file_of("simulation");
  const YamlNode robot_node = map.Required("robot");
  const auto grid_node = map.Optional("grid");
  const YamlNode views_node = map.Required("views");
  const auto margin_node = map.Optional("margin");
  const auto workspace_node = map.Optional("workspace");
  const auto capture_node = map.Optional("capture");
  const auto verification_node = map.Optional("verification");
  const auto segmentation_node = map.Optional("segmentation");
  const auto policy_node = map.Optional("policy");
  const auto calibration_node = map.Optional("calibration");
  const auto sound_node = map.Optional("sound");
  const auto separation_node = map.Optional("separation");
  const auto server_node = map.Optional("server");
  map.Finish();

  RobotAndGrid robot = ReadRobotAndGrid(robot_node, grid_node, folder);
  Cell cell{
      .file = path,
      .name = name,
      .database = std::move(database),
      .simulation = std::move(simulation),
      .robot = std::move(robot.robot),
      .grid = std::move(robot.grid),
      .grid_move = robot.grid_move,
      .fixed_joints = std::move(robot.fixed_joints),
      .joint_slides = std::move(robot.joint_slides),
      .views = ReadViews(views_node, margin_node ? ReadMargin(*margin_node) : Margin{}, folder),
      .workspace = std::nullopt,
      .capture = {},
      .verification = {},
      .segmentation = {},
      .policy = {},
      .choose_preset = true,
      .calibration = {},
      .sound = std::nullopt,
      .separation = std::nullopt,
      .server = {}};
  if (workspace_node) cell.workspace = ReadWorkspace(*workspace_node);
  if (capture_node) cell.capture = ReadCapture(*capture_node, cell.grid, cell.robot.model.get());
  if (verification_node) cell.verification = ReadVerification(*verification_node);
  if (segmentation_node) cell.segmentation = ReadSegmentation(*segmentation_node);
  if (policy_node) {
    const PolicySettings policy = ReadPolicy(*policy_node, static_cast<int>(cell.views.size()));
    cell.policy = policy.policy;
    cell.choose_preset = !policy.names_preset;
  }
  if (calibration_node) cell.calibration = ReadCalibration(*calibration_node);
  if (sound_node) {
    if (cell.robot.model == nullptr)
      sound_node->Fail("it needs the robot's model; state robot: urdf");
    cell.sound = ReadSound(*sound_node);
  }
  if (separation_node) {
    if (!cell.sound)
      separation_node->Fail("it needs the section 'sound': state its least_obstacle");
    cell.separation = ReadSeparation(*separation_node);
  }
  if (server_node) cell.server = ReadServer(*server_node, folder);
  CheckTolerances(cell, capture_node ? capture_node : server_node);
  CheckMinCover(cell, segmentation_node);
  return cell;
}

// A database that cannot be opened, or is not of the cell, is for those to report who use it.
void TakeTilesOfDatabase(Cell& cell) {
  if (cell.database.empty()) return;
  const auto database = Database::Open(cell.database, Database::Access::kRead);
  if (!database.ok()) return;
  const std::span<const GridJoint> joints = cell.grid.joints();
  const std::span<const GridJoint> stored = (*database)->grid().joints();
  if (!std::ranges::equal(joints, stored)) return;
  const std::span<const int> edges = (*database)->grid().tile_edges();
  cell.grid = ConfigurationGrid({joints.begin(), joints.end()}, {edges.begin(), edges.end()});
}

}  // namespace

bool StatesAGrid(const Cell& cell) {
  return !cell.robot.drawn || (cell.grid_move > 0 && !cell.grid.has_any());
}

bool HasSources(const Cell& cell) {
  for (const ViewSettings& view : cell.views) {
    if (HasImages(view.source)) return true;
  }
  return false;
}

std::string ResolvePath(const std::filesystem::path& folder, const std::string& path) {
  return (folder / path).lexically_normal().string();
}

absl::StatusOr<Cell> LoadCell(const std::string& path, const std::string& database) {
  try {
    Cell cell = ReadCell(path);
    if (!database.empty()) cell.database = database;
    TakeTilesOfDatabase(cell);
    return cell;
  } catch (const YamlError& error) {
    return absl::InvalidArgumentError(error.what());
  }
}

absl::Status WorkspaceHoldsRobot(const Cell& cell) {
  constexpr double kMostBeyond = 0.001;  // metres; models are no more exact
  if (!cell.workspace || cell.robot.model == nullptr) return absl::OkStatus();
  try {
    const ForbiddenRegions forbidden(cell.capture.forbidden_regions, cell.grid);
    ASSIGN_OR_RETURN(
        const std::optional<LinkBeyond> beyond,
        FarthestBeyond(*cell.robot.model, cell.sound ? cell.sound->geometry : BodyGeometry::kVisual,
                       cell.grid.joints(), cell.fixed_joints, forbidden.regions(),
                       cell.robot.payload_radius, *cell.workspace));
    if (!beyond || beyond->by <= kMostBeyond) return absl::OkStatus();
    std::string where;
    for (size_t joint = 0; joint < beyond->q.size(); ++joint) {
      absl::StrAppendFormat(&where, "%s%s = %.2f", joint == 0 ? "" : ", ",
                            cell.grid.joints()[joint].name, beyond->q[joint]);
    }
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: '%s' is %.3f m beyond %s at %s, where %s: enlarge "
        "'workspace', in metres, so that it holds the whole robot, or leave it out; joint values "
        "that the robot never takes belong into 'capture: forbidden_regions'",
        cell.file, cell.robot.model->links()[beyond->link].name, beyond->by, FaceName(beyond->face),
        where,
        !cell.robot.drawn ? "obstacles would not be found"
        : cell.sound      ? "no verdict of the sound presets is free"
                          : "verify-model does not drive it"));
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(cell.file + ": " + error.what());
  }
}

absl::StatusOr<Workspace> WorkspaceOf(const Cell& cell) {
  if (cell.workspace) {
    if (!cell.robot.drawn) RETURN_IF_ERROR(WorkspaceHoldsRobot(cell));
    return *cell.workspace;
  }
  if (cell.robot.model == nullptr) {
    return absl::InvalidArgumentError(
        cell.file + ": the robot's space is not known; say 'workspace', or the robot's 'urdf'");
  }
  std::vector<std::string> moving;
  for (const GridJoint& joint : cell.grid.joints()) moving.push_back(joint.name);
  return ReachBox(*cell.robot.model, moving, cell.fixed_joints, cell.robot.payload_radius);
}

absl::StatusOr<std::optional<SoundCell>> SoundCellOf(const Cell& cell) {
  if (!cell.sound) return std::optional<SoundCell>();
  ASSIGN_OR_RETURN(const Workspace workspace, WorkspaceOf(cell));
  return std::optional<SoundCell>(SoundCell{.settings = *cell.sound,
                                            .workspace = workspace,
                                            .robot_may_leave = cell.workspace && cell.robot.drawn,
                                            .payload_radius = cell.robot.payload_radius,
                                            .robot = cell.robot.model,
                                            .separation = cell.separation});
}

absl::StatusOr<JointRegions> ForbiddenOf(const Cell& cell) {
  try {
    return ForbiddenRegions(cell.capture.forbidden_regions, cell.grid).regions();
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(cell.file + ": " + error.what());
  }
}

absl::StatusOr<std::optional<DrawnCell>> DrawnCellOf(const Cell& cell) {
  if (!cell.robot.drawn) return std::optional<DrawnCell>();
  DrawnCell drawn{.robot = cell.robot.model,
                  .parts = *cell.robot.drawn,
                  .payload_radius = cell.robot.payload_radius,
                  .fixed_joint_tolerance = cell.server.scene.fixed_joint_tolerance};
  ASSIGN_OR_RETURN(drawn.forbidden, ForbiddenOf(cell));
  for (const ForbiddenRegion& region : cell.capture.forbidden_regions) {
    for (const ForbiddenRegion::Range& range : region.ranges) {
      absl::StrAppendFormat(&drawn.forbidden_text, "%s %.17g %.17g; ", range.joint, range.lower,
                            range.upper);
    }
    drawn.forbidden_text += "\n";
  }
  return std::optional(std::move(drawn));
}

storage::v1::CellDescription DescriptionOf(const Cell& cell) {
  storage::v1::CellDescription description;
  description.set_name(cell.name);
  for (const GridJoint& joint : cell.grid.joints()) {
    storage::v1::GridJoint& stored = *description.add_grid_joints();
    stored.set_name(joint.name);
    stored.set_lower(joint.lower);
    stored.set_upper(joint.upper);
    stored.set_steps(joint.steps);
    stored.set_continuous(joint.continuous);
  }
  for (int edge : cell.grid.tile_edges()) description.add_tile_edges(edge);
  for (const FixedJoint& joint : cell.fixed_joints) {
    storage::v1::FixedJoint& stored = *description.add_fixed_joints();
    stored.set_name(joint.name);
    stored.set_position(joint.position);
  }
  for (const ViewSettings& view : cell.views) {
    storage::v1::View& stored = *description.add_views();
    stored.set_name(view.name);
    stored.set_image_width(view.image_width);
    stored.set_image_height(view.image_height);
    stored.set_mask_width(view.mask_size.width);
    stored.set_mask_height(view.mask_size.height);
  }
  if (HasSources(cell)) description.set_segmentation(Describe(cell.segmentation));
  return description;
}

}  // namespace silhouette
