// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/cell_now.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/detection/image_tags.h"
#include "capture/session/cell_cameras.h"
#include "common/picture/image_file.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/store.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/detect.h"
#include "tools/silhouette-calibrate/files.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// Long ago if that cannot be found.
absl::Time TimeOf(const std::string& file) {
  std::error_code error;
  const fs::file_time_type written = fs::last_write_time(file, error);
  if (error) return absl::InfinitePast();
  return absl::FromChrono(std::chrono::file_clock::to_sys(written));
}

// Adds the tags that a set of images shows.
absl::Status AddTags(const DetectSettings& settings, BoardDetector& detector, const Cell& cell,
                     const ImageSet& set, const std::string& frame,
                     std::vector<TagSighting>& sightings) {
  for (size_t v = 0; v < cell.views.size(); ++v) {
    ASSIGN_OR_RETURN(const auto seen,
                     Look(settings, detector, set.images[v], cell.views[v].name, frame));
    const std::vector<TagSighting> tags = SightingsOf(seen);
    sightings.insert(sightings.end(), tags.begin(), tags.end());
  }
  return absl::OkStatus();
}

// `last`: the last set of images.
absl::StatusOr<std::vector<TagSighting>> LookForTags(const CheckRequest& request,
                                                     const DetectSettings& settings,
                                                     const Cell& cell, CellCameras& cameras,
                                                     ImageSet& last) {
  BoardDetector detector(settings.boards);
  std::vector<TagSighting> sightings;
  for (int i = 0; i < request.sets; ++i) {
    if (StopRequested()) return absl::CancelledError("stopped; nothing is known of the cameras");
    ASSIGN_OR_RETURN(last, GrabSet(cameras));
    RETURN_IF_ERROR(AddTags(settings, detector, cell, last, absl::StrCat(i), sightings));
  }
  if (sightings.empty()) {
    std::cerr << "silhouette-calibrate: no camera of the cell sees a tag of "
              << absl::StrJoin(request.boards, ", ")
              << "; are they the boards that stay in the cell, and is the light on?" << std::endl;
  }
  return sightings;
}

std::set<std::string> WithoutNoise(const Cell& cell) {
  std::set<std::string> views;
  for (const ViewSettings& view : cell.views) {
    if (!view.has_noise) views.insert(view.name);
  }
  return views;
}

// From files; an empty name skips its check.
absl::StatusOr<CellNow> ReadNow(const CheckRequest& request,
                                const storage::v1::CellDescription& cell) {
  CellNow now;
  if (!request.corners.empty()) {
    now.written = TimeOf(request.corners);
    ASSIGN_OR_RETURN(now.tags, ReadSightingsOf(cell, request.corners));
    if (!request.cell.empty()) {
      ASSIGN_OR_RETURN(const Cell file, CellFor(request, cell));
      now.without_noise = WithoutNoise(file);
    }
  }
  for (int i = 0; i < cell.views_size() && !request.images.empty(); ++i) {
    const std::string file = (fs::path(request.images) / (cell.views(i).name() + ".png")).string();
    now.written = std::min(now.written, TimeOf(file));
    now.images.push_back(ImageOfFile(file, cv::IMREAD_COLOR));
    if (now.images.back().empty()) return NotFound("'" + file + "' is no image, or is cut off");
  }
  return now;
}

// From the cell's cameras.
absl::StatusOr<CellNow> LookNow(const CheckRequest& request, const Cell& cell, bool& looked) {
  std::optional<Configuration> parked;
  if (request.number) {
    if (!cell.grid.Contains(*request.number)) {
      return NotFound("no configuration has the number ", *request.number,
                      "; 'silhouette-db show --at' reports the number nearest to joint values");
    }
    parked = cell.grid.At(*request.number);
  }
  std::optional<DetectSettings> tags;
  if (!request.boards.empty()) {
    ASSIGN_OR_RETURN(tags, LoadDetectSettings(request.boards));
  }
  looked = true;
  auto rig = OpenCamerasOfCell(cell, false, parked);
  if (!rig.ok()) {
    return absl::Status(rig.status().code(),
                        absl::StrCat(rig.status().message(),
                                     "; or take the images otherwise and give them (--images, or "
                                     "--corners of them)"));
  }
  CellNow now;
  now.without_noise = WithoutNoise(cell);
  ASSIGN_OR_RETURN(auto cameras, CamerasOfViews(cell, **rig));
  ImageSet set;
  if (now.without_noise.size() < cell.views.size()) {
    ASSIGN_OR_RETURN(set, GrabSet(cameras));  // which a frozen camera repeats
  }
  if (tags) {
    ASSIGN_OR_RETURN(now.tags, LookForTags(request, *tags, cell, cameras, set));
  } else {
    ASSIGN_OR_RETURN(set, GrabSet(cameras));
  }
  for (const cv::Mat& image : set.images) {
    if (!parked) break;
    cv::Mat colour = image;
    if (image.channels() == 1) cv::cvtColor(image, colour, cv::COLOR_GRAY2BGR);
    now.images.push_back(colour);
  }
  return now;
}

}  // namespace

absl::StatusOr<std::vector<TagSighting>> ReadSightingsOf(const storage::v1::CellDescription& cell,
                                                         const std::string& file) {
  ASSIGN_OR_RETURN(const std::vector<TagSighting> sightings, ReadSightings(file));
  for (const storage::v1::View& view : cell.views()) {
    RETURN_IF_ERROR(CheckImageSize(sightings, view.name(),
                                   {view.image_width(), view.image_height()},
                                   "its image size in the database"));
  }
  return sightings;
}

absl::StatusOr<Cell> CellFor(const CheckRequest& request,
                             const storage::v1::CellDescription& cell) {
  absl::StatusOr<Cell> file = LoadCell(request.cell, request.database);
  if (!file.ok()) return file;
  const std::vector<std::string> differences =
      Differences(DescriptionOf(*file), "the cell file", cell, "the database");
  if (differences.empty()) return file;
  return FailedPrecondition("the database '", request.database, "' does not fit the cell file '",
                            request.cell, "': ", absl::StrJoin(differences, "; "));
}

absl::StatusOr<CellNow> NowOf(const CheckRequest& request,
                              const storage::v1::CellDescription& description, bool& looked) {
  if (!request.live) return ReadNow(request, description);
  ASSIGN_OR_RETURN(const Cell cell, CellFor(request, description));
  return LookNow(request, cell, looked);
}

}  // namespace silhouette
