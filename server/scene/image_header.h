// The size of an encoded camera image, read without decoding it.
#pragma once

#include <optional>
#include <string_view>

namespace silhouette {

struct ImageSize {
  int width = 0;
  int height = 0;
};

// The size that a PNG or JPEG image says it has; nothing if the bytes are not one of these, or stop
// before its end. Half an image must not pass: decoders fill in what is missing, and what they fill
// in may look like the empty cell.
std::optional<ImageSize> SizeOfWholeImage(std::string_view bytes);

}  // namespace silhouette
