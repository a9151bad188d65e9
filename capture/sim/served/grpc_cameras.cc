// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/served/network_cameras.h"

#include <google/protobuf/util/time_util.h>
#include <grpcpp/grpcpp.h>

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"
#include "silhouette/v1/camera_driver.grpc.pb.h"

namespace silhouette {
namespace {

class GrpcCamerasService : public v1::CameraDriverService::Service {
 public:
  explicit GrpcCamerasService(ServedViews& views) : views_(&views) {}

  grpc::Status GetCameras(grpc::ServerContext*, const v1::GetCamerasRequest*,
                          v1::GetCamerasResponse* response) override {
    for (const SimulatedView& view : views_->views()) {
      v1::DriverCamera* camera = response->add_cameras();
      camera->set_name(view.name);
      camera->set_width(view.image_width);
      camera->set_height(view.image_height);
      camera->set_description("simulated");
    }
    return grpc::Status::OK;
  }

  grpc::Status Grab(grpc::ServerContext*, const v1::GrabRequest* request,
                    v1::GrabResponse* response) override {
    std::vector<size_t> places;
    for (const std::string& name : request->cameras()) {
      size_t place = 0;
      while (place < views_->views().size() && views_->views()[place].name != name) ++place;
      if (place == views_->views().size()) {
        return {grpc::StatusCode::NOT_FOUND, absl::StrCat("there is no camera '", name, "'")};
      }
      places.push_back(place);
    }
    const std::vector<CameraImage> images = views_->TakeAll();
    for (const size_t place : places) {
      const CameraImage& image = images[place];
      v1::DriverImage* message = response->add_images();
      *message->mutable_capture_time() = google::protobuf::util::TimeUtil::NanosecondsToTimestamp(
          absl::ToUnixNanos(image.captured));
      v1::RawImage* raw = message->mutable_raw();
      raw->set_width(image.width);
      raw->set_height(image.height);
      raw->set_channels(image.channels);
      raw->set_pixels(image.pixels.data(), image.pixels.size());
    }
    return grpc::Status::OK;
  }

 private:
  ServedViews* const views_;
};

class ServedGrpcCameras : public GrpcCameras {
 public:
  explicit ServedGrpcCameras(ServedViews& views) : service_(views) {}

  ~ServedGrpcCameras() override {
    if (server_ != nullptr) server_->Shutdown(absl::ToChronoTime(absl::Now() + absl::Seconds(1)));
  }

  absl::Status Run(int port) {
    grpc::ServerBuilder builder;
    int bound = 0;
    builder.AddListeningPort(absl::StrCat("127.0.0.1:", port), grpc::InsecureServerCredentials(),
                             &bound);
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    builder.RegisterService(&service_);
    server_ = builder.BuildAndStart();
    if (server_ == nullptr || bound == 0) {
      return absl::FailedPreconditionError(
          absl::StrCat("127.0.0.1:", port, " cannot be listened at; is the port in use?"));
    }
    address_ = absl::StrCat("127.0.0.1:", bound);
    return absl::OkStatus();
  }

  const std::string& address() const override { return address_; }

 private:
  GrpcCamerasService service_;
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<GrpcCameras>> GrpcCameras::Start(ServedViews& views, int port) {
  auto cameras = std::make_unique<ServedGrpcCameras>(views);
  RETURN_IF_ERROR(cameras->Run(port));
  return cameras;
}

}  // namespace silhouette
