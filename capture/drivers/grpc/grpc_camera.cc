// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/grpc/grpc_camera.h"

#include <google/protobuf/util/time_util.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/grpc/driver_channel.h"
#include "capture/drivers/grpc/driver_status.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "common/picture/camera_image.h"
#include "common/picture/image_file.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "proto/tls/channel_credentials.h"
#include "silhouette/v1/camera_driver.grpc.pb.h"

namespace silhouette {
namespace {

// How far the clock of a driver's machine may be off.
constexpr absl::Duration kClockTolerance = absl::Milliseconds(20);
constexpr char kDriver[] = "camera driver";

// The deadline of a call that begins now, which gRPC takes by the wall clock and keeps by another.
std::chrono::system_clock::time_point Within(absl::Duration time) {
  return absl::ToChronoTime(absl::Now() + time);
}

// When an image of a call from `begin` to `end` was taken. DataLoss: before the call, so that the
// next image may be a new one. FailedPrecondition: after it, which no image is.
absl::StatusOr<absl::Time> CaptureTime(const v1::DriverImage& image, absl::Time begin,
                                       absl::Time end) {
  if (!image.has_capture_time()) return begin;
  const absl::Time said = absl::FromUnixNanos(
      google::protobuf::util::TimeUtil::TimestampToNanoseconds(image.capture_time()));
  if (said < begin - kClockTolerance || said > end + kClockTolerance) {
    const bool before = said < begin;
    const std::string told = absl::StrCat("an image says that it was taken ",
                                          SpokenTime(before ? begin - said : said - end));
    if (!before) {
      return absl::FailedPreconditionError(
          absl::StrCat(told, " after it came; the clocks of the two machines differ"));
    }
    return absl::DataLossError(
        absl::StrCat(told, " before it was asked for; it is an old one, or the clocks of the two ",
                     "machines differ"));
  }
  return std::clamp(said, begin, end);
}

class GrpcCameras : public CameraSource {
 public:
  GrpcCameras(std::string address, const std::shared_ptr<grpc::ChannelCredentials>& credentials,
              const std::vector<GrpcView>& views, absl::Duration timeout)
      : address_(std::move(address)), timeout_(timeout) {
    stub_ = v1::CameraDriverService::NewStub(DriverChannel(address_, credentials));
    for (const GrpcView& view : views) {
      views_.push_back(view.view);
      request_.add_cameras(view.camera);
    }
  }

  ~GrpcCameras() override {
    if (call_ != nullptr) {
      call_->context.TryCancel();
      Await(absl::InfiniteDuration());
    }
    queue_.Shutdown();
    void* tag = nullptr;
    bool ok = false;
    while (queue_.Next(&tag, &ok)) {
    }
  }

  // Whether the service has the cameras, with images of the views' size.
  absl::Status Check(const std::vector<GrpcView>& views) {
    grpc::ClientContext context;
    context.set_deadline(Within(timeout_));
    v1::GetCamerasResponse response;
    RETURN_IF_ERROR(DriverStatus(kDriver, address_,
                                 stub_->GetCameras(&context, v1::GetCamerasRequest(), &response)));
    for (const GrpcView& view : views) {
      const auto& cameras = response.cameras();
      const auto camera = std::find_if(cameras.begin(), cameras.end(), [&](const auto& candidate) {
        return candidate.name() == view.camera;
      });
      if (camera == cameras.end()) {
        return absl::NotFoundError(absl::StrCat(
            "the camera driver at ", address_, " has no camera '", view.camera, "'; it has ",
            cameras.empty() ? "none"
                            : absl::StrJoin(cameras, ", ", [](std::string* out, const auto& one) {
                                absl::StrAppend(out, one.name());
                              })));
      }
      if (camera->width() != view.width || camera->height() != view.height) {
        return absl::FailedPreconditionError(
            absl::StrCat("the camera '", view.camera, "' of the driver at ", address_,
                         " has images of ", camera->width(), " x ", camera->height(),
                         " pixels; the cell says ", view.width, " x ", view.height));
      }
    }
    return absl::OkStatus();
  }

  const std::vector<std::string>& views() const override { return views_; }
  absl::Duration timeout() const override { return timeout_; }

  absl::Status Trigger() override {
    call_ = std::make_unique<Grab>();
    call_->begin = absl::Now();
    call_->context.set_deadline(Within(timeout_));
    call_->reader = stub_->AsyncGrab(&call_->context, request_, &queue_);
    call_->reader->Finish(&call_->response, &call_->status, call_.get());
    return absl::OkStatus();
  }

