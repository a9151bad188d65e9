// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace silhouette {

struct FrameFile {
  std::string frame;
  std::string path;
};

// The files that match `pattern`, as "left/image_*.png", or all in the folder of that name. The
// frame is what the pattern's * matches (several: joined with _); in a folder, or without a *, the
// file's name without extension. In the order of paths.
std::vector<FrameFile> FilesOfFrames(const std::string& pattern);

}  // namespace silhouette
