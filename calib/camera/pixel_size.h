// SPDX-License-Identifier: Apache-2.0
// The size of an image in pixels.
#pragma once

#include <string>

namespace silhouette {

struct PixelSize {
  int width = 0;
  int height = 0;

  bool operator==(const PixelSize&) const = default;
};

// "640x480"
inline std::string SizeText(PixelSize size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

}  // namespace silhouette
