// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/grpc/grpc_robot_link.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/grpc/driver_channel.h"
#include "capture/drivers/grpc/driver_status.h"
#include "db/status/status_macros.h"
#include "proto/tls/channel_credentials.h"
#include "silhouette/v1/robot_driver.grpc.pb.h"

namespace silhouette {
namespace {

// From one question where the robot is to the next.
constexpr std::chrono::milliseconds kPeriod{15};

absl::Status GrpcRobotLinkStatusOf(const std::string& address, const grpc::Status& status) {
  // By the driver, which ends: calls that this client cancels are not reported.
  if (status.error_code() == grpc::StatusCode::CANCELLED) {
    return absl::UnavailableError(absl::StrCat("the driver at ", address, " ended a call"));
  }
  return DriverStatus("robot driver", address, status);
}

class GrpcRobotLink : public ControllerLink {
 public:
  GrpcRobotLink(const GrpcRobotSettings& settings, std::shared_ptr<grpc::Channel> channel,
                std::vector<std::string> joints)
      : settings_(settings),
        stub_(v1::RobotDriverService::NewStub(std::move(channel))),
        joints_(std::move(joints)) {}

  ~GrpcRobotLink() override {
    std::unique_lock lock(mutex_);
    ending_ = true;
    ForgetMove();
    changed_.notify_all();
    changed_.wait(lock, [&] { return calls_ == 0; });
    lock.unlock();
    if (thread_.joinable()) thread_.join();
  }

  const std::vector<std::string>& joints() const override { return joints_; }

  void Start(Observer observer) override {
    observer_ = std::move(observer);
    thread_ = std::thread([this] { AskForState(); });
  }

  absl::Status Move(std::span<const double> goal, absl::Duration duration) override {
    auto call = std::make_shared<MoveCall>();
    call->request.mutable_positions()->Assign(goal.begin(), goal.end());
    const absl::Duration seconds = absl::Trunc(duration, absl::Seconds(1));
    call->request.mutable_duration()->set_seconds(absl::ToInt64Seconds(seconds));
    call->request.mutable_duration()->set_nanos(
        static_cast<int32_t>(absl::ToInt64Nanoseconds(duration - seconds)));
    const std::lock_guard lock(mutex_);
    ForgetMove();
    move_ = call;
    ++calls_;
    stub_->async()->MoveTo(&call->context, &call->request, &call->response,
                           [this, call](const grpc::Status& status) { EndMove(call, status); });
    return absl::OkStatus();
  }

  absl::Status Stop() override {
    grpc::ClientContext context;
    context.set_deadline(Deadline());
    context.set_wait_for_ready(true);
    v1::StopResponse response;
    const grpc::Status status = stub_->Stop(&context, {}, &response);
    const std::lock_guard lock(mutex_);
    ForgetMove();
    return status.ok() ? absl::OkStatus() : GrpcRobotLinkStatusOf(settings_.address, status);
  }

 private:
  struct MoveCall {
    grpc::ClientContext context;
    v1::MoveToRequest request;
    v1::MoveToResponse response;
  };

  std::chrono::system_clock::time_point Deadline() const {
    return absl::ToChronoTime(absl::Now() + settings_.timeout);
  }

  // Ends the call under way, if there is one, and takes no notice of how; with mutex_ held.
  void ForgetMove() {
    if (move_) std::exchange(move_, nullptr)->context.TryCancel();
  }

  void EndMove(const std::shared_ptr<MoveCall>& call, const grpc::Status& status) {
    bool current = false;
    {
      const std::lock_guard lock(mutex_);
      current = move_ == call;
      if (current) move_.reset();
    }
    if (current && !status.ok()) {
      absl::Status failed = GrpcRobotLinkStatusOf(settings_.address, status);
      // The robot is not ready, which is no mistake of the program's user.
      if (absl::IsFailedPrecondition(failed)) failed = absl::AbortedError(failed.message());
      observer_.failed(failed);
    }
    const std::lock_guard lock(mutex_);
    --calls_;
    changed_.notify_all();
  }

  void AskForState() {
    std::unique_lock lock(mutex_);
    while (!ending_) {
      lock.unlock();
      AskOnce();
      lock.lock();
      changed_.wait_for(lock, kPeriod, [&] { return ending_; });
    }
  }

  // After a restart a driver may name its joints in another order.
  absl::Status CheckJoints() {
    grpc::ClientContext context;
    context.set_deadline(Deadline());
    v1::GetRobotResponse robot;
    const grpc::Status status = stub_->GetRobot(&context, {}, &robot);
    if (!status.ok()) return GrpcRobotLinkStatusOf(settings_.address, status);
    if (std::ranges::equal(robot.joints(), joints_)) return absl::OkStatus();
    return absl::UnavailableError(absl::StrCat("the driver at ", settings_.address,
                                               " now names the joints ",
                                               absl::StrJoin(robot.joints(), ", "), " and named ",
                                               absl::StrJoin(joints_, ", "), " before"));
  }

  void AskOnce() {
    if (!joints_known_) {
      const absl::Status same = CheckJoints();
      if (!same.ok()) return observer_.failed(same);
      joints_known_ = true;
    }
    const absl::Duration asked = RunningNow();
    grpc::ClientContext context;
    context.set_deadline(Deadline());
    v1::GetStateResponse response;
    const grpc::Status status = stub_->GetState(&context, {}, &response);
    joints_known_ = status.ok();
    if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) {
      return observer_.failed(absl::UnavailableError(
          absl::StrCat("the driver at ", settings_.address, " does not say where the robot is")));
    }
    if (!status.ok()) return observer_.failed(GrpcRobotLinkStatusOf(settings_.address, status));
    RobotFeedback feedback;
    feedback.positions.assign(response.positions().begin(), response.positions().end());
    if (response.has_moving()) feedback.moving = response.moving();
    feedback.fault = response.fault();
    feedback.not_before = asked;
    observer_.feedback(feedback);
  }

  const GrpcRobotSettings settings_;
  const std::unique_ptr<v1::RobotDriverService::Stub> stub_;
  const std::vector<std::string> joints_;
  Observer observer_;
  bool joints_known_ = true;  // of thread_ alone: no call has failed since they were asked for

  std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  bool ending_ = false;
  std::shared_ptr<MoveCall> move_;  // under way
  int calls_ = 0;                   // that have not ended yet

  std::thread thread_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ControllerLink>> ConnectGrpcRobot(
    const GrpcRobotSettings& settings) {
  ASSIGN_OR_RETURN(const auto credentials, ChannelCredentialsFor(settings.address, settings.tls));
  const std::shared_ptr<grpc::Channel> channel = DriverChannel(settings.address, credentials);
  const auto stub = v1::RobotDriverService::NewStub(channel);
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + settings.timeout));
  v1::GetRobotResponse robot;
  const grpc::Status status = stub->GetRobot(&context, {}, &robot);
  if (!status.ok()) return GrpcRobotLinkStatusOf(settings.address, status);
  if (robot.joints().empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("the driver at ", settings.address, " names no joints"));
  }
  return std::make_unique<GrpcRobotLink>(
      settings, channel, std::vector<std::string>(robot.joints().begin(), robot.joints().end()));
}

}  // namespace silhouette
