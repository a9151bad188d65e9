// The frames of ROS-Industrial's simple_message protocol: a length, a header of three numbers, and
// a body. All fields are 32 bits wide, in the byte order of the controller. (ROS-Industrial's draft
// REP "Message Structures of the ROS-Industrial Simple Message Protocol".)
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace silhouette::simple_message {

enum class ByteOrder { kLittle, kBig };

// What a message is; others are read, too, and are for their receiver to ignore.
enum MessageType : int32_t {
  kJointPosition = 10,
  kJointTrajPt = 11,
  kJointTraj = 12,
  kStatus = 13,
  kJointTrajPtFull = 14,
  kJointFeedback = 15,
};

enum CommType : int32_t {
  kTopic = 1,  // needs no answer
  kServiceRequest = 2,
  kServiceReply = 3,
};

enum ReplyCode : int32_t {
  kNoReply = 0,  // of all that is no kServiceReply
  kSuccess = 1,
  kFailure = 2,
};

// Joints that a message has room for.
inline constexpr size_t kMostJoints = 10;

struct Message {
  int32_t type = 0;
  int32_t comm = 0;
  int32_t reply = kNoReply;
  std::vector<uint32_t> body = {};  // the words, whatever they stand for

  bool operator==(const Message&) const = default;
};

// Longest message, without its length, that is taken for one: bytes.
inline constexpr int32_t kMostBytes = 4096;

// With the length in front. Throws std::invalid_argument beyond kMostBytes.
std::vector<uint8_t> Encode(const Message& message, ByteOrder order);

// Cuts a stream of bytes into messages. The stream has no marks to find the next message by: after
// an error all that follows is one, too.
class MessageReader {
 public:
  explicit MessageReader(ByteOrder order) : order_(order) {}

  void Append(std::span<const uint8_t> bytes);

  // The next message; nothing: more bytes are needed. DataLoss: this is no simple_message, or one
  // in the other byte order; the message says which.
  absl::StatusOr<std::optional<Message>> Next();

 private:
  uint32_t WordAt(size_t place) const;

  ByteOrder order_;
  std::vector<uint8_t> bytes_;
  absl::Status broken_;
};

}  // namespace silhouette::simple_message
