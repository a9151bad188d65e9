// What both ways of `detect` - from files and live - are given.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/detection/image_tags.h"
#include "tools/silhouette-calibrate/detect_session.h"

namespace silhouette {

struct DetectArguments {
  std::vector<std::string> images;  // VIEW=PATTERN
  std::string cell;
  int count = 0;        // sets of live images; 0: until Ctrl-C
  double interval = 1;  // seconds between them
  std::string save;     // folder for live images; empty: not kept
  std::vector<std::string> boards;
  std::string cameras;  // folder of .cameramodel files; empty: none
  std::string out;
  bool overwrite = false;
  std::string draw;  // folder; empty: no pictures
  std::string format = "text";
};

struct DetectSettings {
  std::vector<Board> boards;
  std::vector<std::string> families;
  std::map<std::string, Lens> lenses;                // by view; empty: none known
  std::map<std::string, cv::Size> lens_image_sizes;  // of the images that they are for
  std::string draw;
};

// InvalidArgument or NotFound, naming file and mend: a boards file, two boards that share a name or
// a tag, a camera file that is not there for one of `views`.
absl::StatusOr<DetectSettings> LoadDetectSettings(const DetectArguments& arguments,
                                                  const std::vector<std::string>& views);

// The tags in a view's image, and its picture if one is wanted. InvalidArgument: the image has not
// the size that the view's lens is for.
absl::StatusOr<ImageTags> Look(const DetectSettings& settings, TagDetector& detector,
                               const cv::Mat& image, const std::string& view,
                               const std::string& frame);

// The coverage pictures.
absl::Status DrawCoverage(const DetectSettings& settings, const DetectSession& session);

// Writes the sightings in one step: whoever reads the file sees the old or the new ones.
absl::Status WriteSightings(const DetectSession& session, const std::string& out);

// Grabs sets of images from the cell's cameras until there are enough or a stop was asked for.
absl::Status DetectLive(const DetectArguments& arguments, DetectSession& session);

}  // namespace silhouette
