// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/robots/simple_message_link.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/devices/running_clock.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"

namespace silhouette {

using simple_message::JointTrajPt;
using simple_message::JointTrajPtFull;
using simple_message::JointValues;
using simple_message::Message;
using simple_message::MessageReader;
using simple_message::TriState;

namespace {

constexpr absl::Duration kTryAgain = absl::Seconds(1);
// How much longer a way takes that begins and ends at rest, with the same greatest speed, than one
// of that speed all along: its course in time is a cubic.
constexpr double kFromRestToRest = 1.5;

absl::Status In(const std::string& address, const absl::Status& status) {
  return absl::Status(status.code(),
                      absl::StrCat("the robot at ", address, ": ", status.message()));
}

// What keeps a robot from moving, as its controller says.
void TellHindrances(const simple_message::RobotStatus& status, RobotFeedback& feedback) {
  if (status.e_stopped == TriState::kOn) {
    feedback.fault = "emergency stop";
  } else if (status.in_error == TriState::kOn) {
    feedback.fault = absl::StrCat("error ", status.error_code);
  } else if (status.drives_powered == TriState::kOff && status.motion_possible != TriState::kOn) {
    feedback.fault = "the drives are off";
  } else if (status.motion_possible == TriState::kOff) {
    feedback.not_ready = "no motion is possible; is it in automatic mode, and its program running?";
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<SimpleMessageLink>> SimpleMessageLink::Connect(
    const SimpleMessageSettings& settings) {
  if (settings.joints.empty() || settings.joints.size() > simple_message::kMostJoints) {
    throw std::invalid_argument(absl::StrCat("1 to ", simple_message::kMostJoints,
                                             " joints are expected, not ", settings.joints.size()));
  }
  ASSIGN_OR_RETURN(auto state, ConnectTcp(settings.host, settings.state_port, settings.timeout));
  FileDescriptor wake(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  if (!wake.valid()) return absl::ResourceExhaustedError("there are no more file descriptors");
  return std::unique_ptr<SimpleMessageLink>(
      new SimpleMessageLink(settings, std::move(state), std::move(wake)));
}

SimpleMessageLink::SimpleMessageLink(SimpleMessageSettings settings, FileDescriptor state,
                                     FileDescriptor wake)
    : settings_(std::move(settings)),
      wake_(std::move(wake)),
      state_(std::move(state)),
      state_reader_(settings_.byte_order),
      motion_reader_(settings_.byte_order) {}

SimpleMessageLink::~SimpleMessageLink() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  Wake();
  if (thread_.joinable()) thread_.join();
}

void SimpleMessageLink::Start(Observer observer) {
  observer_ = std::move(observer);
  heard_ = RunningNow();
  thread_ = std::thread([this] { Read(); });
}

void SimpleMessageLink::Wake() {
  const uint64_t one = 1;
  // It is only full if it wakes anyway.
  [[maybe_unused]] const ssize_t written = write(wake_.get(), &one, sizeof(one));
}

Message SimpleMessageLink::PointOf(int32_t sequence, const JointValues& positions,
                                   absl::Duration time) const {
  if (!full()) {
    return ToMessage(JointTrajPt{.sequence = sequence,
                                 .positions = positions,
                                 .velocity = static_cast<float>(settings_.velocity),
                                 .duration = static_cast<float>(absl::ToDoubleSeconds(time))});
  }
  // At rest: the velocities are 0.
  return ToMessage(JointTrajPtFull{
      .sequence = sequence,
      .valid_fields = JointTrajPtFull::kTimeValid | JointTrajPtFull::kPositionsValid |
                      JointTrajPtFull::kVelocitiesValid,
      .time = static_cast<float>(absl::ToDoubleSeconds(kFromRestToRest * time)),
      .positions = positions});
}

absl::Status SimpleMessageLink::Move(std::span<const double> goal, absl::Duration duration) {
  const bool download = settings_.trajectory == SimpleMessageSettings::Trajectory::kDownload;
  int32_t sequence = 0;
  if (download || full()) {
    JointValues here;
    {
      const std::lock_guard lock(mutex_);
      here = simple_message::ValuesOf(positions_);
    }
    const int32_t first = download ? simple_message::kStartDownload : sequence++;
    RETURN_IF_ERROR(Request(PointOf(first, here, absl::ZeroDuration()), "move"));
  }
  if (download) sequence = simple_message::kEndDownload;
  return Request(PointOf(sequence, simple_message::ValuesOf(goal), duration), "move");
}

absl::Status SimpleMessageLink::Stop() {
  const Message stop = PointOf(simple_message::kStopTrajectory, {}, absl::ZeroDuration());
  absl::Status status = Request(stop, "stop");
  // Over a new connection: the old one may be dead.
  if (absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status)) {
    status = Request(stop, "stop");
  }
  return status;
}

absl::Status SimpleMessageLink::Request(const Message& request, const std::string& what) {
  const std::string address = AddressOf(settings_.host, settings_.motion_port);
  std::unique_lock lock(mutex_);
  if (!motion_.valid()) {
    ASSIGN_OR_RETURN(FileDescriptor socket,
                     ConnectTcp(settings_.host, settings_.motion_port, settings_.timeout));
    motion_ = std::move(socket);
    motion_reader_ = MessageReader(settings_.byte_order);
    ++connection_;
    sent_ = answers_ = 0;
    results_.clear();
    Wake();
  }
  const std::vector<uint8_t> bytes = Encode(request, settings_.byte_order);
  if (absl::Status status = SendAll(motion_, bytes, settings_.timeout); !status.ok()) {
    motion_ = FileDescriptor();
    return In(address, status);
  }
  const uint64_t number = ++sent_;
  const uint64_t connection = connection_;
  answered_.wait_for(lock, absl::ToChronoMilliseconds(settings_.timeout), [&] {
    return connection_ != connection || !motion_.valid() || answers_ >= number;
  });
  if (connection_ != connection || !motion_.valid()) {
    return In(address, absl::UnavailableError("the connection is lost"));
  }
  if (answers_ < number) {
    motion_ = FileDescriptor();
    answered_.notify_all();
    return In(address,
              absl::DeadlineExceededError(absl::StrCat("no answer to the command to ", what)));
  }
  const bool success = results_[number];
  results_.erase(number);
  if (success) return absl::OkStatus();
  return In(address, absl::AbortedError(absl::StrCat("it refuses to ", what)));
}

void SimpleMessageLink::Read() {
  while (true) {
    std::array<pollfd, 3> places{};
    places[0] = {.fd = wake_.get(), .events = POLLIN, .revents = 0};
    places[1] = {.fd = state_.get(), .events = POLLIN, .revents = 0};  // below 0: left out
    {
      const std::lock_guard lock(mutex_);
      if (ending_) return;
      places[2] = {.fd = motion_.get(), .events = POLLIN, .revents = 0};
    }
    poll(places.data(), places.size(), static_cast<int>(absl::ToInt64Milliseconds(kTryAgain)));
    uint64_t count = 0;
    [[maybe_unused]] const ssize_t taken = read(wake_.get(), &count, sizeof(count));
    ReadMotion();
    if (state_.valid()) {
      ReadState();
    } else {
      ConnectAgain();
    }
  }
}

void SimpleMessageLink::ReadMotion() {
  absl::Status lost;
  bool idle = false;
  {
    const std::lock_guard lock(mutex_);
    if (!motion_.valid()) return;
    absl::StatusOr<std::vector<uint8_t>> bytes = ReceiveSome(motion_);
    lost = bytes.status();
    if (bytes.ok()) motion_reader_.Append(*bytes);
    while (lost.ok()) {
      const absl::StatusOr<std::optional<Message>> message = motion_reader_.Next();
      lost = message.status();
      if (!message.ok() || !message->has_value()) break;
      if ((*message)->comm != simple_message::kServiceReply || answers_ >= sent_) continue;
      results_[++answers_] = (*message)->reply == simple_message::kSuccess;
      if (results_.size() > 64) results_.erase(results_.begin());
    }
    if (!lost.ok()) motion_ = FileDescriptor();
    idle = answers_ == sent_ && !(status_ && status_->in_motion == TriState::kOn);
  }
  answered_.notify_all();
  // A controller may close it while nothing is asked of it; the next command makes a new one.
  if (!lost.ok() && !idle) {
    observer_.failed(In(AddressOf(settings_.host, settings_.motion_port), lost));
  }
}

void SimpleMessageLink::ReadState() {
  const absl::StatusOr<std::vector<uint8_t>> bytes = ReceiveSome(state_);
  if (!bytes.ok()) return LoseState(bytes.status());
  const absl::Duration now = RunningNow();
  if (!bytes->empty()) heard_ = now;
  // A controller that was switched off does not close its connections.
  if (now - heard_ > settings_.timeout) {
    return LoseState(absl::UnavailableError(absl::StrCat(
        "no state came for ", SpokenTime(settings_.timeout), "; the connection is lost")));
  }
  state_reader_.Append(*bytes);
  while (true) {
    const absl::StatusOr<std::optional<Message>> message = state_reader_.Next();
    if (!message.ok()) return LoseState(message.status());
    if (!message->has_value()) return;
    Take(**message);
  }
}

void SimpleMessageLink::LoseState(const absl::Status& why) {
  state_ = FileDescriptor();
  status_.reset();
  next_try_ = RunningNow() + kTryAgain;
  observer_.failed(In(AddressOf(settings_.host, settings_.state_port), why));
}

void SimpleMessageLink::ConnectAgain() {
  if (RunningNow() < next_try_) return;
  next_try_ = RunningNow() + kTryAgain;
  absl::StatusOr<FileDescriptor> socket =
      ConnectTcp(settings_.host, settings_.state_port, settings_.timeout);
  if (!socket.ok()) return;
  state_ = *std::move(socket);
  heard_ = RunningNow();
  state_reader_ = MessageReader(settings_.byte_order);
}

void SimpleMessageLink::Take(const Message& message) {
  const auto take_positions = [&](const simple_message::JointValues& values) {
    {
      const std::lock_guard lock(mutex_);
      positions_.assign(values.begin(),
                        values.begin() + static_cast<ptrdiff_t>(settings_.joints.size()));
    }
    Tell();
  };
  if (const auto position = AsJointPosition(message)) {
    take_positions(position->positions);
  } else if (const auto feedback = AsJointFeedback(message)) {
    if (feedback->robot_id != 0) return;
    if ((feedback->valid_fields & simple_message::JointFeedback::kPositionsValid) == 0) return;
    take_positions(feedback->positions);
  } else if (const auto status = AsRobotStatus(message)) {
    status_ = status;
  }
}

void SimpleMessageLink::Tell() {
  RobotFeedback feedback;
  {
    const std::lock_guard lock(mutex_);
    feedback.positions = positions_;
  }
  if (status_) {
    TellHindrances(*status_, feedback);
    if (status_->in_motion != TriState::kUnknown) {
      feedback.moving = status_->in_motion == TriState::kOn;
    }
  }
  observer_.feedback(feedback);
}

}  // namespace silhouette
