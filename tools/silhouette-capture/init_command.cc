// SPDX-License-Identifier: Apache-2.0
// silhouette-capture init: the first cell.yaml of a cell, from the robot's model and the cameras
// that answer.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "capture/drivers/aravis/aravis_camera.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/program/joint_values.h"
#include "tools/silhouette-capture/commands.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// More joints make too many configurations for a capture.
constexpr size_t kMostCapturedJoints = 4;

struct InitOptions {
  std::string urdf;
  std::vector<std::string> package_paths;
  std::vector<std::string> joints;  // name, or name=lower:upper
  std::string driver = "manual";
  std::string simulation;
  std::vector<std::string> views;  // name=source
  std::vector<int> image_size = {640, 480};
  std::string images;  // captured, drawn; empty: by the number of joints
  std::string out = "cell.yaml";
};

// A text as YAML takes it.
std::string YamlText(const std::string& text) {
  const bool plain = !text.empty() && std::ranges::all_of(text, [](unsigned char c) {
    return std::isalnum(c) || c == '_' || c == '.' || c == '/' || c == '-';
  }) && std::isalpha(static_cast<unsigned char>(text.front()));
  return plain ? text : nlohmann::json(text).dump();
}

// A path as the cell's file, which paths are relative to, names it.
std::string PathInCell(const InitOptions& options, const std::string& path) {
  const fs::path folder = fs::absolute(options.out).parent_path();
  return YamlText(fs::absolute(path).lexically_proximate(folder).string());
}

struct MovingJoint {
  const RobotJoint* joint;
  std::string range;  // as YAML, after the name
};

// InvalidArgument: the model has no such joint, or none.
absl::StatusOr<std::vector<MovingJoint>> MovingJoints(const InitOptions& options,
                                                      const RobotModel& robot) {
  std::vector<MovingJoint> moving;
  for (const std::string& text : options.joints) {
    const std::pair<std::string, std::string> parts = absl::StrSplit(text, absl::MaxSplits('=', 1));
    const auto index = robot.JointIndex(parts.first);
    if (!index) {
      return InvalidArgument("--joint ", text, ": ", robot.NoJoint(parts.first).message());
    }
    std::string range;
    if (!parts.second.empty()) {
      const std::vector<std::string> bounds = absl::StrSplit(parts.second, ':');
      if (bounds.size() != 2) {
        return InvalidArgument("--joint ", text, ": write name=lower:upper, as in ", parts.first,
                               "=-90deg:90deg");
      }
      for (size_t i = 0; i < 2; ++i) {
        std::string bound = bounds[i];
        const bool slides = robot.joints()[*index].type == JointType::kPrismatic;
        const double value = ParseJointValue(bound, AngleUnit::kRadians, slides);
        const std::string hint = slides ? "" : DegreesHint({{value}});
        if (!hint.empty()) {
          return InvalidArgument("--joint ", text, ": ", bound, " is more than two turns", hint);
        }
        if (bound.ends_with("deg")) bound.insert(bound.size() - 3, " ");
        absl::StrAppend(&range, i == 0 ? ", lower: " : ", upper: ", bound);
      }
    }
    moving.push_back({&robot.joints()[*index], range});
  }
  if (!options.joints.empty()) return moving;
  for (const RobotJoint& joint : robot.joints()) moving.push_back({&joint, ""});
  if (moving.empty()) return InvalidArgument(options.urdf, ": no joint of the robot moves");
  if (moving.size() > kMaxJoints) {
    std::vector<std::string> names;
    for (const MovingJoint& joint : moving) names.push_back("'" + joint.joint->name + "'");
    return InvalidArgument(
        options.urdf, ": ", names.size(), " joints of the robot move, at most ", kMaxJoints,
        " may; name those with --joint, each by itself: ", absl::StrJoin(names, ", "),
        "; the others, of a gripper, say, are fixed");
  }
  return moving;
}

