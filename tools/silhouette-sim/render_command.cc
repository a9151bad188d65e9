// SPDX-License-Identifier: Apache-2.0
// silhouette-sim render
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "absl/strings/str_format.h"
#include "absl/time/time.h"
#include "capture/sim/simulated_cell.h"
#include "capture/sim/yaml_values.h"
#include "common/picture/files.h"
#include "common/picture/picture.h"
#include "db/status/status_macros.h"
#include "tools/program/joint_values.h"
#include "tools/program/program.h"
#include "tools/silhouette-sim/commands.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct RenderArguments {
  WorkplaceArguments workplace;
  std::vector<std::string> configurations;
  std::vector<std::string> joints;
  bool without_robot = false;
  bool all_boards = false;
  std::vector<std::string> held;
  uint64_t frame = 0;
  std::string out;
};

// Where every joint of the robot stands: as in the cell's file, as in `configuration_text` unless
// it is empty, as in --joint; the later wins.
absl::StatusOr<std::map<std::string, double>> JointValues(const RenderArguments& arguments,
                                                          const std::string& configuration_text,
                                                          const Workplace& workplace) {
  const std::span<const GridJoint> grid = workplace.cell.grid.joints();
  std::map<std::string, double> values;
  for (const FixedJoint& joint : workplace.cell.fixed_joints) values[joint.name] = joint.position;
  if (!configuration_text.empty()) {
    const std::vector<double> configuration = workplace.Parse(configuration_text);
    RETURN_IF_ERROR(workplace.Positions(configuration).status());
    for (size_t j = 0; j < grid.size(); ++j) values[grid[j].name] = configuration[j];
  }
  for (const std::string& text : arguments.joints) {
    const std::string joint = text.substr(0, text.find('='));
    const auto [name, value] = ParseJoint(text, AngleUnit::kRadians, workplace.Slides(joint));
    values[name] = value;
  }
  for (const GridJoint& joint : grid) {
    if (!values.contains(joint.name)) {
      return absl::InvalidArgumentError("say where '" + joint.name +
                                        "' stands, with --configuration or --joint");
    }
  }
  return values;
}

absl::StatusOr<std::vector<double>> PositionsOf(const RobotModel& robot,
                                                const std::map<std::string, double>& values) {
  std::vector<std::string> names;
  std::vector<double> numbers;
  for (const auto& [name, value] : values) {
    names.push_back(name);
    numbers.push_back(value);
  }
  return robot.Positions(names, numbers);
}

struct HeldBoard {
  std::string name;
  Eigen::Isometry3d world_from_board;
};

absl::StatusOr<HeldBoard> ParseHeldBoard(const std::string& text) {
  const size_t sign = text.find('=');
  if (sign != std::string::npos) {
    const std::vector<double> v = ParseConfiguration(text.substr(sign + 1));
    if (v.size() == 6) {
      return HeldBoard{text.substr(0, sign),
                       Eigen::Translation3d(v[0], v[1], v[2]) * RotationOf({v[3], v[4], v[5]})};
    }
  }
  return absl::InvalidArgumentError("--hold " + text + ": name=x,y,z,roll,pitch,yaw is expected");
}

absl::Status WriteImages(const std::string& folder, const std::vector<std::string>& views,
                         const std::vector<CameraImage>& images,
                         const std::map<std::string, double>& joints) {
  RETURN_IF_ERROR(MakeFolder(folder));
  nlohmann::ordered_json index{
      {"time", absl::FormatTime(absl::RFC3339_full, images.front().captured, absl::UTCTimeZone())},
      {"joints", joints},
      {"views", nlohmann::ordered_json::object()}};
  for (size_t v = 0; v < views.size(); ++v) {
    const CameraImage& image = images[v];
    RETURN_IF_ERROR(
        WritePng((fs::path(folder) / (views[v] + ".png")).string(),
                 PictureOfPixels(image.width, image.height, image.channels, image.pixels)));
    index["views"][views[v]] = views[v] + ".png";
  }
  return WriteWholeFile((fs::path(folder) / "images.json").string(), index.dump(2) + "\n");
}

// Where the images of each configuration go: all into --out, or of several into folders in it.
std::vector<std::string> FoldersOf(const RenderArguments& arguments) {
  if (arguments.configurations.size() < 2) return {arguments.out};
  std::vector<std::string> folders;
  for (size_t i = 0; i < arguments.configurations.size(); ++i) {
    folders.push_back((fs::path(arguments.out) / absl::StrFormat("%04d", i + 1)).string());
  }
  return folders;
}

