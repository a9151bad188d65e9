// SPDX-License-Identifier: Apache-2.0
// Camera images as they come in files and messages: PNG or JPEG.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string_view>

namespace silhouette {

// The size that a PNG or JPEG image says it has, without decoding it; nothing if the bytes are not
// one of these, or stop before its end.
std::optional<cv::Size> SizeOfCameraImage(std::string_view bytes);

// Its pixels as ImageOfBytes() reads them: 8 bits, grey or blue, green, red. Nothing if they are
// not just those of an image of that size. Of 16 bits the upper 8 (CheckUsedBits).
std::optional<cv::Mat> DecodeCameraImage(std::string_view bytes);

}  // namespace silhouette
