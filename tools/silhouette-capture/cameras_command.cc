// SPDX-License-Identifier: Apache-2.0
// silhouette-capture cameras: which cameras there are, and what those of a cell see.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/time.h"
#include "capture/devices/camera_set.h"
#include "capture/drivers/aravis/aravis_camera.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "capture/session/cell_cameras.h"
#include "common/picture/files.h"
#include "common/picture/picture.h"
#include "common/picture/sheet.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/skew_advice.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct CamerasOptions {
  std::string cell;
  std::string out;
  int sets = 3;
  std::string format = "text";

  bool json() const { return format == "json"; }
};

struct Found {
  std::vector<FoundCamera> genicam;
  std::vector<V4l2Device> v4l2;
};

// What came of asking a cell's cameras for sets of images.
struct CamerasTaken {
  std::vector<std::string> views;
  std::vector<CameraImage> images;  // of the last complete set
  std::vector<ViewCounts> counts;   // by view
  absl::Duration largest_skew;
  absl::Duration max_skew;  // the most that a scene of this cell may have
  int complete = 0;
  absl::Status error;  // of the last set that was not
};

absl::StatusOr<CamerasTaken> TakeSets(const CamerasOptions& options) {
  ASSIGN_OR_RETURN(auto cell, LoadCell(options.cell));
  ASSIGN_OR_RETURN(auto cameras, OpenCamerasOfCell(cell, /*all_boards=*/false));
  CamerasTaken taken{.views = cameras->views(),
                     .images = {},
                     .counts = {},
                     .largest_skew = absl::ZeroDuration(),
                     .max_skew = cell.server.scene.max_skew,
                     .complete = 0,
                     .error = absl::OkStatus()};
  Progress progress("images", static_cast<uint64_t>(options.sets), "sets");
  for (int set = 0; set < options.sets && !StopRequested(); ++set) {
    progress.Update(static_cast<uint64_t>(set));
    auto images = cameras->Grab();
    if (!images.ok()) {
      taken.error = images.status();
      continue;
    }
    taken.images = *std::move(images);
    taken.largest_skew = std::max(taken.largest_skew, SkewOf(taken.images));
    ++taken.complete;
  }
  progress.Update(static_cast<uint64_t>(options.sets));
  taken.counts = cameras->counts();
  return taken;
}

std::string TimeText(absl::Time time) {
  return absl::FormatTime("%H:%M:%E3S", time, absl::LocalTimeZone());
}

double MeanLevel(const CameraImage& image) {
  double sum = 0;
  for (const uint8_t level : image.pixels) sum += level;
  return sum / static_cast<double>(std::max<size_t>(image.pixels.size(), 1));
}

// A PNG per view and a sheet of all.
absl::Status WritePictures(const std::string& folder, const CamerasTaken& taken) {
  RETURN_IF_ERROR(MakeFolder(folder));
  std::vector<CaptionedPicture> pictures;
  for (size_t v = 0; v < taken.images.size(); ++v) {
    const CameraImage& image = taken.images[v];
    const Picture picture =
        PictureOfPixels(image.width, image.height, image.channels, image.pixels);
    RETURN_IF_ERROR(WritePng((fs::path(folder) / (taken.views[v] + ".png")).string(), picture));
    pictures.push_back({picture, absl::StrCat(taken.views[v], "  ", image.width, " x ",
                                              image.height, "  ", TimeText(image.captured))});
  }
  return WritePng((fs::path(folder) / "all.png").string(),
                  ContactSheet(pictures, {.title = "", .columns = 0, .legend = {}}));
}

void PrintFound(const Found& found) {
  if (found.genicam.empty()) std::cout << "no GigE Vision or USB3 Vision camera answers\n";
  for (const FoundCamera& camera : found.genicam) {
    std::cout << absl::StreamFormat("%-10s  serial %-16s  %s %s  %s\n", camera.protocol,
                                    camera.serial, camera.vendor, camera.model, camera.address);
  }
  if (found.v4l2.empty()) std::cout << "no camera has a Linux driver (/dev/video*)\n";
  for (const V4l2Device& device : found.v4l2) {
    std::cout << absl::StreamFormat("%-10s  %s\n", device.device, device.name);
  }
}

