// SPDX-License-Identifier: Apache-2.0
// Tags in images: what both ways of `detect`, from files and live, share.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/board.h"
#include "calib/detection/detect_session.h"
#include "calib/detection/image_tags.h"
#include "capture/session/cell_cameras.h"
#include "tools/cell/cell.h"

namespace silhouette {

struct ViewPattern {
  std::string view;
  std::string pattern;
};

// "view=pattern", e.g. "left=images/left/*.png". InvalidArgument, saying the mend: not so, a view
// twice.
absl::StatusOr<std::vector<ViewPattern>> ViewPatterns(const std::vector<std::string>& arguments);

struct ListedImage {
  std::string view;
  std::string frame;
  std::string path;
};

// `arguments`: as of ViewPatterns; a folder stands for all images in it.
// The frame is what the pattern's * matches (several: joined with _), without one the file's name
// without extension. In the order of views as given, then of paths. InvalidArgument, saying the
// mend: no such pattern, a view twice, a ROS bag, no image, a file or a frame of a view twice.
absl::StatusOr<std::vector<ListedImage>> ListImages(const std::vector<std::string>& arguments);

struct DetectSettings {
  std::vector<Board> boards;
  std::map<std::string, CameraModel> lenses = {};  // by view; empty: none known
  std::string draw = {};                           // folder; empty: no pictures
};

// `boards`: files. `cameras`: folder of .cameramodel files; empty: none. `draw` is as
// DetectSettings::draw. InvalidArgument or NotFound, naming file and mend: a boards file, two
// boards that share a name or a tag, a camera file that is not there for one of `views`.
absl::StatusOr<DetectSettings> LoadDetectSettings(const std::vector<std::string>& boards,
                                                  const std::string& cameras = "",
                                                  const std::vector<std::string>& views = {},
                                                  const std::string& draw = "");

// Finds the boards' marks in a view's image (8 bits, grey or blue, green, red), and draws its
// picture if `settings.draw` asks for it. InvalidArgument: the view's lens is for another image
// size.
absl::StatusOr<ImageTags> Look(const DetectSettings& settings, BoardDetector& detector,
                               const cv::Mat& image, const std::string& view,
                               const std::string& frame);

// Grey, in the camera's own orientation whatever the file says of how to hold it; 8 bits.
// InvalidArgument: the file is cut off, or no image. Otherwise the errors of ReadWholeFile.
absl::StatusOr<cv::Mat> ReadImage(const std::string& path);

// Takes what one image shows, by the image's place among all.
using TakeTags = std::function<absl::Status(size_t image, ImageTags tags)>;

// Looks at all images with all processors, and calls `take` for one at a time, in any order. The
// first error, also one of `take`, or a stop signal ends it. Returns how many images were taken.
absl::StatusOr<size_t> DetectAll(const std::vector<ListedImage>& images,
                                 const DetectSettings& settings, const TakeTags& take);

// The coverage pictures.
absl::Status DrawCoverage(const DetectSettings& settings, const DetectSession& session);

// As WriteWholeFile.
absl::Status WriteSightings(const DetectSession& session, const std::string& out);

// 8 bits of grey.
cv::Mat GreyOf(const cv::Mat& image);

// The cameras of the cell's views; those whose images have noise must not repeat one.
absl::StatusOr<CellCameras> CamerasOfViews(const Cell& cell, CameraRig& rig);

// A set of images; CellCameras::Grab, with its messages on stderr.
absl::StatusOr<ImageSet> GrabSet(CellCameras& cameras);

// A table of the images, the warnings and the views' coverage. `out`: the file that was written.
std::string DetectionText(const DetectSession& session, const std::string& out);
nlohmann::ordered_json DetectionJson(const DetectSession& session, const std::string& out);

// "coverage left 31 %, right 22 %"
std::string CoverageLine(const DetectSession& session);

}  // namespace silhouette
