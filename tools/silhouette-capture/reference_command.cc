// SPDX-License-Identifier: Apache-2.0
// silhouette-capture reference: takes the images of the empty cell.
#include <functional>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "capture/session/reference_images.h"
#include "db/status/status_macros.h"
#include "db/store/schema.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"

namespace silhouette {
namespace {

constexpr char kReferenceProgram[] = "silhouette-capture reference";
// Mean noise, in grey levels, that no camera has by itself.
constexpr double kMostNoise = 8;

// More of the image than this, and the light or the exposure should be looked at.
constexpr double kMostSaturated = 0.005;
constexpr double kMostUnsteady = 0.01;

double ReferenceShare(int pixels, const Reference& reference) {
  return static_cast<double>(pixels) / reference.size().area();
}

// What the person in front of the cell should know of a view; empty: nothing.
std::string RemarksOn(const Reference& reference) {
  const Reference::Figures figures = reference.Describe();
  std::string remarks;
  if (figures.mean_noise > kMostNoise) {
    absl::StrAppend(&remarks, "  - did something move? Then take them again");
  }
  if (figures.undefined > 0) {
    absl::StrAppend(
        &remarks,
        absl::StrFormat("  - %d pixels (%.1f %%) never showed the cell without the robot; "
                        "they count as covered by it, always",
                        figures.undefined, 100 * ReferenceShare(figures.undefined, reference)));
  }
  if (ReferenceShare(figures.saturated, reference) > kMostSaturated) {
    absl::StrAppend(&remarks,
                    absl::StrFormat("  - %.1f %% of the pixels are as bright as can be and "
                                    "show nothing that is brighter; shorten the exposure",
                                    100 * ReferenceShare(figures.saturated, reference)));
  }
  if (ReferenceShare(figures.unsteady, reference) > kMostUnsteady) {
    absl::StrAppend(&remarks, absl::StrFormat("  - %.1f %% of the pixels flicker and show little",
                                              100 * ReferenceShare(figures.unsteady, reference)));
  }
  return remarks;
}

void ReferencePrintText(const CellArguments& arguments, const CellFile& file, uint64_t robot_images,
                        const std::vector<Reference>& references) {
  std::cout << absl::StreamFormat("reference images in %s: %d per view\n", file.database,
                                  file.cell.capture.reference_images);
  std::cout << "view                  image       noise, grey levels\n";
  for (size_t v = 0; v < references.size(); ++v) {
    const cv::Size size = references[v].size();
    std::cout << absl::StreamFormat("  %-18s  %-10s  %.2f%s\n", file.cell.views[v].name,
                                    absl::StrFormat("%dx%d", size.width, size.height),
                                    references[v].Describe().mean_noise, RemarksOn(references[v]));
  }
  if (robot_images > 0) {
    std::cout << absl::StreamFormat(
        "the %d records that are there were made with the reference images before these\n",
        robot_images);
  }
  std::cout << "next: " << arguments.Command("run") << std::endl;
}

void ReferencePrintJson(const CellArguments& arguments, const CellFile& file,
                        const std::vector<Reference>& references) {
  nlohmann::json json = {{"database", file.database},
                         {"images", file.cell.capture.reference_images},
                         {"views", nlohmann::json::array()},
                         {"next", arguments.Command("run")}};
  for (size_t v = 0; v < references.size(); ++v) {
    const Reference::Figures figures = references[v].Describe();
    json["views"].push_back({{"name", file.cell.views[v].name},
                             {"colour", references[v].channels() == 3},
                             {"noise", figures.mean_noise},
                             {"undefined", ReferenceShare(figures.undefined, references[v])},
                             {"saturated", ReferenceShare(figures.saturated, references[v])},
                             {"unsteady", ReferenceShare(figures.unsteady, references[v])}});
  }
  std::cout << json.dump(2) << std::endl;
}

struct ReferenceArguments {
  CellArguments cell;
  bool with_robot = false;
  int images = 0;  // 0: as the cell's file says; with the robot kImagesWithRobot
};

constexpr int kImagesWithRobot = 40;

using ReferenceTaken = absl::StatusOr<storage::v1::References>;

// Takes so many sets of images with devices that are open.
using Take =
    std::function<ReferenceTaken(Database& database, int count, const CaptureObserver& observer)>;

absl::StatusOr<Take> OpenEmptyCell(const Cell& cell) {
  ASSIGN_OR_RETURN(auto opened, OpenCamerasOfEmptyCell(cell));
  const std::shared_ptr<CameraRig> rig = std::move(opened);
  return [rig](Database& database, int count, const CaptureObserver& observer) -> ReferenceTaken {
    ASSIGN_OR_RETURN(auto cameras, CellCameras::Create(database.cell(), *rig));
    return TakeReferences(cameras, count, observer);
  };
}

absl::StatusOr<Take> OpenCellWithRobot(const Cell& cell) {
  const auto travel = std::make_shared<const Travel>(cell.grid, cell.capture.forbidden_regions);
  ASSIGN_OR_RETURN(auto opened, OpenDevices(cell, *travel, schema::kDefaultVariant));
  const auto devices = std::make_shared<CellDevices>(std::move(opened));
  return [travel, devices, settings = cell.capture](Database& database, int count,
                                                    const CaptureObserver& observer) {
    return TakeReferencesWithRobot(database, *travel, *devices->robot, *devices->cameras, settings,
                                   count, observer);
  };
}

absl::StatusOr<ExitCode> ReferenceRun(const ReferenceArguments& options) {
  const CellArguments& arguments = options.cell;
  ASSIGN_OR_RETURN(CellFile file, OpenCellFile(arguments));
  ASSIGN_OR_RETURN(const auto take,
                   options.with_robot ? OpenCellWithRobot(file.cell) : OpenEmptyCell(file.cell));
  ASSIGN_OR_RETURN(auto database, OpenOrCreateDatabase(file));
  int& count = file.cell.capture.reference_images;
  if (options.with_robot) count = kImagesWithRobot;
  if (options.images > 0) count = options.images;

  CatchStopSignals();
  std::optional<Progress> progress;
  progress.emplace("reference images", count, "sets");
  CaptureObserver observer;
  observer.progress = [&](uint64_t done) { progress->Update(done); };
  observer.say = [&](const std::string& line) { progress->Say(line); };
  observer.stop_requested = StopRequested;
  const ReferenceTaken taken = (take)(*database, count, observer);
  progress.reset();
  if (absl::IsCancelled(taken.status())) {
    std::cerr << taken.status().message() << "; take them with: " << arguments.Command("reference")
              << std::endl;
    return kNo;
  }
  if (!taken.ok()) return taken.status();
  ASSIGN_OR_RETURN(const auto snapshot, database->Read());
  RETURN_IF_ERROR(database->SetReferences(*taken, kReferenceProgram));
  ASSIGN_OR_RETURN(const auto references, ReadReferences(*database));
  if (arguments.json()) {
    ReferencePrintJson(arguments, file, references);
  } else {
    ReferencePrintText(arguments, file, snapshot.size(), references);
  }
  return kDone;
}

}  // namespace

void AddReference(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "reference",
      "Takes the reference images: what the cameras see of the cell without the robot.\n"
      "Makes the database if it is not there. A simulated robot is taken out of the cell;\n"
      "take a real one out of all views yourself. Where it cannot leave: --with-robot.");
  command->footer(
      "Example:\n  silhouette-capture reference --cell cell.yaml --database cell.lmdb\n"
      "  silhouette-capture reference --cell cell.yaml --with-robot --images 60");
  const auto arguments = std::make_shared<ReferenceArguments>();
  AddCellOptions(*command, arguments->cell);
  command->add_flag("--with-robot", arguments->with_robot,
                    "Drive the robot to configurations spread over the grid, one set of images at "
                    "each, and\ntake what is seen where it is not");
  command
      ->add_option("--images", arguments->images,
                   "Sets of images (default: reference_images of the cell's file; 40 with the "
                   "robot)")
      ->check(CLI::Range(2, 10000));
  command->callback(
      [arguments, &work] { work = [arguments] { return ReferenceRun(*arguments); }; });
}

}  // namespace silhouette