absl::Status Render(const RenderArguments& arguments) {
  ASSIGN_OR_RETURN(Workplace workplace, LoadWorkplace(arguments.workplace));
  const Cell& cell = workplace.cell;
  ASSIGN_OR_RETURN(auto settings, SimulationOf(cell));
  const std::vector<std::string> folders = FoldersOf(arguments);
  std::vector<std::map<std::string, double>> joints(folders.size());
  for (size_t i = 0; i < folders.size(); ++i) {
    const bool given = !arguments.configurations.empty();
    if (arguments.without_robot && !given && arguments.joints.empty()) continue;
    ASSIGN_OR_RETURN(joints[i],
                     JointValues(arguments, given ? arguments.configurations[i] : "", workplace));
  }
  ASSIGN_OR_RETURN(const auto views, SimulatedViews(cell));

  const auto simulated = std::make_shared<SimulatedCell>(workplace.robot, std::move(settings));
  ASSIGN_OR_RETURN(const auto rig, SimulatedCameraRig::Create(simulated, views));
  simulated->SetRobotPresent(!arguments.without_robot);
  simulated->SetObstacles(std::move(workplace.obstacles));
  simulated->ShowAllBoards(arguments.all_boards);
  for (const std::string& text : arguments.held) {
    ASSIGN_OR_RETURN(const auto held, ParseHeldBoard(text));
    simulated->HoldBoard(held.name, held.world_from_board);
  }
  for (size_t i = 0; i < folders.size(); ++i) {
    if (!joints[i].empty()) {
      ASSIGN_OR_RETURN(const auto positions, PositionsOf(workplace.robot, joints[i]));
      simulated->SetPositions(positions);
    }
    simulated->SetTime(arguments.workplace.time);
    simulated->SetFrame(arguments.frame + i);
    ASSIGN_OR_RETURN(const auto images, rig->Grab());
    RETURN_IF_ERROR(WriteImages(folders[i], rig->views(), images, joints[i]));
  }
  return absl::OkStatus();
}

absl::StatusOr<ExitCode> RunRender(const RenderArguments& arguments) {
  RETURN_IF_ERROR(Render(arguments));
  const std::vector<std::string> folders = FoldersOf(arguments);
  const std::string index = (fs::path(folders.front()) / "images.json").string();
  if (arguments.workplace.json()) {
    nlohmann::ordered_json json{{"images", index}};
    if (folders.size() > 1) json = {{"folders", folders}};
    std::cout << json.dump(2) << '\n';
  } else {
    std::cout << "wrote the images and " << index
              << (folders.size() > 1 ? ", likewise to " + folders.back() : "") << '\n';
  }
  return kDone;
}

}  // namespace

void AddRenderCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "render", "Write what the cameras see: a PNG per view, and images.json that lists them");
  auto arguments = std::make_shared<RenderArguments>();
  AddWorkplaceOptions(*command, arguments->workplace, false);
  command
      ->add_option(
          "--configuration", arguments->configurations,
          "Values of the grid's joints, e.g. 0.5,-30deg; if given several times, the images "
          "of each go into a folder of its own, OUT/0001 and so on")
      ->allow_extra_args(false);
  command
      ->add_option("--joint", arguments->joints,
                   "name=value: where a single joint stands; may be given several times")
      ->allow_extra_args(false);
  command->add_flag("--without-robot", arguments->without_robot, "Take the robot out of the cell");
  command->add_flag("--all-boards", arguments->all_boards,
                    "Show the boards, too, that are in the cell only for calibration");
  command
      ->add_option("--hold", arguments->held,
                   "name=x,y,z,roll,pitch,yaw: hold a board of tags there, e.g. "
                   "wall=1,0,0.5,90deg,0,0; may be given several times")
      ->allow_extra_args(false);
  command
      ->add_option("--frame", arguments->frame,
                   "Number of the first image; the noise depends on it")
      ->capture_default_str();
  command->add_option("--out", arguments->out, "The folder to write to")->required();
  command->callback([arguments, &run] { run = [arguments] { return RunRender(*arguments); }; });
}

}  // namespace silhouette
