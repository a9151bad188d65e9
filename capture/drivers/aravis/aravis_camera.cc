// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/aravis/aravis_camera.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/devices/lateness.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/aravis/aravis_device.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr auto kAravisCameraGone = absl::StatusCode::kUnavailable;
// How long one look for an image takes at most.
constexpr absl::Duration kLook = absl::Milliseconds(100);

// The image in grey or blue, green, red. Internal: its pixels are of no format that was asked for.
absl::StatusOr<cv::Mat> Pixels(ArvBuffer* buffer) {
  const int width = arv_buffer_get_image_width(buffer);
  const int height = arv_buffer_get_image_height(buffer);
  const ArvPixelFormat format = arv_buffer_get_image_pixel_format(buffer);
  size_t size = 0;
  // OpenCV does not write to what it is only to read.
  auto* data = const_cast<void*>(arv_buffer_get_image_data(buffer, &size));
  const bool colour =
      format == ARV_PIXEL_FORMAT_RGB_8_PACKED || format == ARV_PIXEL_FORMAT_BGR_8_PACKED;
  if (size < static_cast<size_t>(width) * static_cast<size_t>(height) * (colour ? 3 : 1)) {
    return absl::DataLossError("an image is smaller than it says");
  }
  const cv::Mat image(height, width, colour ? CV_8UC3 : CV_8UC1, data);
  const auto to_bgr = [&](int code) {
    cv::Mat converted;
    cv::cvtColor(image, converted, code);
    return converted;
  };
  switch (format) {
    case ARV_PIXEL_FORMAT_MONO_8:
    case ARV_PIXEL_FORMAT_BGR_8_PACKED:
      return image;
    case ARV_PIXEL_FORMAT_RGB_8_PACKED:
      return to_bgr(cv::COLOR_RGB2BGR);
    case ARV_PIXEL_FORMAT_BAYER_RG_8:
      return to_bgr(cv::COLOR_BayerRGGB2BGR);
    case ARV_PIXEL_FORMAT_BAYER_GR_8:
      return to_bgr(cv::COLOR_BayerGRBG2BGR);
    case ARV_PIXEL_FORMAT_BAYER_GB_8:
      return to_bgr(cv::COLOR_BayerGBRG2BGR);
    case ARV_PIXEL_FORMAT_BAYER_BG_8:
      return to_bgr(cv::COLOR_BayerBGGR2BGR);
    default:
      return absl::InternalError(absl::StrCat("it sends pixels of the format ", absl::Hex(format),
                                              ", which it was not set to"));
  }
}

// What Aravis' devices share is not for several threads: held while a device is set up, restarted
// or triggered.
std::mutex& SharedParts() {
  static std::mutex mutex;
  return mutex;
}

class GenicamCamera : public CameraSource {
 public:
  GenicamCamera(const std::string& view, int width, int height, GenicamSource source)
      : views_{view}, width_(width), height_(height), source_(std::move(source)) {}

  ~GenicamCamera() override { Close(); }

  bool ready() const override { return camera_ != nullptr && !lost_; }

  absl::Status Open() override {
    Close();
    ASSIGN_OR_RETURN(auto camera, FindDevice(source_));
    const std::lock_guard lock(SharedParts());
    RETURN_IF_ERROR(SetUpDevice(camera.get(), width_, height_, source_));
    ASSIGN_OR_RETURN(auto stream, MakeStream(camera.get()));
    lost_ = false;
    g_signal_connect(arv_camera_get_device(camera.get()), "control-lost",
                     G_CALLBACK(&GenicamCamera::ControlLost), this);
    const absl::Status status = Call(kAravisCameraGone, arv_camera_start_acquisition, camera.get());
    camera_ = std::move(camera);
    stream_ = std::move(stream);
    if (!status.ok()) Close();
    return status;
  }

  const std::vector<std::string>& views() const override { return views_; }
  absl::Duration timeout() const override { return source_.timeout; }

  absl::Status Trigger() override {
    if (!ready()) return Lost();
    if (overdue_) {
      RETURN_IF_ERROR(Restart());
    }
    while (ArvBuffer* old = arv_stream_try_pop_buffer(stream_.get())) {
      arv_stream_push_buffer(stream_.get(), old);
    }
    asked_ = absl::Now();
    if (source_.trigger != CameraTrigger::kSoftware) return absl::OkStatus();
    const std::lock_guard lock(SharedParts());
    const absl::Status status = Call(kAravisCameraGone, arv_camera_software_trigger, camera_.get());
    if (status.ok()) return status;
    lost_ = true;
    return Lost();
  }

