// silhouette-capture reference: takes the images of the empty cell.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "capture/open_devices/cell_devices.h"
#include "capture/program/commands.h"
#include "capture/program/opened_cell.h"
#include "capture/reference_images.h"
#include "tools/program/progress.h"

namespace silhouette {
namespace {

constexpr char kProgram[] = "silhouette-capture reference";
// Mean noise, in grey levels, that no camera has by itself.
constexpr double kMostNoise = 8;

// More of the image than this, and the light or the exposure should be looked at.
constexpr double kMostSaturated = 0.005;
constexpr double kMostUnsteady = 0.01;

double Share(int pixels, const Reference& reference) {
  return static_cast<double>(pixels) / reference.size().area();
}

// What the person in front of the cell should know of a view; empty: nothing.
std::string RemarksOn(const Reference& reference) {
  const Reference::Figures figures = reference.Describe();
  std::string remarks;
  if (figures.mean_noise > kMostNoise) {
    absl::StrAppend(&remarks, "  - did something move? Then take them again");
  }
  if (Share(figures.saturated, reference) > kMostSaturated) {
    absl::StrAppend(&remarks,
                    absl::StrFormat("  - %.1f %% of the pixels are as bright as can be and "
                                    "show nothing that is brighter; shorten the exposure",
                                    100 * Share(figures.saturated, reference)));
  }
  if (Share(figures.unsteady, reference) > kMostUnsteady) {
    absl::StrAppend(&remarks, absl::StrFormat("  - %.1f %% of the pixels flicker and show little",
                                              100 * Share(figures.unsteady, reference)));
  }
  return remarks;
}

void PrintText(const CellArguments& arguments, const CellFile& file, uint64_t robot_images,
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

void PrintJson(const CellArguments& arguments, const CellFile& file,
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
                             {"saturated", Share(figures.saturated, references[v])},
                             {"unsteady", Share(figures.unsteady, references[v])}});
  }
  std::cout << json.dump(2) << std::endl;
}

absl::StatusOr<ExitCode> Run(const CellArguments& arguments) {
  absl::StatusOr<CellFile> file = OpenCellFile(arguments);
  if (!file.ok()) return file.status();
  auto rig = OpenCamerasOfEmptyCell(file->cell);
  if (!rig.ok()) return rig.status();
  auto database = OpenOrCreateDatabase(*file);
  if (!database.ok()) return database.status();
  auto cameras = CellCameras::Create((*database)->cell(), **rig);
  if (!cameras.ok()) return cameras.status();

  CatchStopSignals();
  std::optional<Progress> progress;
  progress.emplace("reference images", file->cell.capture.reference_images, "sets");
  CaptureObserver observer;
  observer.progress = [&](uint64_t done) { progress->Update(done); };
  observer.say = [&](const std::string& line) { progress->Say(line); };
  observer.stop_requested = StopRequested;
  const auto taken = TakeReferences(*cameras, file->cell.capture.reference_images, observer);
  progress.reset();
  if (absl::IsCancelled(taken.status())) {
    std::cerr << taken.status().message() << "; take them with: " << arguments.Command("reference")
              << std::endl;
    return kNo;
  }
  if (!taken.ok()) return taken.status();
  const auto snapshot = (*database)->Read();
  if (!snapshot.ok()) return snapshot.status();
  absl::Status status = (*database)->SetReferences(*taken, kProgram);
  if (!status.ok()) return status;
  const auto references = ReadReferences(**database);
  if (!references.ok()) return references.status();
  if (arguments.json()) {
    PrintJson(arguments, *file, *references);
  } else {
    PrintText(arguments, *file, snapshot->size(), *references);
  }
  return kDone;
}

}  // namespace

void AddReference(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "reference",
      "Takes the reference images: what the cameras see of the cell without the robot.\n"
      "Makes the database if it is not there. A simulated robot is taken out of the cell;\n"
      "take a real one out of all views yourself.");
  command->footer("Example:\n  silhouette-capture reference --cell cell.yaml --database cell.lmdb");
  const auto arguments = std::make_shared<CellArguments>();
  AddCellOptions(*command, *arguments);
  command->callback([arguments, &work] { work = [arguments] { return Run(*arguments); }; });
}

}  // namespace silhouette
