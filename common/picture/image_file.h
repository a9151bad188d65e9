// SPDX-License-Identifier: Apache-2.0
// Image files of users, read by OpenCV.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <string_view>

#include "absl/status/status.h"

namespace silhouette {

// No camera has more; a few bytes may say that they are as many.
inline constexpr double kMostImagePixels = 1e8;

// The image in the bytes of a file as the sensor saw it, whatever the file says of how the camera
// was held; `flags`: as of cv::imread. Empty: they are no image, or a PNG or JPEG file that is cut
// off or damaged. Decoders fill in pixels that are missing, and what they fill in may look like the
// empty cell. A JPEG file in which bits are flipped may pass: it has no checksum.
cv::Mat ImageOfBytes(std::string_view bytes, int flags);

// Whether `image`, which was read from `bytes` in 8 bits, shows what they do. InvalidArgument,
// which names the image as `name`: it has 16 bits of which it uses the lower 12 at most, as of
// cameras with 10 or 12, so that the upper 8 are nearly black. A dark image of all 16 bits may be
// taken for one.
absl::Status CheckUsedBits(const std::string& name, std::string_view bytes, const cv::Mat& image);

// The same as ImageOfBytes of a file; empty, too, if it cannot be read.
cv::Mat ImageOfFile(const std::string& path, int flags);

}  // namespace silhouette