  absl::StatusOr<EachImage> Wait(absl::Duration deadline) override {
    for (;;) {
      const absl::Duration left = deadline - RunningNow();
      if (left <= absl::ZeroDuration()) break;
      if (lost_) return Lost();
      ArvBuffer* buffer = arv_stream_timeout_pop_buffer(
          stream_.get(), static_cast<guint64>(absl::ToInt64Microseconds(std::min(left, kLook))));
      if (buffer == nullptr) continue;
      auto image = Read(buffer);
      arv_stream_push_buffer(stream_.get(), buffer);
      if (!image.ok()) return image.status();
      if (*image == std::nullopt) continue;
      EachImage images;
      images.emplace_back(**std::move(image));
      return images;
    }
    overdue_ = true;  // what was asked for may still come
    return absl::DeadlineExceededError(
        absl::StrCat("no image within ", SpokenTime(source_.timeout),
                     source_.trigger == CameraTrigger::kHardware
                         ? absl::StrCat("; does the trigger's pulse reach its ", source_.line, "?")
                         : ""));
  }

 private:
  static void ControlLost(ArvDevice*, GenicamCamera* self) { self->lost_ = true; }

  static absl::Status Lost() {
    return absl::UnavailableError("the connection to it was lost; check its power and cable");
  }

  // Nothing: the image is older than the request.
  absl::StatusOr<std::optional<CameraImage>> Read(ArvBuffer* buffer) {
    const ArvBufferStatus status = arv_buffer_get_status(buffer);
    const absl::Time arrived =
        absl::FromUnixNanos(static_cast<int64_t>(arv_buffer_get_system_timestamp(buffer)));
    const bool software = source_.trigger == CameraTrigger::kSoftware;
    const absl::Time taken =
        software ? arrived : arrived - source_.latency - LateBy(buffer, arrived);
    if (taken < asked_) return std::nullopt;
    if (status == ARV_BUFFER_STATUS_SIZE_MISMATCH) {
      return absl::DataLossError("it sends larger images than it was set to");
    }
    if (status != ARV_BUFFER_STATUS_SUCCESS) {
      return absl::DataLossError(
          "an image came with parts missing; if that happens often, allow larger socket buffers "
          "(sysctl net.core.rmem_max) or state a smaller packet_size");
    }
    ASSIGN_OR_RETURN(const auto pixels, Pixels(buffer));
    return CameraImageOf(pixels, software ? asked_ : taken);
  }

  // How long the image was held up on its way; 0 if the camera has no clock.
  absl::Duration LateBy(ArvBuffer* buffer, absl::Time arrived) {
    const guint64 sent = arv_buffer_get_timestamp(buffer);
    if (sent == 0) return absl::ZeroDuration();
    // Nothing has piled up while acquisition starts.
    return lateness_.Of(absl::Nanoseconds(sent), RunningNow() - (absl::Now() - arrived));
  }

  // Throws away all that is under way.
  absl::Status Restart() {
    const std::lock_guard lock(SharedParts());
    absl::Status status = Call(kAravisCameraGone, arv_camera_stop_acquisition, camera_.get());
    status.Update(Call(kAravisCameraGone, arv_camera_start_acquisition, camera_.get()));
    overdue_ = false;
    lateness_ = {};
    if (status.ok()) return status;
    lost_ = true;
    return Lost();
  }

  // Takes seconds if the camera does not answer any more: so not before it is opened again.
  void Close() {
    if (camera_ == nullptr) return;
    if (!lost_) arv_camera_stop_acquisition(camera_.get(), nullptr);
    g_signal_handlers_disconnect_by_data(arv_camera_get_device(camera_.get()), this);
    stream_.reset();
    camera_.reset();
    overdue_ = false;
    lateness_ = {};
  }

  const std::vector<std::string> views_;
  const int width_;
  const int height_;
  const GenicamSource source_;
  CameraHandle camera_;  // null: the connection was lost
  StreamHandle stream_;
  std::atomic<bool> lost_ = false;  // set by Aravis' thread
  Lateness lateness_;
  bool overdue_ = false;  // an image that was asked for may come late
  absl::Time asked_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CameraSource>> OpenGenicamCamera(const std::string& view, int width,
                                                                int height,
                                                                const GenicamSource& source) {
  auto camera = std::make_unique<GenicamCamera>(view, width, height, source);
  RETURN_IF_ERROR(camera->Open());
  return camera;
}

}  // namespace silhouette
