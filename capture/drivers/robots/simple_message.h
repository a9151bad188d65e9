// SPDX-License-Identifier: Apache-2.0
// The frames of ROS-Industrial's simple_message protocol: a length, a header of three numbers, and
// a body. All fields are 32 bits wide, in the byte order of the controller. (ROS-Industrial's draft
// REP "Message Structures of the ROS-Industrial Simple Message Protocol".)
#pragma once

#include <array>
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

// The bodies of those simple_message messages that a robot is driven with. Angles are radians,
// lengths metres, times seconds; the places of joints that the robot lacks are 0.

using JointValues = std::array<float, kMostJoints>;

// Throws std::invalid_argument if there are more than kMostJoints.
JointValues ValuesOf(std::span<const double> positions);

// Sequence numbers that are none: what a trajectory point is for.
enum SpecialSequence : int32_t {
  kStartDownload = -1,
  kEndDownload = -3,
  kStopTrajectory = -4,  // stop moving at once
};

// JOINT_TRAJ_PT: go there. A point with the sequence number 0 begins a trajectory.
struct JointTrajPt {
  int32_t sequence = 0;
  JointValues positions{};
  float velocity = 0;  // share of the greatest joint speed, above 0, at most 1
  float duration = 0;  // of the way there

  bool operator==(const JointTrajPt&) const = default;
};

// JOINT_TRAJ_PT_FULL: be there, so fast, at that time of the trajectory. A trajectory begins where
// the robot is, at time 0.
struct JointTrajPtFull {
  static constexpr int32_t kTimeValid = 1;
  static constexpr int32_t kPositionsValid = 2;
  static constexpr int32_t kVelocitiesValid = 4;

  int32_t robot_id = 0;  // the group of joints
  int32_t sequence = 0;
  int32_t valid_fields = 0;
  float time = 0;
  JointValues positions{};
  JointValues velocities{};
  JointValues accelerations{};

  bool operator==(const JointTrajPtFull&) const = default;
};

// JOINT_POSITION: where the robot is.
struct JointPosition {
  int32_t sequence = 0;
  JointValues positions{};

  bool operator==(const JointPosition&) const = default;
};

// JOINT_FEEDBACK: where the robot is, and how it moves.
struct JointFeedback {
  static constexpr int32_t kTimeValid = 1;
  static constexpr int32_t kPositionsValid = 2;
  static constexpr int32_t kVelocitiesValid = 4;

  int32_t robot_id = 0;
  int32_t valid_fields = 0;
  float time = 0;
  JointValues positions{};
  JointValues velocities{};
  JointValues accelerations{};

  bool operator==(const JointFeedback&) const = default;
};

enum class TriState : int32_t { kUnknown = -1, kOff = 0, kOn = 1 };

// STATUS: how the controller is.
struct RobotStatus {
  TriState drives_powered = TriState::kUnknown;
  TriState e_stopped = TriState::kUnknown;
  int32_t error_code = 0;
  TriState in_error = TriState::kUnknown;
  TriState in_motion = TriState::kUnknown;
  int32_t mode = -1;  // 1: manual, 2: automatic
  TriState motion_possible = TriState::kUnknown;

  bool operator==(const RobotStatus&) const = default;
};

Message ToMessage(const JointTrajPt& point);      // a request
Message ToMessage(const JointTrajPtFull& point);  // likewise
Message ToMessage(const JointPosition& position);
Message ToMessage(const JointFeedback& feedback);
Message ToMessage(const RobotStatus& status);
// The answer to a request.
Message ReplyTo(const Message& request, bool success);

// Nothing if the message is of another type, or its body has not the type's length.
std::optional<JointTrajPt> AsJointTrajPt(const Message& message);
std::optional<JointTrajPtFull> AsJointTrajPtFull(const Message& message);
std::optional<JointPosition> AsJointPosition(const Message& message);
std::optional<JointFeedback> AsJointFeedback(const Message& message);
// A value that stands for no state is read as kUnknown.
std::optional<RobotStatus> AsRobotStatus(const Message& message);

}  // namespace silhouette::simple_message
