// SPDX-License-Identifier: Apache-2.0
// What the commands need of a cell: its file, its robot, its obstacles.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/robot_model.h"
#include "capture/sim/contact.h"
#include "capture/sim/obstacles.h"
#include "capture/sim/simulated_cell.h"
#include "tools/cell/cell.h"

namespace silhouette {

// The arguments that the commands share.
struct WorkplaceArguments {
  std::string cell;
  std::string scene;
  double time = 0;
  std::string variant = kBareVariant;
  std::string format = "text";

  bool json() const { return format == "json"; }
};

// Adds --cell, --scene, --time, --variant and --format.
void AddWorkplaceOptions(CLI::App& command, WorkplaceArguments& arguments, bool scene_required);

struct Workplace {
  Cell cell;
  RobotModel robot;  // with what it carries
  std::vector<Obstacle> obstacles;
  Poses obstacle_poses;  // at the time asked for

  // "0.5,-30deg,0.2m": a configuration of the grid. Throws as ParseJointValue does.
  std::vector<double> Parse(std::string_view configuration) const;
  // Whether the joint slides, if the cell knows it.
  std::optional<bool> Slides(const std::string& joint) const;

  // The values of all joints of the robot for a configuration of the grid. InvalidArgument: wrong
  // number of values, or beyond the robot's limits.
  absl::StatusOr<std::vector<double>> Positions(std::span<const double> configuration) const;
};

absl::StatusOr<Workplace> LoadWorkplace(const WorkplaceArguments& arguments);

// The simulation that the cell names; InvalidArgument if it names none, else LoadSimulation()'s.
absl::StatusOr<SimulationSettings> SimulationOf(const Cell& cell);

// The views of the cell that the simulation takes images for; InvalidArgument if there is none.
absl::StatusOr<std::vector<SimulatedView>> SimulatedViews(const Cell& cell);

// "touches box with forearm", "free, 0.123 m from forearm to box" or "free, there is no obstacle".
std::string Spoken(const Contact& contact);

// "(0.5, -0.25)"
std::string Spoken(std::span<const double> values);

// Truth as JSON.

// {"contact": bool, "distance": metres, "link": name, "obstacle": name}; without obstacles the last
// three are null.
inline nlohmann::ordered_json JsonOf(const Contact& contact) {
  nlohmann::ordered_json json{{"contact", contact.touching}};
  const bool any = !contact.obstacle.empty();
  json["distance"] = any ? nlohmann::ordered_json(contact.distance) : nullptr;
  json["link"] = any ? nlohmann::ordered_json(contact.link) : nullptr;
  json["obstacle"] = any ? nlohmann::ordered_json(contact.obstacle) : nullptr;
  return json;
}

}  // namespace silhouette