void PrintTaken(const CamerasOptions& options, const CamerasTaken& taken) {
  std::cout << absl::StreamFormat("\n%d of %d sets of images are complete\n", taken.complete,
                                  options.sets);
  Table table{{"view", "image", "mean level", "taken at", "images", "lost", "incomplete"}};
  for (size_t v = 0; v < taken.views.size(); ++v) {
    const ViewCounts& counts = taken.counts[v];
    std::string image = "none", level, time;
    if (!taken.images.empty()) {
      const CameraImage& last = taken.images[v];
      image = absl::StrCat(last.width, "x", last.height, last.channels == 3 ? " colour" : "");
      level = absl::StrFormat("%.1f", MeanLevel(last));
      time = TimeText(last.captured);
    }
    table.rows.push_back({taken.views[v], image, level, time, absl::StrCat(counts.taken),
                          absl::StrCat(counts.lost), absl::StrCat(counts.incomplete)});
  }
  std::cout << TextOf(table);
  if (taken.images.empty()) return;
  std::cout << absl::StreamFormat(
      "skew: %.1f ms at most (the time from the oldest to the newest image of a set)\n",
      absl::ToDoubleMilliseconds(taken.largest_skew));
  if (taken.largest_skew > taken.max_skew) {
    std::cout << "That is " << SkewAdvice(taken.max_skew) << ".\n";
  }
  if (!options.out.empty()) {
    std::cout << "wrote the images, and all on one sheet to " << options.out << "/all.png\n";
  }
}

nlohmann::ordered_json CamerasJsonOf(const CamerasOptions& options, const Found& found,
                                     const CamerasTaken* taken) {
  nlohmann::ordered_json json{{"found", nlohmann::ordered_json::array()}};
  for (const FoundCamera& camera : found.genicam) {
    json["found"].push_back({{"protocol", camera.protocol},
                             {"serial", camera.serial},
                             {"vendor", camera.vendor},
                             {"model", camera.model},
                             {"address", camera.address}});
  }
  for (const V4l2Device& device : found.v4l2) {
    json["found"].push_back(
        {{"protocol", "V4L2"}, {"device", device.device}, {"name", device.name}});
  }
  if (taken == nullptr) return json;
  json["sets"] = options.sets;
  json["complete"] = taken->complete;
  json["skew"] = absl::ToDoubleSeconds(taken->largest_skew);
  json["max_skew"] = absl::ToDoubleSeconds(taken->max_skew);
  for (size_t v = 0; v < taken->views.size(); ++v) {
    const ViewCounts& counts = taken->counts[v];
    nlohmann::ordered_json view{{"name", taken->views[v]},
                                {"taken", counts.taken},
                                {"lost", counts.lost},
                                {"incomplete", counts.incomplete}};
    if (!taken->images.empty()) {
      const CameraImage& image = taken->images[v];
      view["width"] = image.width;
      view["height"] = image.height;
      view["channels"] = image.channels;
      view["mean_level"] = MeanLevel(image);
      view["time"] = absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", image.captured, absl::UTCTimeZone());
      if (!options.out.empty()) view["picture"] = options.out + "/" + taken->views[v] + ".png";
    }
    json["views"].push_back(std::move(view));
  }
  return json;
}

absl::StatusOr<ExitCode> CamerasRun(const CamerasOptions& options) {
  CatchStopSignals();
  std::cerr << "looking for cameras on the network, USB and /dev/video*" << std::endl;
  const Found found{.genicam = FindGenicamCameras(), .v4l2 = FindV4l2Devices()};
  if (!options.json()) PrintFound(found);
  std::optional<CamerasTaken> taken;
  if (!options.cell.empty()) {
    std::cout << std::flush;
    ASSIGN_OR_RETURN(auto sets, TakeSets(options));
    taken = std::move(sets);
    if (!options.out.empty() && !taken->images.empty()) {
      RETURN_IF_ERROR(WritePictures(options.out, *taken));
    }
    if (!options.json()) PrintTaken(options, *taken);
  }
  if (options.json()) {
    std::cout << CamerasJsonOf(options, found, taken ? &*taken : nullptr).dump(2) << std::endl;
  }
  std::cout << std::flush;
  if (!taken || taken->error.ok()) return kDone;
  if (taken->complete == 0) return taken->error;
  Report("silhouette-capture", taken->error);
  return kNo;
}

}  // namespace

void AddCameras(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "cameras",
      "Lists the cameras that answer: GigE Vision, USB3 Vision, and those with a Linux driver.\n"
      "With a cell: takes sets of images with its cameras and reports the result.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture cameras\n"
      "  silhouette-capture cameras --cell cell.yaml --out pictures\n"
      "Exit codes: 0 done; 1 some sets of images were not complete; 2 wrong arguments or files;\n"
      "3 no set was complete.");
  const auto options = std::make_shared<CamerasOptions>();
  command->add_option("--cell", options->cell, "The cell's file, cell.yaml");
  command->add_option("--out", options->out,
                      "Folder for the images of the last set, and for all on one sheet, all.png");
  command->add_option("--sets", options->sets, "How many sets of images are taken")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  AddFormatOption(*command, options->format);
  command->callback([options, &work] { work = [options] { return CamerasRun(*options); }; });
}

}  // namespace silhouette
