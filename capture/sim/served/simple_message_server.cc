// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/served/simple_message_server.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/time/clock.h"
#include "db/status/status_macros.h"

namespace silhouette {

using simple_message::JointTrajPt;
using simple_message::JointTrajPtFull;
using simple_message::JointValues;
using simple_message::Message;
using simple_message::TriState;

namespace {

constexpr absl::Duration kSendTimeout = absl::Seconds(1);
// How far a trajectory may begin from where the robot is: radians, metres.
constexpr double kStartTolerance = 1e-4;

TriState StateOf(bool on) { return on ? TriState::kOn : TriState::kOff; }

}  // namespace

absl::StatusOr<std::unique_ptr<SimpleMessageServer>> SimpleMessageServer::Start(
    SimulatedController& controller, const SimpleMessageServerSettings& settings) {
  ASSIGN_OR_RETURN(auto motion, ListenTcp(settings.host, settings.motion_port));
  ASSIGN_OR_RETURN(auto state, ListenTcp(settings.host, settings.state_port));
  return std::unique_ptr<SimpleMessageServer>(
      new SimpleMessageServer(controller, settings, std::move(motion), std::move(state)));
}

SimpleMessageServer::SimpleMessageServer(SimulatedController& controller,
                                         SimpleMessageServerSettings settings,
                                         FileDescriptor motion, FileDescriptor state)
    : controller_(controller),
      settings_(std::move(settings)),
      motion_listener_(std::move(motion)),
      state_listener_(std::move(state)) {
  thread_ = std::thread([this] { Run(); });
}

SimpleMessageServer::~SimpleMessageServer() {
  ending_ = true;
  thread_.join();
}

void SimpleMessageServer::Accept(const FileDescriptor& listener,
                                 std::vector<Client>& clients) const {
  FileDescriptor socket(accept4(listener.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (!socket.valid()) return;
  clients.push_back({std::move(socket), simple_message::MessageReader(settings_.byte_order)});
}

void SimpleMessageServer::Run() {
  absl::Time next_state = absl::Now();
  while (!ending_) {
    std::vector<pollfd> places = {{motion_listener_.get(), POLLIN, 0},
                                  {state_listener_.get(), POLLIN, 0}};
    for (const Client& client : motion_clients_) places.push_back({client.socket.get(), POLLIN, 0});
    const absl::Duration left = std::max(next_state - absl::Now(), absl::ZeroDuration());
    poll(places.data(), places.size(),
         static_cast<int>(absl::ToInt64Milliseconds(absl::Ceil(left, absl::Milliseconds(1)))));
    Accept(motion_listener_, motion_clients_);
    Accept(state_listener_, state_clients_);
    std::erase_if(motion_clients_, [&](Client& client) { return !Serve(client); });
    if (absl::Now() < next_state) continue;
    next_state = absl::Now() + settings_.state_period;
    SendState();
  }
}

std::vector<uint8_t> SimpleMessageServer::StateBytes() const {
  const SimulatedController::State state = controller_.state();
  const simple_message::RobotStatus status{.drives_powered = StateOf(!state.e_stopped),
                                           .e_stopped = StateOf(state.e_stopped),
                                           .in_error = TriState::kOff,
                                           .in_motion = StateOf(state.moving),
                                           .mode = 2,
                                           .motion_possible = StateOf(!state.e_stopped)};
  std::vector<uint8_t> bytes = Encode(ToMessage(status), settings_.byte_order);
  const simple_message::JointValues positions = simple_message::ValuesOf(state.positions);
  const Message where = settings_.joint_feedback
                            ? ToMessage(simple_message::JointFeedback{
                                  .valid_fields = simple_message::JointFeedback::kPositionsValid,
                                  .positions = positions})
                            : ToMessage(simple_message::JointPosition{.positions = positions});
  const std::vector<uint8_t> more = Encode(where, settings_.byte_order);
  bytes.insert(bytes.end(), more.begin(), more.end());
  return bytes;
}

void SimpleMessageServer::SendState() {
  const ConnectionFault fault = fault_;
  if (fault == ConnectionFault::kClosed) {
    motion_clients_.clear();
    state_clients_.clear();
    fault_ = ConnectionFault::kNone;
    return;
  }
  if (fault == ConnectionFault::kDead) {
    for (std::vector<Client>* clients : {&motion_clients_, &state_clients_}) {
      for (Client& client : *clients) client.dead = true;
    }
    fault_ = ConnectionFault::kNone;
  }
  if (fault == ConnectionFault::kSilent || half_sent_) return;
  std::vector<uint8_t> bytes = StateBytes();
  if (fault == ConnectionFault::kHalf) {
    bytes.resize(bytes.size() / 2);
    half_sent_ = true;
  }
  if (fault == ConnectionFault::kGarbage) std::fill(bytes.begin(), bytes.end(), uint8_t{0xa5});
  std::erase_if(state_clients_, [&](const Client& client) {
    if (client.dead) return false;
    return !SendAll(client.socket, bytes, kSendTimeout).ok() || !ReceiveSome(client.socket).ok();
  });
}

bool SimpleMessageServer::Serve(Client& client) {
  const absl::StatusOr<std::vector<uint8_t>> bytes = ReceiveSome(client.socket);
  if (!bytes.ok()) return false;
  if (client.dead) return true;
  client.reader.Append(*bytes);
  while (true) {
    const absl::StatusOr<std::optional<Message>> message = client.reader.Next();
    if (!message.ok()) return false;
    if (!message->has_value()) return true;
    const Message& request = **message;
    if (request.comm != simple_message::kServiceRequest) continue;
    const Message reply = ReplyTo(request, Execute(request));
    if (!SendAll(client.socket, Encode(reply, settings_.byte_order), kSendTimeout).ok()) {
      return false;
    }
  }
}

std::vector<double> SimpleMessageServer::JointsIn(const JointValues& positions) const {
  return {positions.begin(),
          positions.begin() + static_cast<ptrdiff_t>(controller_.joints().size())};
}

bool SimpleMessageServer::Execute(const Message& request) {
  if (const std::optional<JointTrajPt> point = AsJointTrajPt(request)) return Execute(*point);
  const std::optional<JointTrajPtFull> full = AsJointTrajPtFull(request);
  return full && Execute(*full);
}

bool SimpleMessageServer::Execute(const JointTrajPt& point) {
  if (point.sequence == simple_message::kStopTrajectory) {
    controller_.Stop();
    return true;
  }
  if (point.sequence == simple_message::kStartDownload) return true;  // where it is
  if (point.sequence != 0 && point.sequence != simple_message::kEndDownload) return false;
  return controller_.Move(JointsIn(point.positions), absl::Seconds(point.duration)).ok();
}

// As controllers do that take such points: a trajectory begins at rest where the robot is.
bool SimpleMessageServer::Execute(const JointTrajPtFull& point) {
  if (point.sequence == simple_message::kStopTrajectory) {
    controller_.Stop();
    return true;
  }
  constexpr int32_t kNeeded = JointTrajPtFull::kTimeValid | JointTrajPtFull::kPositionsValid |
                              JointTrajPtFull::kVelocitiesValid;
  if (point.robot_id != 0 || (point.valid_fields & kNeeded) != kNeeded) return false;
  const std::vector<double> joints = JointsIn(point.positions);
  const bool begins = point.sequence == 0 || point.sequence == simple_message::kStartDownload;
  if (begins) {
    const std::vector<double> here = controller_.state().positions;
    const bool there = std::ranges::equal(
        joints, here, [](double a, double b) { return std::abs(a - b) <= kStartTolerance; });
    full_begun_ = there && point.time == 0 && point.velocities == JointValues{};
    return full_begun_;
  }
  if (!full_begun_ || point.time <= 0) return false;
  full_begun_ = false;
  return controller_.Move(joints, absl::Seconds(point.time)).ok();
}

}  // namespace silhouette
