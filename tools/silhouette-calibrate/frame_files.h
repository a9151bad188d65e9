// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
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

// The same by a file's path alone; the file need not exist. Nothing if neither the path nor its
// name matches the pattern or its last part, and the path is not in the folder.
std::optional<std::string> FrameByPath(const std::string& path, const std::string& pattern);

}  // namespace silhouette