std::string RobotText(const InitOptions& options, const RobotModel& robot,
                      const std::vector<MovingJoint>& moving, bool drawn) {
  std::string text =
      "robot:\n"
      "  # What moves the robot (docs/capture.md, \"Robots\"). manual: a person with the "
      "pendant.\n";
  absl::StrAppend(&text, "  driver: ", options.driver,
                  "\n  urdf: ", PathInCell(options, options.urdf), "\n");
  for (const std::string& path : options.package_paths) {
    absl::StrAppend(&text, &path == &options.package_paths.front() ? "  package_paths:\n" : "",
                    "    - ", PathInCell(options, path), "\n");
  }
  absl::StrAppend(
      &text,
      "  # How far tool and payload reach beyond the model's outermost links, in metres.\n"
      "  payload_radius: 0\n"
      "  # captured: the robot is driven through a grid. drawn: its images are drawn from the "
      "model,\n"
      "  # at any configuration; that needs a calibration.\n",
      "  images: ", drawn ? "drawn" : "captured",
      "\n  # The joints that move, in the order in which programs take their values. Without a\n"
      "  # range: the limits of the model.\n  joints:\n");
  for (const MovingJoint& joint : moving) {
    absl::StrAppend(&text, "    - {name: ", YamlText(joint.joint->name), joint.range, "}\n");
  }
  std::string fixed;
  for (const RobotJoint& joint : robot.joints()) {
    if (std::ranges::any_of(moving, [&](const auto& m) { return m.joint == &joint; })) continue;
    absl::StrAppendFormat(&fixed, "    %s: %.17g\n", YamlText(joint.name),
                          std::clamp(0.0, joint.lower, joint.upper));
  }
  if (!fixed.empty()) {
    absl::StrAppend(&text,
                    "  # Where the other joints stand, radians or metres. Check them.\n  fixed:\n",
                    fixed);
  }
  return text;
}

// By name: its source as YAML. NotFound: none is given, and none answers.
absl::StatusOr<std::map<std::string, std::string>> Sources(const InitOptions& options) {
  std::map<std::string, std::string> sources;
  for (const std::string& view : options.views) {
    const std::pair<std::string, std::string> parts = absl::StrSplit(view, absl::MaxSplits('=', 1));
    if (parts.first.empty() || parts.second.empty()) {
      return InvalidArgument("--view ", view, ": write name=source, as in top=/dev/video0");
    }
    std::string source = parts.second;
    if (source.starts_with("/dev/")) source = "{v4l2: " + YamlText(source) + "}";
    if (source.starts_with("rtsp://") || source.starts_with("rtsps://")) {
      source = "{rtsp: " + YamlText(source) + "}";
    }
    if (!sources.emplace(parts.first, source).second) {
      return InvalidArgument("--view ", parts.first, " stands twice; each view has its own name");
    }
  }
  if (!sources.empty()) return sources;
  std::cerr << "looking for cameras on the network, USB and /dev/video*" << std::endl;
  const auto add = [&](const std::string& source) {
    sources.emplace(absl::StrFormat("camera_%d", sources.size() + 1), source);
  };
  for (const FoundCamera& camera : FindGenicamCameras()) {
    add(absl::StrCat("{", camera.protocol == "USB3Vision" ? "usb3" : "gige",
                     ": {serial: ", nlohmann::json(camera.serial).dump(), "}}"));
  }
  for (const V4l2Device& device : FindV4l2Devices()) add("{v4l2: " + YamlText(device.device) + "}");
  if (!sources.empty()) return sources;
  return absl::NotFoundError(
      "no camera answers; name them, as in --view top=rtsp://192.168.0.20/stream1 "
      "--view front='{gige: {address: 192.168.0.21}}'");
}

std::string CellText(const InitOptions& options, const RobotModel& robot,
                     const std::vector<MovingJoint>& moving,
                     const std::map<std::string, std::string>& sources, bool drawn) {
  std::string text =
      "# Every key: docs/cell.yaml. Angles are radians, or have a unit: \"90 deg\".\n";
  absl::StrAppend(&text, "name: ", YamlText(robot.name()),
                  "\n\ndatabase: ", YamlText(fs::path(options.out).stem().string() + ".lmdb"),
                  "\n\n");
  if (!options.simulation.empty()) {
    absl::StrAppend(&text, "simulation: ", PathInCell(options, options.simulation), "\n\n");
  }
  absl::StrAppend(&text, RobotText(options, robot, moving, drawn), "\n");
  if (!drawn) {
    absl::StrAppend(&text,
                    "grid:\n"
                    "  # How far any point of the robot moves at most from one grid value to the "
                    "next, in metres.\n"
                    "  # Half of it makes twice as many values per joint.\n"
                    "  max_move: 0.1\n\n");
  }
  const int width = options.image_size[0];
  const int height = options.image_size[1];
  // Of the shape of the image. With fewer than four camera pixels a mask pixel the frayed rims of
  // captured masks look to verify-model like a camera that moved.
  const int longest = std::max(width, height);
  const int longest_of_mask = std::clamp(longest / 4, 64, 128);
  const auto mask_side = [=](int side) {
    return std::max(1, longest <= longest_of_mask ? side : side * longest_of_mask / longest);
  };
  absl::StrAppend(&text, "# The stationary cameras (docs/capture.md, \"Cameras\").\nviews:\n");
  for (const auto& [name, source] : sources) {
    absl::StrAppendFormat(
        &text,
        "  - name: %s\n"
        "    source: %s\n"
        "    # Width and height of the camera's images, and of the masks, in pixels.\n"
        "    image_size: [%d, %d]\n"
        "    mask_size: [%d, %d]\n",
        YamlText(name), source, width, height, mask_side(width), mask_side(height));
  }
  absl::StrAppend(
      &text,
      "\n# With a calibration, this section lets the sound presets find obstacles of this radius, "
      "in\n# metres, that the robot hides (docs/verdict-quality.md).\n"
      "# sound: {least_obstacle: 0.15}\n");
  return text;
}

