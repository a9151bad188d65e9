// SPDX-License-Identifier: Apache-2.0
// Cameras, streams and recordings that OpenCV reads.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/camera_settings.h"
#include "capture/devices/devices.h"

namespace silhouette {

// A V4L2 camera with images of width x height. NotFound: there is no such device; Unavailable: it
// cannot be opened. FailedPrecondition: it does not take the size, the exposure or the gain, or
// does not switch its automatic exposure off.
//
// A thread reads whatever comes, so that nothing old waits in a buffer. An image counts if it comes
// no sooner than `latency` after it was asked for; `captured` is `latency` before it came.
absl::StatusOr<std::unique_ptr<CameraSource>> OpenV4l2Camera(const std::string& view, int width,
                                                             int height, const V4l2Source& source);

// The same for a stream; Unavailable: there is none at the URL. It is opened again if it ends.
// `captured` is earlier by the round trip to its host, too.
absl::StatusOr<std::unique_ptr<CameraSource>> OpenRtspCamera(const std::string& view,
                                                             const RtspSource& source);

// Recordings: each image is given out once, with the time at which it was asked for. NotFound: no
// such file or folder; InvalidArgument: it holds no images.
absl::StatusOr<std::unique_ptr<CameraSource>> OpenVideo(const std::string& view,
                                                        const VideoSource& source);
absl::StatusOr<std::unique_ptr<CameraSource>> OpenFolder(const std::string& view,
                                                         const FolderSource& source);

// OpenCV's images as those of cameras.

// `image` is of 8 bits, grey or blue, green, red.
inline CameraImage CameraImageOf(const cv::Mat& image, absl::Time captured) {
  CameraImage result{.width = image.cols,
                     .height = image.rows,
                     .channels = image.channels(),
                     .pixels = {},
                     .captured = captured};
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  result.pixels.assign(whole.datastart, whole.dataend);
  return result;
}

// The cameras that Linux has drivers for.

struct V4l2Device {
  std::string device;  // e.g. /dev/video0
  std::string name;    // as its driver calls it
};

// By their numbers. A camera may have several devices, of which not all give images.
std::vector<V4l2Device> FindV4l2Devices();

}  // namespace silhouette
