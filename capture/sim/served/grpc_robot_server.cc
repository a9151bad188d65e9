// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/served/grpc_robot_server.h"

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "silhouette/v1/robot_driver.grpc.pb.h"

namespace silhouette {
namespace {

constexpr std::chrono::milliseconds kGrpcRobotServerTick{5};
// How long calls in flight may take when the server ends.
constexpr std::chrono::milliseconds kGrace{200};

class GrpcRobotServerService : public v1::RobotDriverService::Service {
 public:
  explicit GrpcRobotServerService(SimulatedController& controller) : controller_(controller) {}

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

}  // namespace

class GrpcRobotServer::Impl {
 public:
  Impl(SimulatedController& controller, const std::string& address) : service_(controller) {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort(address, grpc::InsecureServerCredentials(), &port);
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    builder.RegisterService(&service_);
    server_ = builder.BuildAndStart();
    if (port == 0) server_ = nullptr;
    address_ = absl::StrCat(address.substr(0, address.rfind(':')), ":", port);
  }
  ~Impl() {
    if (server_) server_->Shutdown(std::chrono::system_clock::now() + kGrace);
  }

  bool works() const { return server_ != nullptr; }
  const std::string& address() const { return address_; }

 private:
  GrpcRobotServerService service_;
  std::string address_;
  std::unique_ptr<grpc::Server> server_;
};

GrpcRobotServer::GrpcRobotServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

GrpcRobotServer::~GrpcRobotServer() = default;

std::string GrpcRobotServer::address() const { return impl_->address(); }

absl::StatusOr<std::unique_ptr<GrpcRobotServer>> GrpcRobotServer::Start(
    SimulatedController& controller, const std::string& address) {
  auto impl = std::make_unique<Impl>(controller, address);
  if (!impl->works()) return absl::UnavailableError(absl::StrCat("cannot listen on ", address));
  return std::unique_ptr<GrpcRobotServer>(new GrpcRobotServer(std::move(impl)));
}

}  // namespace silhouette
