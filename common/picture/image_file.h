// SPDX-License-Identifier: Apache-2.0
// Image files of users, read by OpenCV.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <string_view>

namespace silhouette {

// The image in the bytes of a file; `flags`: as of cv::imread. Empty: they are no image, or a PNG
// file that is cut off or damaged, of which the decoder would write to stderr.
cv::Mat ImageOfBytes(std::string_view bytes, int flags);

// The same of a file; empty, too, if it cannot be read.
cv::Mat ImageOfFile(const std::string& path, int flags);

}  // namespace silhouette
