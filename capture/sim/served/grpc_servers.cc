// SPDX-License-Identifier: Apache-2.0
// The gRPC servers of the simulated cell: its cameras and its robot.
#include <google/protobuf/util/time_util.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "capture/sim/served/grpc_robot_server.h"
#include "capture/sim/served/network_cameras.h"
#include "silhouette/v1/camera_driver.grpc.pb.h"
#include "silhouette/v1/robot_driver.grpc.pb.h"

namespace silhouette {
namespace {

constexpr std::chrono::milliseconds kGrpcRobotServerTick{5};
// How long calls in flight may take when a server ends.
constexpr std::chrono::milliseconds kCameraGrace{1000};
constexpr std::chrono::milliseconds kRobotGrace{200};

// A service at an address, until it goes.
class Listening {
 public:
  // `address`: host:port, port 0 a free one.
  Listening(grpc::Service& service, const std::string& address, std::chrono::milliseconds grace)
      : grace_(grace) {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort(address, grpc::InsecureServerCredentials(), &port);
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    builder.RegisterService(&service);
    server_ = builder.BuildAndStart();
    if (port == 0) server_ = nullptr;
    address_ = absl::StrCat(address.substr(0, address.rfind(':')), ":", port);
  }
  ~Listening() {
    if (server_ != nullptr) server_->Shutdown(std::chrono::system_clock::now() + grace_);
  }
  Listening(const Listening&) = delete;
  Listening& operator=(const Listening&) = delete;

  // Whether the address can be listened on.
  bool works() const { return server_ != nullptr; }
  const std::string& address() const { return address_; }

 private:
  const std::chrono::milliseconds grace_;
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

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

class GrpcRobotService : public v1::RobotDriverService::Service {
 public:
  explicit GrpcRobotService(SimulatedController& controller) : controller_(controller) {}

  grpc::Status GetRobot(grpc::ServerContext*, const v1::GetRobotRequest*,
                        v1::GetRobotResponse* response) override {
    for (const std::string& joint : controller_.joints()) response->add_joints(joint);
    return grpc::Status::OK;
  }

  grpc::Status GetState(grpc::ServerContext*, const v1::GetStateRequest*,
                        v1::GetStateResponse* response) override {
    const SimulatedController::State state = controller_.state();
    response->mutable_positions()->Assign(state.positions.begin(), state.positions.end());
    response->set_moving(state.moving);
    if (state.e_stopped) response->set_fault("emergency stop");
    return grpc::Status::OK;
  }

  grpc::Status MoveTo(grpc::ServerContext* context, const v1::MoveToRequest* request,
                      v1::MoveToResponse*) override {
    const absl::Status status = controller_.Move(
        std::vector<double>(request->positions().begin(), request->positions().end()),
        absl::Seconds(request->duration().seconds()) +
            absl::Nanoseconds(request->duration().nanos()));
    if (!status.ok()) {
      return {static_cast<grpc::StatusCode>(status.code()), std::string(status.message())};
    }
    while (controller_.state().moving) {
      if (context->IsCancelled()) {
        controller_.Stop();
        return {grpc::StatusCode::CANCELLED, "the robot was stopped"};
      }
      std::this_thread::sleep_for(kGrpcRobotServerTick);
    }
    return grpc::Status::OK;
  }

  grpc::Status Stop(grpc::ServerContext*, const v1::StopRequest*, v1::StopResponse*) override {
    controller_.Stop();
    return grpc::Status::OK;
  }

 private:
  SimulatedController& controller_;
};

class GrpcCameraServer : public NetworkCameras {
 public:
  GrpcCameraServer(ServedViews& views, int port)
      : service_(views), listening_(service_, absl::StrCat("127.0.0.1:", port), kCameraGrace) {
    addresses_.assign(views.views().size(), listening_.address());
  }
  bool works() const { return listening_.works(); }

 private:
  GrpcCamerasService service_;
  Listening listening_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<NetworkCameras>> ServeGrpcCameras(ServedViews& views, int port) {
  auto cameras = std::make_unique<GrpcCameraServer>(views, port);
  if (cameras->works()) return cameras;
  return absl::FailedPreconditionError(
      absl::StrCat("cannot listen on 127.0.0.1:", port, "; is the port in use?"));
}

struct GrpcRobotServer::Impl {
  Impl(SimulatedController& controller, const std::string& address)
      : service(controller), listening(service, address, kRobotGrace) {}

  GrpcRobotService service;
  Listening listening;
};

GrpcRobotServer::GrpcRobotServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

GrpcRobotServer::~GrpcRobotServer() = default;

std::string GrpcRobotServer::address() const { return impl_->listening.address(); }

absl::StatusOr<std::unique_ptr<GrpcRobotServer>> GrpcRobotServer::Start(
    SimulatedController& controller, const std::string& address) {
  auto impl = std::make_unique<Impl>(controller, address);
  if (!impl->listening.works()) {
    return absl::UnavailableError(absl::StrCat("cannot listen on ", address));
  }
  return std::unique_ptr<GrpcRobotServer>(new GrpcRobotServer(std::move(impl)));
}

}  // namespace silhouette
