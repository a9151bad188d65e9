// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-sim/workplace.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "db/status/status_macros.h"
#include "tools/program/joint_values.h"
#include "tools/program/program.h"

namespace silhouette {

void AddWorkplaceOptions(CLI::App& command, WorkplaceArguments& arguments, bool scene_required) {
  command.add_option("--cell", arguments.cell, "The cell's file, cell.yaml")->required();
  command.add_option("--scene", arguments.scene, "The obstacles' file, obstacles.yaml")
      ->required(scene_required);
  TakeTimes(command.add_option("--time", arguments.time, "When to look at moving obstacles"), 0,
            1e6)
      ->default_str("0 s");
  command
      .add_option("--variant", arguments.variant,
                  "What the robot carries: that of this variant ('parts' of the "
                  "simulation)")
      ->capture_default_str();
  AddFormatOption(command, arguments.format);
}

std::vector<double> Workplace::Parse(std::string_view configuration) const {
  std::vector<std::optional<bool>> slides;
  for (const GridJoint& joint : cell.grid.joints()) slides.push_back(Slides(joint.name));
  return ParseConfiguration(configuration, slides);
}

std::optional<bool> Workplace::Slides(const std::string& joint) const {
  const auto found = cell.joint_slides.find(joint);
  return found != cell.joint_slides.end() ? std::optional(found->second) : std::nullopt;
}

absl::StatusOr<std::vector<double>> Workplace::Positions(
    std::span<const double> configuration) const {
  const std::span<const GridJoint> grid = cell.grid.joints();
  if (configuration.size() != grid.size()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the configuration ", Spoken(configuration), " does not fit the grid's joints ",
        absl::StrJoin(grid, ", ", [](std::string* out, const GridJoint& joint) {
          absl::StrAppend(out, joint.name);
        })));
  }
  std::vector<std::string> names;
  std::vector<double> values(configuration.begin(), configuration.end());
  for (const GridJoint& joint : grid) names.push_back(joint.name);
  for (const FixedJoint& joint : cell.fixed_joints) {
    names.push_back(joint.name);
    values.push_back(joint.position);
  }
  return robot.Positions(names, values);
}

absl::StatusOr<Workplace> LoadWorkplace(const WorkplaceArguments& arguments) {
  ASSIGN_OR_RETURN(Cell cell, LoadCell(arguments.cell));
  if (cell.robot.model == nullptr) {
    return absl::InvalidArgumentError(arguments.cell +
                                      ": the robot has no 'urdf', so there is nothing to simulate");
  }
  absl::StatusOr<RobotModel> robot = *cell.robot.model;
  if (!cell.simulation.empty()) {
    ASSIGN_OR_RETURN(const auto settings, LoadSimulation(cell.simulation));
    robot = Carrying(*robot, settings.parts, arguments.variant);
    if (!robot.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(cell.simulation, ": ", robot.status().message()));
    }
  }
  absl::StatusOr<std::vector<Obstacle>> obstacles = std::vector<Obstacle>();
  if (!arguments.scene.empty()) obstacles = LoadObstacles(arguments.scene);
  if (!obstacles.ok()) return obstacles.status();
  Poses poses = ObstaclePoses(*obstacles, arguments.time);
  return Workplace{std::move(cell), *std::move(robot), *std::move(obstacles), std::move(poses)};
}

absl::StatusOr<SimulationSettings> SimulationOf(const Cell& cell) {
  if (!cell.simulation.empty()) return LoadSimulation(cell.simulation);
  return absl::InvalidArgumentError(cell.file + ": the key 'simulation' is missing");
}

absl::StatusOr<std::vector<SimulatedView>> SimulatedViews(const Cell& cell) {
  std::vector<SimulatedView> views;
  for (const ViewSettings& view : cell.views) {
    if (IsSimulated(view.source)) views.push_back({view.name, view.image_width, view.image_height});
  }
  if (views.empty()) {
    return absl::InvalidArgumentError(cell.file + ": no view has the source 'sim'");
  }
  return views;
}

std::string Spoken(const Contact& contact) {
  if (contact.obstacle.empty()) return "free, there is no obstacle";
  if (contact.touching) {
    return absl::StrFormat("contact, %s touches %s", contact.link, contact.obstacle);
  }
  return absl::StrFormat("free, %.4f m from %s to %s", contact.distance, contact.link,
                         contact.obstacle);
}

std::string Spoken(std::span<const double> values) {
  return absl::StrCat("(", absl::StrJoin(values, ", "), ")");
}

}  // namespace silhouette
