// silhouette-sim calibration
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "calib/calibration_camera_file.h"
#include "calib/calibration_message.h"
#include "capture/sim/program/commands.h"
#include "capture/sim/program/workplace.h"
#include "tools/picture/files.h"
#include "tools/program/program.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string cell;
  std::string out;
  std::string format = "text";
};

// Writes a file per simulated view; returns their paths.
absl::StatusOr<std::vector<std::string>> WriteCameras(const Arguments& arguments) {
  const absl::StatusOr<Cell> cell = LoadCell(arguments.cell);
  if (!cell.ok()) return cell.status();
  if (cell->simulation.empty()) {
    return absl::InvalidArgumentError(cell->file + ": the key 'simulation' is missing");
  }
  const auto views = SimulatedViews(*cell);
  if (!views.ok()) return views.status();
  const auto settings = LoadSimulation(cell->simulation);
  if (!settings.ok()) return settings.status();
  std::error_code error;
  fs::create_directories(arguments.out, error);
  if (error) {
    return absl::FailedPreconditionError("the folder '" + arguments.out +
                                         "' cannot be made: " + error.message());
  }
  std::vector<std::string> paths;
  for (const SimulatedView& view : *views) {
    const absl::StatusOr<size_t> camera = CameraOf(*settings, view);
    if (!camera.ok()) return camera.status();
    paths.push_back((fs::path(arguments.out) / CameraFileName(view.name)).string());
    const absl::Status written = WriteWholeFile(
        paths.back(), CameraFileText(MessageOf(settings->cameras[*camera].model), view.name));
    if (!written.ok()) return written;
  }
  return paths;
}

int RunCalibration(const Arguments& arguments) {
  const auto paths = WriteCameras(arguments);
  if (!paths.ok()) return Report("silhouette-sim", paths.status());
  if (arguments.format == "json") {
    std::cout << nlohmann::ordered_json{{"cameras", *paths}}.dump(2) << '\n';
    return kDone;
  }
  for (const std::string& path : *paths) std::cout << "wrote " << path << '\n';
  return kDone;
}

}  // namespace

void AddCalibrationCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "calibration",
      "Write the true camera models of the simulated views, a .cameramodel per view");
  auto arguments = std::make_shared<Arguments>();
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
