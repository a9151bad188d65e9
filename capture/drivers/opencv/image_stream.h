// SPDX-License-Identifier: Apache-2.0
// Images one after the other: of a device that sends them all the time, or of a file.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"

namespace silhouette {

// For one thread at a time.
class ImageStream {
 public:
  virtual ~ImageStream() = default;

  // Begins, also again.
  virtual absl::Status Open() = 0;
  virtual void Close() = 0;

  // Waits for the next image. False: there are no more; Open() may help.
  virtual bool Grab() = 0;

  // Whether the grabbed image lost data on its way, or rests on one that did. Its pixels are wrong.
  virtual bool damaged() const { return false; }

  // When the grabbed image was sent, by the sender's clock of unknown zero. Nothing: not known.
  virtual std::optional<absl::Duration> sent() const = 0;

  // The grabbed image, in the size that it has: of 8 bits, grey or blue, green, red. Empty: it
  // cannot be read.
  virtual cv::Mat Retrieve() = 0;
};

// The camera of a view whose stream sends images all the time, as OpenV4l2Camera() says. `url`: of
// a stream from the network; empty: it is none. Errors are those of ImageStream::Open().
absl::StatusOr<std::unique_ptr<CameraSource>> OpenStreamCamera(const std::string& view,
                                                               std::unique_ptr<ImageStream> stream,
                                                               const std::string& url,
                                                               absl::Duration latency,
                                                               absl::Duration timeout);

// Videos, read by FFmpeg. (OpenCV's own reader keeps the size with which a video begins: it repeats
// the last image instead of larger ones, and mixes the rows of smaller ones. It does not report
// damage.)

// A stream at `url`. Open() and Grab() give up after `timeout`. Unavailable: there are no images.
std::unique_ptr<ImageStream> NetworkStream(const std::string& url, absl::Duration timeout);

// A video file, turned as it says that it is to be shown. Unavailable: it is not a video.
std::unique_ptr<ImageStream> FileStream(const std::string& file);

}  // namespace silhouette
