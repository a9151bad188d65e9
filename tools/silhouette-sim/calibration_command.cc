// SPDX-License-Identifier: Apache-2.0
// silhouette-sim calibration
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "absl/strings/str_format.h"
#include "calib/files/camera_file.h"
#include "capture/sim/yaml_values.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/silhouette-sim/commands.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

constexpr char kBoardPosesFile[] = "board_poses.yaml";

struct CalibrationArguments {
  std::string cell;
  std::string out;
  std::string format = "text";
};

// Where the boards are, so that a person can compare.
std::string BoardPosesText(const SimulationSettings& settings) {
  std::string text =
      "# Where the simulated cell's boards are: the frame of each board in the one named, metres;\n"
      "# rotation: roll, pitch, yaw in radians; quaternion: x, y, z, w. The same rotation twice.\n";
  for (const SimulatedBoard& board : settings.boards) {
    if (!board.pose) continue;
    const Eigen::Vector3d t = board.pose->translation();
    const Eigen::Vector3d r = RollPitchYawOf(board.pose->linear());
    const Eigen::Quaterniond q(board.pose->linear());
    absl::StrAppend(&text, "- name: ", nlohmann::json(board.board.description().name).dump(),
                    "\n  frame: ", nlohmann::json(board.link.empty() ? "base" : board.link).dump(),
                    absl::StrFormat("\n  position: [%.17g, %.17g, %.17g]", t.x(), t.y(), t.z()),
                    absl::StrFormat("\n  rotation: [%.17g, %.17g, %.17g]", r.x(), r.y(), r.z()),
                    absl::StrFormat("\n  quaternion: [%.17g, %.17g, %.17g, %.17g]\n", q.x(), q.y(),
                                    q.z(), q.w()));
  }
  return text;
}

// The files written.
struct Written {
  std::vector<std::string> cameras;
  std::string boards;  // empty: there are none
};

// Writes a file per simulated view, and one for the boards if there are any.
absl::StatusOr<Written> CalibrationWriteTruth(const CalibrationArguments& arguments) {
  ASSIGN_OR_RETURN(const Cell cell, LoadCell(arguments.cell));
  ASSIGN_OR_RETURN(const auto settings, SimulationOf(cell));
  ASSIGN_OR_RETURN(const auto views, SimulatedViews(cell));
  RETURN_IF_ERROR(MakeFolder(arguments.out));
  Written written;
  for (const SimulatedView& view : views) {
    ASSIGN_OR_RETURN(const size_t camera, CameraOf(settings, view));
    written.cameras.push_back((fs::path(arguments.out) / CameraFileName(view.name)).string());
    RETURN_IF_ERROR(WriteWholeFile(written.cameras.back(),
                                   CameraFileText(settings.cameras[camera].model, view.name)));
  }
  if (!settings.boards.empty()) {
    written.boards = (fs::path(arguments.out) / kBoardPosesFile).string();
    RETURN_IF_ERROR(WriteWholeFile(written.boards, BoardPosesText(settings)));
  }
  return written;
}

absl::StatusOr<ExitCode> RunCalibration(const CalibrationArguments& arguments) {
  ASSIGN_OR_RETURN(const Written written, CalibrationWriteTruth(arguments));
  if (arguments.format == "json") {
    nlohmann::ordered_json json{{"cameras", written.cameras}};
    if (!written.boards.empty()) json["boards"] = written.boards;
    std::cout << json.dump(2) << '\n';
    return kDone;
  }
  for (const std::string& path : written.cameras) std::cout << "wrote " << path << '\n';
  if (!written.boards.empty()) std::cout << "wrote " << written.boards << '\n';
  return kDone;
}

}  // namespace

void AddCalibrationCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "calibration",
      "Write the true camera models of the simulated views, a .cameramodel per view,\n"
      "and the true poses of its boards of tags, board_poses.yaml");
  auto arguments = std::make_shared<CalibrationArguments>();
  command->add_option("--cell", arguments->cell, "The cell's file, cell.yaml")->required();
  command->add_option("--out", arguments->out, "The folder to write to")->required();
  AddFormatOption(*command, arguments->format);
  command->footer(
      "Example:\n"
      "  silhouette-sim calibration --cell cell.yaml --out cameras\n"
      "  silhouette-db calibration import cell.lmdb cameras");
  command->callback(
      [arguments, &run] { run = [arguments] { return RunCalibration(*arguments); }; });
}

}  // namespace silhouette
