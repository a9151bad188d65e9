// SPDX-License-Identifier: Apache-2.0
// silhouette-sim path
#include <iostream>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "capture/sim/contact.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/program/path_file.h"
#include "tools/program/program.h"
#include "tools/silhouette-sim/commands.h"
#include "tools/silhouette-sim/path_picture.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {
namespace {

struct PathArguments {
  WorkplaceArguments workplace;
  std::string path;
  std::string picture;
};

// What was found, and on the way from which waypoint to the next.
struct Place {
  size_t waypoint = 0;
  MotionContact motion;
};

// Its waypoints, radians and metres, in the order of the grid's joints.
absl::StatusOr<std::vector<std::vector<double>>> ReadWaypoints(const std::string& file,
                                                               const Workplace& workplace) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  ASSIGN_OR_RETURN(PathFile path, ParsePath(text, file));
  std::vector<std::string> joints;
  for (const GridJoint& joint : workplace.cell.grid.joints()) joints.push_back(joint.name);
  RETURN_IF_ERROR(RequireJoints(path, joints));
  return std::move(path.waypoints);
}

// The first contact, else the narrowest place.
Place Judge(const Workplace& workplace, const std::vector<std::vector<double>>& positions) {
  const ContactChecker checker(workplace.robot, workplace.obstacles);
  const MotionChecker motions(workplace.robot, checker);
  std::optional<Place> narrowest;
  const size_t legs = std::max<size_t>(1, positions.size() - 1);
  for (size_t i = 0; i < legs; ++i) {
    const MotionContact motion = motions.Check(
        positions[i], positions[std::min(i + 1, positions.size() - 1)], workplace.obstacle_poses);
    if (!narrowest || motion.contact.distance < narrowest->motion.contact.distance) {
      narrowest = Place{i, motion};
    }
    if (motion.contact.touching) break;
  }
  return *narrowest;
}

// The place's values of the grid's joints.
Configuration GridValues(const Workplace& workplace, const std::vector<double>& positions) {
  Configuration configuration;
  for (const GridJoint& joint : workplace.cell.grid.joints()) {
    configuration.push_back(positions[workplace.robot.JointIndex(joint.name).value()]);
  }
  return configuration;
}

absl::StatusOr<ExitCode> RunPath(const PathArguments& arguments) {
  ASSIGN_OR_RETURN(const Workplace workplace, LoadWorkplace(arguments.workplace));
  ASSIGN_OR_RETURN(const auto waypoints, ReadWaypoints(arguments.path, workplace));
  std::vector<std::vector<double>> positions;
  for (size_t i = 0; i < waypoints.size(); ++i) {
    const auto at = workplace.Positions(waypoints[i]);
    if (!at.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat(arguments.path, ": waypoint ", i, ": ", at.status().message()));
    }
    positions.push_back(*at);
  }
  if (!arguments.picture.empty()) {
    RETURN_IF_ERROR(WriteMotion(workplace, positions, arguments.picture));
  }
  const Place place = Judge(workplace, positions);
  const Contact& contact = place.motion.contact;
  const Configuration configuration = GridValues(workplace, place.motion.positions);
  if (arguments.workplace.json()) {
    nlohmann::ordered_json json{{"waypoints", waypoints.size()}};
    json.update(JsonOf(contact));
    json["waypoint"] = place.waypoint;
    json["fraction"] = place.motion.fraction;
    json["configuration"] = configuration;
    std::cout << json.dump(2) << '\n';
  } else {
    std::cout << absl::StrFormat(
        "path of %d waypoints: %s%s at %s, %.0f %% on the way from waypoint %d\n", waypoints.size(),
        contact.touching ? "" : "narrowest place: ", Spoken(contact), Spoken(configuration),
        100 * place.motion.fraction, place.waypoint);
  }
  return contact.touching ? kNo : kDone;
}

}  // namespace

void AddPathCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "path", "Check whether the robot touches an obstacle anywhere on a path");
  auto arguments = std::make_shared<PathArguments>();
  AddWorkplaceOptions(*command, arguments->workplace, true);
  command
      ->add_option("--path", arguments->path,
                   "A JSON file with a list of configurations under the key \"waypoints\"")
      ->required();
  AddPictureOption(*command, arguments->picture,
                   "Write the robot's silhouettes along the path, in every view, as a PNG");
  command->callback([arguments, &run] { run = [arguments] { return RunPath(*arguments); }; });
}

}  // namespace silhouette