absl::StatusOr<ExitCode> Init(const InitOptions& options) {
  if (fs::exists(options.out)) {
    return absl::AlreadyExistsError(
        absl::StrCat("'", options.out, "' is there already; name another file with --out"));
  }
  const auto read = RobotModel::FromUrdf(options.urdf, options.package_paths);
  if (!read.ok()) {
    return absl::Status(
        read.status().code(),
        absl::StrReplaceAll(read.status().message(), {{"package_paths", "--package-path"}}));
  }
  const RobotModel& robot = *read;
  ASSIGN_OR_RETURN(const auto moving, MovingJoints(options, robot));
  const bool drawn =
      options.images.empty() ? moving.size() > kMostCapturedJoints : options.images == "drawn";
  ASSIGN_OR_RETURN(const auto sources, Sources(options));
  RETURN_IF_ERROR(WriteWholeFile(options.out, CellText(options, robot, moving, sources, drawn)));
  const auto cell = LoadCell(options.out);
  if (!cell.ok()) {
    fs::remove(options.out);
    absl::string_view message = cell.status().message();  // "cell.yaml:18: robot: ..."
    if (absl::ConsumePrefix(&message, options.out)) message.remove_prefix(message.find(": ") + 2);
    return InvalidArgument("the options make no valid cell file: ", message);
  }
  std::cout << "wrote " << options.out << ": " << Counted(moving.size(), "joint") << ", "
            << (drawn ? std::string("drawn robot images")
                      : absl::StrCat(cell->grid.size(), " configurations to capture"))
            << ", views "
            << absl::StrJoin(
                   sources, ", ",
                   [](std::string* out, const auto& source) { out->append(source.first); })
            << "\nRead it and correct it, then: silhouette-capture check --cell " << options.out
            << std::endl;
  return kDone;
}

}  // namespace

void AddInit(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "init",
      "Writes a commented cell.yaml from the robot's model and the cameras that answer, or those\n"
      "that are named.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture init --urdf robot.urdf --joint joint_1 --joint joint_3=-90deg:90deg\n"
      "  silhouette-capture init --urdf robot.urdf --driver '{grpc: {address: "
      "\"localhost:50061\"}}' \\\n"
      "    --view top=/dev/video0 --view front=rtsp://192.168.0.20/stream1\n"
      "Exit codes: 0 done; 2 wrong arguments or files, or no camera.");
  const auto options = std::make_shared<InitOptions>();
  command->add_option("--urdf", options->urdf, "The robot's model")->required();
  command
      ->add_option("--package-path", options->package_paths,
                   "A folder for the packages of package:// paths in it")
      ->allow_extra_args(false);
  command
      ->add_option("--joint", options->joints,
                   "name, or name=lower:upper: a joint that moves; default: all. More than four\n"
                   "are too many for a capture: robot images are then drawn")
      ->allow_extra_args(false);
  command->add_option("--driver", options->driver, "The robot's driver, as in cell.yaml")
      ->capture_default_str();
  command
      ->add_option(
          "--view", options->views,
          "name=source: a camera; the source as in cell.yaml, or /dev/video0, or rtsp://...\n"
          "Default: all that answer")
      ->allow_extra_args(false);
  command
      ->add_option("--image-size", options->image_size, "Width and height of the cameras' images")
      ->check(PositiveNumber())
      ->expected(2)
      ->capture_default_str();
  command->add_option("--images", options->images, "How the robot images are made")
      ->check(CLI::IsMember({"captured", "drawn"}));
  command->add_option("--simulation", options->simulation,
                      "The description of a simulated cell, for the driver and the source sim");
  command->add_option("--out", options->out, "The file")->capture_default_str();
  command->callback([options, &work] { work = [options] { return Init(*options); }; });
}

}  // namespace silhouette
