#include "tools/silhouette-calibrate/check_now.h"

#include <filesystem>
#include <iostream>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/boards/sighting_file.h"
#include "calib/detection/image_tags.h"
#include "capture/session/cell_cameras.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/detect_settings.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// Adds the tags that a set of images shows.
absl::Status AddTags(const DetectSettings& settings, TagDetector& detector, const Cell& cell,
                     const ImageSet& set, const std::string& frame,
                     std::vector<TagSighting>& sightings) {
  for (size_t v = 0; v < cell.views.size(); ++v) {
    cv::Mat grey = set.images[v];
    if (grey.channels() == 3) cv::cvtColor(set.images[v], grey, cv::COLOR_BGR2GRAY);
    ASSIGN_OR_RETURN(const auto seen, Look(settings, detector, grey, cell.views[v].name, frame));
    const std::vector<TagSighting> tags = SightingsOf(seen);
    sightings.insert(sightings.end(), tags.begin(), tags.end());
  }
  return absl::OkStatus();
}

absl::StatusOr<std::map<SeenTag, TagSighting>> LookForTags(const LiveLook& look, const Cell& cell,
                                                           CellCameras& cameras, ImageSet& last) {
  DetectArguments arguments;
  arguments.boards = look.boards;
  ASSIGN_OR_RETURN(const auto settings, LoadDetectSettings(arguments, {}));
  TagDetector detector(settings.families);
  std::vector<TagSighting> sightings;
  for (int i = 0; i < look.sets; ++i) {
    if (StopRequested()) return absl::AbortedError("stopped; nothing is known of the cameras");
    auto set = cameras.Grab([](const std::string& line) { std::cerr << line << std::endl; });
    if (!set.ok()) return set.status();
    RETURN_IF_ERROR(AddTags(settings, detector, cell, *set, absl::StrCat(i), sightings));
    last = *std::move(set);
  }
  if (sightings.empty()) {
    return absl::NotFoundError(
        absl::StrCat("no camera of the cell sees a tag of ", absl::StrJoin(look.boards, ", "),
                     "; are they the boards that stay in the cell, and is the light on?"));
  }
  return MeanSightings(sightings);
}

}  // namespace

absl::StatusOr<std::map<SeenTag, TagSighting>> ReadMeanSightings(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  ASSIGN_OR_RETURN(const std::vector<TagSighting> sightings, SightingsFromText(text, file));
  auto means = MeanSightings(sightings);
  if (means.ok()) return means;
  return absl::Status(means.status().code(), absl::StrCat(file, ": ", means.status().message()));
}

absl::StatusOr<CellNow> ReadNow(const std::string& corners, const std::string& images,
                                const storage::v1::CellDescription& cell) {
  CellNow now;
  if (!corners.empty()) {
    ASSIGN_OR_RETURN(auto tags, ReadMeanSightings(corners));
    now.tags = std::move(tags);
  }
  for (int i = 0; i < cell.views_size() && !images.empty(); ++i) {
    const std::string file = (fs::path(images) / (cell.views(i).name() + ".png")).string();
    now.images.push_back(cv::imread(file, cv::IMREAD_COLOR));
    if (now.images.back().empty()) return absl::NotFoundError("'" + file + "' is no image");
  }
  return now;
}

absl::StatusOr<CellNow> LookNow(const LiveLook& look, const Cell& cell) {
  auto rig = OpenCamerasOfCell(cell, false, look.parked);
  if (!rig.ok()) {
    return absl::Status(rig.status().code(),
                        absl::StrCat(rig.status().message(),
                                     "; or take the images otherwise and give them (--images, or "
                                     "--corners of them)"));
  }
  ASSIGN_OR_RETURN(auto cameras, CellCameras::Create(DescriptionOf(cell), **rig));
  CellNow now;
  ImageSet set;
  if (!look.boards.empty()) {
    ASSIGN_OR_RETURN(auto tags, LookForTags(look, cell, cameras, set));
    now.tags = std::move(tags);
  } else {
    auto grabbed = cameras.Grab([](const std::string& line) { std::cerr << line << std::endl; });
    if (!grabbed.ok()) return grabbed.status();
    set = *std::move(grabbed);
  }
  for (const cv::Mat& image : set.images) {
    if (!look.parked) break;
    cv::Mat colour = image;
    if (image.channels() == 1) cv::cvtColor(image, colour, cv::COLOR_GRAY2BGR);
    now.images.push_back(colour);
  }
  return now;
}

}  // namespace silhouette
