#include "capture/drivers/simple_message_bodies.h"

#include <bit>
#include <stdexcept>

#include "absl/strings/str_cat.h"

namespace silhouette::simple_message {
namespace {

class Writer {
 public:
  explicit Writer(int32_t type, int32_t comm) : message_{.type = type, .comm = comm} {}

  Writer& Put(int32_t value) {
    message_.body.push_back(std::bit_cast<uint32_t>(value));
    return *this;
  }
  Writer& Put(float value) {
    message_.body.push_back(std::bit_cast<uint32_t>(value));
    return *this;
  }
  Writer& Put(TriState value) { return Put(static_cast<int32_t>(value)); }
  Writer& Put(const JointValues& values) {
    for (const float value : values) Put(value);
    return *this;
  }
  Message Done() { return std::move(message_); }

 private:
  Message message_;
};

// Reads the words of a body that is long enough.
class Reader {
 public:
  explicit Reader(const Message& message) : words_(message.body) {}

  int32_t Int() { return std::bit_cast<int32_t>(words_[at_++]); }
  float Real() { return std::bit_cast<float>(words_[at_++]); }
  TriState State() {
    const int32_t value = Int();
    return value == 0 || value == 1 ? static_cast<TriState>(value) : TriState::kUnknown;
  }
  JointValues Values() {
    JointValues values{};
    for (float& value : values) value = Real();
    return values;
  }

 private:
  std::span<const uint32_t> words_;
  size_t at_ = 0;
};

bool Is(const Message& message, int32_t type, size_t words) {
  return message.type == type && message.body.size() == words;
}

}  // namespace

JointValues ValuesOf(std::span<const double> positions) {
  if (positions.size() > kMostJoints) {
    throw std::invalid_argument(
        absl::StrCat("a simple_message holds ", kMostJoints, " joints, not ", positions.size()));
  }
  JointValues values{};
  for (size_t j = 0; j < positions.size(); ++j) values[j] = static_cast<float>(positions[j]);
  return values;
}

Message ToMessage(const JointTrajPt& point) {
  return Writer(kJointTrajPt, kServiceRequest)
      .Put(point.sequence)
      .Put(point.positions)
      .Put(point.velocity)
      .Put(point.duration)
      .Done();
}

Message ToMessage(const JointPosition& position) {
  return Writer(kJointPosition, kTopic).Put(position.sequence).Put(position.positions).Done();
}

Message ToMessage(const JointFeedback& feedback) {
  return Writer(kJointFeedback, kTopic)
      .Put(feedback.robot_id)
      .Put(feedback.valid_fields)
      .Put(feedback.time)
      .Put(feedback.positions)
      .Put(feedback.velocities)
      .Put(feedback.accelerations)
      .Done();
}

Message ToMessage(const RobotStatus& status) {
  return Writer(kStatus, kTopic)
      .Put(status.drives_powered)
      .Put(status.e_stopped)
      .Put(status.error_code)
      .Put(status.in_error)
      .Put(status.in_motion)
      .Put(status.mode)
      .Put(status.motion_possible)
      .Done();
}

Message ReplyTo(const Message& request, bool success) {
  // Some clients expect a body of the joints' length.
  return {.type = request.type,
          .comm = kServiceReply,
          .reply = success ? kSuccess : kFailure,
          .body = std::vector<uint32_t>(kMostJoints, 0)};
}

std::optional<JointTrajPt> AsJointTrajPt(const Message& message) {
  if (!Is(message, kJointTrajPt, kMostJoints + 3)) return std::nullopt;
  Reader reader(message);
  JointTrajPt point;
  point.sequence = reader.Int();
  point.positions = reader.Values();
  point.velocity = reader.Real();
  point.duration = reader.Real();
  return point;
}

std::optional<JointPosition> AsJointPosition(const Message& message) {
  if (!Is(message, kJointPosition, kMostJoints + 1)) return std::nullopt;
  Reader reader(message);
  JointPosition position;
  position.sequence = reader.Int();
  position.positions = reader.Values();
  return position;
}

std::optional<JointFeedback> AsJointFeedback(const Message& message) {
  if (!Is(message, kJointFeedback, 3 * kMostJoints + 3)) return std::nullopt;
  Reader reader(message);
  JointFeedback feedback;
  feedback.robot_id = reader.Int();
  feedback.valid_fields = reader.Int();
  feedback.time = reader.Real();
  feedback.positions = reader.Values();
  feedback.velocities = reader.Values();
  feedback.accelerations = reader.Values();
  return feedback;
}

std::optional<RobotStatus> AsRobotStatus(const Message& message) {
  if (!Is(message, kStatus, 7)) return std::nullopt;
  Reader reader(message);
  RobotStatus status;
  status.drives_powered = reader.State();
  status.e_stopped = reader.State();
  status.error_code = reader.Int();
  status.in_error = reader.State();
  status.in_motion = reader.State();
  status.mode = reader.Int();
  status.motion_possible = reader.State();
  return status;
}

}  // namespace silhouette::simple_message
