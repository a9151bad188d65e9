// The images of a scene in files: what cameras wrote, or `silhouette-sim render`.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "silhouette/scene.h"

namespace silhouette {

struct ImageFile {
  std::string view;
  std::string path;
};

struct ImagesFolder {
  // When the images were taken; nothing if that is not recorded.
  std::optional<absl::Time> time;
  // Where the robot stood then.
  std::vector<client::JointPosition> joints;
  std::vector<ImageFile> images;
};

// Reads images.json in `folder`: {"time": RFC 3339 (optional), "joints": {name: radians or metres},
// "views": {name: file, relative to the folder}}. Errors name the file and the key.
absl::StatusOr<ImagesFolder> ReadImagesFolder(const std::string& folder);

}  // namespace silhouette
