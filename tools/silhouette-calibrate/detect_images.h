// The images of a session in files: a pattern per view.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace silhouette {

struct ListedImage {
  std::string view;
  std::string frame;
  std::string path;
};

// `patterns`: "view=pattern", e.g. "left=images/left/*.png"; a folder stands for all images in it.
// The frame is what the pattern's * matches (several: joined with _), without one the file's name
// without extension. In the order of views as given, then of paths. InvalidArgument, saying the
// mend: no such pattern, a view twice, no image, a file or a frame of a view twice.
absl::StatusOr<std::vector<ListedImage>> ListImages(const std::vector<std::string>& patterns);

}  // namespace silhouette
