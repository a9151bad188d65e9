// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/robots/simple_message.h"

#include <bit>
#include <concepts>
#include <stdexcept>
#include <tuple>
#include <type_traits>

#include "absl/strings/str_cat.h"

namespace silhouette::simple_message {
namespace {

constexpr size_t kWord = 4;
constexpr size_t kHeader = 3 * kWord;

uint32_t Swapped(uint32_t word) { return __builtin_bswap32(word); }

bool IsLength(uint32_t length) {
  return length >= kHeader && length <= kMostBytes && length % kWord == 0;
}

}  // namespace

std::vector<uint8_t> Encode(const Message& message, ByteOrder order) {
  const size_t length = kHeader + kWord * message.body.size();
  if (length > kMostBytes) {
    throw std::invalid_argument(absl::StrCat("a message of ", length, " bytes is too long"));
  }
  std::vector<uint8_t> bytes;
  bytes.reserve(kWord + length);
  const auto put = [&](uint32_t word) {
    for (size_t i = 0; i < kWord; ++i) {
      const size_t shift = order == ByteOrder::kLittle ? 8 * i : 8 * (kWord - 1 - i);
      bytes.push_back(static_cast<uint8_t>(word >> shift));
    }
  };
  put(static_cast<uint32_t>(length));
  for (const int32_t field : {message.type, message.comm, message.reply}) {
    put(static_cast<uint32_t>(field));
  }
  for (const uint32_t word : message.body) put(word);
  return bytes;
}

void MessageReader::Append(std::span<const uint8_t> bytes) {
  if (broken_.ok()) bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

uint32_t MessageReader::WordAt(size_t place) const {
  uint32_t word = 0;
  for (size_t i = 0; i < kWord; ++i) {
    const size_t shift = order_ == ByteOrder::kLittle ? 8 * i : 8 * (kWord - 1 - i);
    word |= uint32_t{bytes_[place + i]} << shift;
  }
  return word;
}

absl::StatusOr<std::optional<Message>> MessageReader::Next() {
  if (!broken_.ok()) return broken_;
  if (bytes_.size() < kWord) return std::nullopt;
  const uint32_t length = WordAt(0);
  if (!IsLength(length)) {
    broken_ = absl::DataLossError(
        IsLength(Swapped(length))
            ? "its messages are in the other byte order; change 'byte_order'"
            : absl::StrCat("what it sends is no simple_message: the length ", length));
    bytes_.clear();
    return broken_;
  }
  if (bytes_.size() < kWord + length) return std::nullopt;
  Message message;
  message.type = std::bit_cast<int32_t>(WordAt(kWord));
  message.comm = std::bit_cast<int32_t>(WordAt(2 * kWord));
  message.reply = std::bit_cast<int32_t>(WordAt(3 * kWord));
  for (size_t place = kWord + kHeader; place < kWord + length; place += kWord) {
    message.body.push_back(WordAt(place));
  }
  bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<ptrdiff_t>(kWord + length));
  return message;
}

namespace {

// A body, to be read or to be written.
template <typename Value, typename Body>
concept Some = std::same_as<std::remove_const_t<Value>, Body>;

// The fields of each body, in the order of their bytes.
auto FieldsOf(Some<JointTrajPt> auto& body) {
  return std::tie(body.sequence, body.positions, body.velocity, body.duration);
}
auto FieldsOf(Some<JointTrajPtFull> auto& body) {
  return std::tie(body.robot_id, body.sequence, body.valid_fields, body.time, body.positions,
                  body.velocities, body.accelerations);
}
auto FieldsOf(Some<JointPosition> auto& body) { return std::tie(body.sequence, body.positions); }
auto FieldsOf(Some<JointFeedback> auto& body) {
  return std::tie(body.robot_id, body.valid_fields, body.time, body.positions, body.velocities,
                  body.accelerations);
}
auto FieldsOf(Some<RobotStatus> auto& body) {
  return std::tie(body.drives_powered, body.e_stopped, body.error_code, body.in_error,
                  body.in_motion, body.mode, body.motion_possible);
}

// A field of one word.
template <typename Field>
void Put(const Field& field, std::vector<uint32_t>& words) {
  words.push_back(std::bit_cast<uint32_t>(field));
}
void Put(const JointValues& values, std::vector<uint32_t>& words) {
  for (const float value : values) Put(value, words);
}

// Each takes its words from the front.
template <typename Field>
void Take(std::span<const uint32_t>& words, Field& field) {
  field = std::bit_cast<Field>(words.front());
  words = words.subspan(1);
}
void Take(std::span<const uint32_t>& words, TriState& state) {
  int32_t value = 0;
  Take(words, value);
  state = value == 0 || value == 1 ? static_cast<TriState>(value) : TriState::kUnknown;
}
void Take(std::span<const uint32_t>& words, JointValues& values) {
  for (float& value : values) Take(words, value);
}

template <typename Body>
Message MessageOf(const Body& body, int32_t type, int32_t comm) {
  Message message{.type = type, .comm = comm};
  std::apply([&](const auto&... fields) { (Put(fields, message.body), ...); }, FieldsOf(body));
  return message;
}

template <typename Body>
std::optional<Body> BodyOf(const Message& message, int32_t type) {
  Body body;
  const size_t words =
      std::apply([](const auto&... fields) { return ((sizeof(fields) / sizeof(uint32_t)) + ...); },
                 FieldsOf(body));
  if (message.type != type || message.body.size() != words) return std::nullopt;
  std::span<const uint32_t> left = message.body;
  std::apply([&](auto&... fields) { (Take(left, fields), ...); }, FieldsOf(body));
  return body;
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
  return MessageOf(point, kJointTrajPt, kServiceRequest);
}
Message ToMessage(const JointTrajPtFull& point) {
  return MessageOf(point, kJointTrajPtFull, kServiceRequest);
}
Message ToMessage(const JointPosition& position) {
  return MessageOf(position, kJointPosition, kTopic);
}
Message ToMessage(const JointFeedback& feedback) {
  return MessageOf(feedback, kJointFeedback, kTopic);
}
Message ToMessage(const RobotStatus& status) { return MessageOf(status, kStatus, kTopic); }

Message ReplyTo(const Message& request, bool success) {
  // Some clients expect a body of the joints' length.
  return {.type = request.type,
          .comm = kServiceReply,
          .reply = success ? kSuccess : kFailure,
          .body = std::vector<uint32_t>(kMostJoints, 0)};
}

std::optional<JointTrajPt> AsJointTrajPt(const Message& message) {
  return BodyOf<JointTrajPt>(message, kJointTrajPt);
}
std::optional<JointTrajPtFull> AsJointTrajPtFull(const Message& message) {
  return BodyOf<JointTrajPtFull>(message, kJointTrajPtFull);
}
std::optional<JointPosition> AsJointPosition(const Message& message) {
  return BodyOf<JointPosition>(message, kJointPosition);
}
std::optional<JointFeedback> AsJointFeedback(const Message& message) {
  return BodyOf<JointFeedback>(message, kJointFeedback);
}
std::optional<RobotStatus> AsRobotStatus(const Message& message) {
  return BodyOf<RobotStatus>(message, kStatus);
}

}  // namespace silhouette::simple_message
