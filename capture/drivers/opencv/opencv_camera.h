// Cameras, streams and recordings that OpenCV reads.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "capture/devices/camera_settings.h"
#include "capture/devices/camera_source.h"

namespace silhouette {

// A V4L2 camera with images of width x height. NotFound: there is no such device; Unavailable: it
// cannot be opened. FailedPrecondition: it does not take the size, the exposure or the gain.
//
// A thread reads whatever comes, so that nothing old waits in a buffer. An image counts if it comes
// no sooner than `latency` after it was asked for; `captured` is `latency` before it came.
absl::StatusOr<std::unique_ptr<CameraSource>> OpenV4l2Camera(const std::string& view, int width,
                                                             int height, const V4l2Source& source);

// The same for a stream; Unavailable: nobody sends it. If it breaks off it is opened again.
absl::StatusOr<std::unique_ptr<CameraSource>> OpenRtspCamera(const std::string& view,
                                                             const RtspSource& source);

// Recordings: each image is given out once, with the time at which it was asked for. NotFound: no
// such file or folder; InvalidArgument: it holds no images.
absl::StatusOr<std::unique_ptr<CameraSource>> OpenVideo(const std::string& view,
                                                        const VideoSource& source);
absl::StatusOr<std::unique_ptr<CameraSource>> OpenFolder(const std::string& view,
                                                         const FolderSource& source);

}  // namespace silhouette