  absl::StatusOr<EachImage> Wait(absl::Duration deadline) override {
    if (!Await(deadline)) {
      call_->context.TryCancel();
      Await(absl::InfiniteDuration());
    }
    const absl::Time end = absl::Now();
    const std::unique_ptr<Grab> call = std::move(call_);
    const absl::Status status = DriverStatus(kDriver, address_, call->status);
    if (absl::IsDeadlineExceeded(status) || absl::IsCancelled(status)) {
      return absl::DeadlineExceededError(absl::StrCat("no images from the camera driver at ",
                                                      address_, " within ", SpokenTime(timeout_)));
    }
    if (!status.ok()) return status;
    if (call->response.images_size() != static_cast<int>(views_.size())) {
      return Faulty(absl::DataLossError(absl::StrCat("it gave ", call->response.images_size(),
                                                     " images instead of ", views_.size())));
    }
    EachImage images;
    for (int i = 0; i < call->response.images_size(); ++i) {
      const v1::DriverImage& message = call->response.images(i);
      const auto captured = CaptureTime(message, call->begin, end);
      auto image = captured.ok() ? ImageOf(message, *captured) : captured.status();
      if (image.ok()) {
        images.push_back(std::move(image));
      } else {
        images.push_back(Faulty(absl::Status(
            image.status().code(),
            absl::StrCat("camera '", request_.cameras(i), "': ", image.status().message()))));
      }
    }
    return images;
  }

 private:
  struct Grab {
    grpc::ClientContext context;
    absl::Time begin;
    v1::GrabResponse response;
    grpc::Status status;
    std::unique_ptr<grpc::ClientAsyncResponseReader<v1::GrabResponse>> reader;
  };

  // Whether the call has ended by then.
  bool Await(absl::Duration deadline) {
    void* tag = nullptr;
    bool ok = false;
    if (deadline == absl::InfiniteDuration()) return queue_.Next(&tag, &ok);
    return queue_.AsyncNext(&tag, &ok, Within(deadline - RunningNow())) ==
           grpc::CompletionQueue::GOT_EVENT;
  }

  absl::Status Faulty(const absl::Status& status) const {
    return absl::Status(status.code(),
                        absl::StrCat("the camera driver at ", address_, ": ", status.message()));
  }

  const std::string address_;
  const absl::Duration timeout_;
  std::vector<std::string> views_;
  v1::GrabRequest request_;
  std::unique_ptr<v1::CameraDriverService::Stub> stub_;
  grpc::CompletionQueue queue_;
  std::unique_ptr<Grab> call_;  // under way; null: none
};

}  // namespace

absl::StatusOr<CameraImage> ImageOf(const v1::DriverImage& message, absl::Time captured) {
  if (message.has_raw()) {
    const v1::RawImage& raw = message.raw();
    const bool possible = raw.width() > 0 && raw.height() > 0 &&
                          (raw.channels() == 1 || raw.channels() == 3) &&
                          raw.pixels().size() == static_cast<size_t>(raw.width()) *
                                                     static_cast<size_t>(raw.height()) *
                                                     static_cast<size_t>(raw.channels());
    if (!possible) {
      return absl::DataLossError(absl::StrCat("an image of ", raw.width(), " x ", raw.height(),
                                              " pixels with ", raw.channels(), " channels has ",
                                              raw.pixels().size(), " bytes"));
    }
    return CameraImage{.width = raw.width(),
                       .height = raw.height(),
                       .channels = raw.channels(),
                       .pixels = {raw.pixels().begin(), raw.pixels().end()},
                       .captured = captured};
  }
  const std::optional<cv::Mat> image = DecodeCameraImage(message.encoded());
  if (!image) return absl::DataLossError("an image is not a whole PNG or JPEG");
  RETURN_IF_ERROR(CheckUsedBits("an image", message.encoded(), *image));
  return CameraImageOf(*image, captured);
}

absl::StatusOr<std::unique_ptr<CameraSource>> OpenGrpcCameras(const std::string& address,
                                                              const std::vector<GrpcView>& views,
                                                              absl::Duration timeout,
                                                              const ClientTlsFiles& tls) {
  ASSIGN_OR_RETURN(const auto credentials, ChannelCredentialsFor(address, tls));
  auto cameras = std::make_unique<GrpcCameras>(address, credentials, views, timeout);
  RETURN_IF_ERROR(cameras->Check(views));
  return cameras;
}

}  // namespace silhouette
