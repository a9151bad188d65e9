#include "tools/silhouette-calibrate/detect_settings.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "calib/boards/board_file.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/calibration_camera_file.h"
#include "calib/files/calibration_message.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-calibrate/detect_pictures.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

std::string FileName(const std::string& name) { return absl::StrReplaceAll(name, {{"/", "_"}}); }

absl::Status LoadBoards(const std::vector<std::string>& files, DetectSettings& settings) {
  for (const std::string& file : files) {
    ASSIGN_OR_RETURN(const auto text, ReadWholeFile(file));
    ASSIGN_OR_RETURN(const auto boards, BoardsFromText(text, file));
    settings.boards.insert(settings.boards.end(), boards.begin(), boards.end());
  }
  for (const Board& board : settings.boards) {
    const std::string& family = board.description().family;
    if (std::find(settings.families.begin(), settings.families.end(), family) ==
        settings.families.end()) {
      settings.families.push_back(family);
    }
  }
  return CheckBoards(settings.boards);
}

absl::Status LoadLens(const std::string& folder, const std::string& view,
                      DetectSettings& settings) {
  const std::string file = (fs::path(folder) / CameraFileName(view)).string();
  ASSIGN_OR_RETURN(const auto text, ReadWholeFile(file));
  ASSIGN_OR_RETURN(const auto message, CameraFromText(text, file));
  const auto camera = CameraFrom(message);
  if (!camera.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": ", camera.status().message()));
  }
  const CameraIntrinsics& k = camera->intrinsics();
  settings.lenses.emplace(view, Lens(k));
  settings.lens_image_sizes.emplace(view, cv::Size(k.width, k.height));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<DetectSettings> LoadDetectSettings(const DetectArguments& arguments,
                                                  const std::vector<std::string>& views) {
  DetectSettings settings;
  settings.draw = arguments.draw;
  absl::Status status = LoadBoards(arguments.boards, settings);
  for (const std::string& view : views) {
    if (status.ok() && !arguments.cameras.empty()) {
      status = LoadLens(arguments.cameras, view, settings);
    }
    if (status.ok() && !settings.draw.empty()) {
      status = MakeFolder((fs::path(settings.draw) / FileName(view)).string());
    }
  }
  if (!status.ok()) return status;
  return settings;
}

absl::StatusOr<ImageTags> Look(const DetectSettings& settings, TagDetector& detector,
                               const cv::Mat& image, const std::string& view,
                               const std::string& frame) {
  const auto lens = settings.lenses.find(view);
  if (lens != settings.lenses.end() && settings.lens_image_sizes.at(view) != image.size()) {
    const cv::Size size = settings.lens_image_sizes.at(view);
    return absl::InvalidArgumentError(
        absl::StrCat("frame '", frame, "' of view '", view, "' has ", image.cols, "x", image.rows,
                     " pixels, but its camera model is for ", size.width, "x", size.height,
                     "; give images of that size, or leave --cameras out"));
  }
  ImageTags tags = FindTags(detector, image, lens != settings.lenses.end() ? lens->second : Lens(),
                            settings.boards);
  tags.view = view;
  tags.frame = frame;
  if (!settings.draw.empty()) {
    const fs::path file = fs::path(settings.draw) / FileName(view) / (FileName(frame) + ".png");
    RETURN_IF_ERROR(WritePng(file.string(), PictureOfTags(image, tags)));
  }
  return tags;
}

absl::Status DrawCoverage(const DetectSettings& settings, const DetectSession& session) {
  if (settings.draw.empty()) return absl::OkStatus();
  for (const auto& [view, coverage] : session.coverage()) {
    const fs::path file = fs::path(settings.draw) / ("coverage-" + FileName(view) + ".png");
    RETURN_IF_ERROR(WritePng(file.string(), PictureOfCoverage(view, coverage)));
  }
  return absl::OkStatus();
}

absl::Status WriteSightings(const DetectSession& session, const std::string& out) {
  const std::string unfinished = out + ".unfinished";
  RETURN_IF_ERROR(WriteWholeFile(unfinished, SightingFileText(session.Sightings())));
  std::error_code error;
  fs::rename(unfinished, out, error);
  if (error) {
    return absl::InternalError(absl::StrCat("cannot write '", out, "': ", error.message()));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
