// SPDX-License-Identifier: Apache-2.0
// The bytes of simple_message: as its description shows them, in both byte orders, and never more
// than that.
#include "capture/drivers/robots/simple_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <bit>

#include <limits>
#include <string>

#include "absl/strings/escaping.h"
#include "absl/strings/str_replace.h"
#include "tests/random.h"

namespace silhouette::simple_message {
namespace {

using testing::HasSubstr;

std::vector<uint8_t> Bytes(const std::string& hex) {
  const std::string bytes = absl::HexStringToBytes(absl::StrReplaceAll(hex, {{" ", ""}}));
  return {bytes.begin(), bytes.end()};
}

Message Read(const std::vector<uint8_t>& bytes, ByteOrder order) {
  MessageReader reader(order);
  reader.Append(bytes);
  const auto message = reader.Next();
  EXPECT_TRUE(message.ok() && message->has_value()) << message.status();
  return message.ok() && message->has_value() ? **message : Message{};
}

// The examples of the protocol's description, big-endian.
const std::string kTrajectoryPoint =
    "00000040 0000000B 00000002 00000000 00000001 A7600000 3EA7CDE8 BF5D9E57 C0490FDB 3F34815F "
    "C0490FDB 00000000 00000000 00000000 00000000 3DCCCCCD 40A00000";
const std::string kStatusMessage =
    "00000028 0000000D 00000001 00000000 00000001 FFFFFFFF 00000000 00000000 00000000 00000002 "
    "00000001";
const std::string kPosition =
    "00000038 0000000A 00000001 00000000 00000000 B81AD9FA B6836312 B7C043F5 B8B81516 B865D055 "
    "B8B6365E 00000000 00000000 00000000 00000000";

TEST(SimpleMessage, TrajectoryPointIsThatOfTheDescription) {
  const auto point = AsJointTrajPt(Read(Bytes(kTrajectoryPoint), ByteOrder::kBig));
  ASSERT_TRUE(point.has_value());
  EXPECT_EQ(point->sequence, 1);
  EXPECT_FLOAT_EQ(point->positions[1], 0.327742815F);
  EXPECT_FLOAT_EQ(point->positions[3], -3.141592741F);
  EXPECT_FLOAT_EQ(point->velocity, 0.1F);
  EXPECT_FLOAT_EQ(point->duration, 5);
  EXPECT_EQ(Encode(ToMessage(*point), ByteOrder::kBig), Bytes(kTrajectoryPoint));
}

TEST(SimpleMessage, FullTrajectoryPointHasItsFieldsInTheOrderOfTheDescription) {
  JointTrajPtFull point{.robot_id = 1, .sequence = 2, .valid_fields = 15, .time = 4};
  for (size_t j = 0; j < kMostJoints; ++j) {
    point.positions[j] = static_cast<float>(100 + j);
    point.velocities[j] = static_cast<float>(200 + j);
    point.accelerations[j] = static_cast<float>(300 + j);
  }
  const Message message = ToMessage(point);
  EXPECT_EQ(message.type, 14);
  EXPECT_EQ(message.comm, kServiceRequest);
  ASSERT_EQ(message.body.size(), 34u);
  EXPECT_EQ(message.body[0], 1u);
  EXPECT_EQ(message.body[1], 2u);
  EXPECT_EQ(message.body[2], 15u);
  for (size_t i = 3; i < 34; ++i) {
    const size_t j = i - 4;
    const size_t expected = i == 3 ? 4 : 100 * (1 + j / kMostJoints) + j % kMostJoints;
    EXPECT_EQ(std::bit_cast<float>(message.body[i]), static_cast<float>(expected)) << i;
  }
  EXPECT_EQ(AsJointTrajPtFull(message), point);
}

TEST(SimpleMessage, StatusIsThatOfTheDescription) {
  const auto status = AsRobotStatus(Read(Bytes(kStatusMessage), ByteOrder::kBig));
  ASSERT_TRUE(status.has_value());
  EXPECT_EQ(*status, (RobotStatus{.drives_powered = TriState::kOn,
                                  .e_stopped = TriState::kUnknown,
                                  .error_code = 0,
                                  .in_error = TriState::kOff,
                                  .in_motion = TriState::kOff,
                                  .mode = 2,
                                  .motion_possible = TriState::kOn}));
  EXPECT_EQ(Encode(ToMessage(*status), ByteOrder::kBig), Bytes(kStatusMessage));
}

TEST(SimpleMessage, PositionIsThatOfTheDescription) {
  const auto position = AsJointPosition(Read(Bytes(kPosition), ByteOrder::kBig));
  ASSERT_TRUE(position.has_value());
  EXPECT_NEAR(position->positions[3], -0.000087777, 1e-9);
  EXPECT_EQ(Encode(ToMessage(*position), ByteOrder::kBig), Bytes(kPosition));
}

TEST(SimpleMessage, LittleEndianTurnsEveryWordRound) {
  std::vector<uint8_t> big = Bytes(kStatusMessage);
  const auto little = Encode(Read(big, ByteOrder::kBig), ByteOrder::kLittle);
  ASSERT_EQ(little.size(), big.size());
  for (size_t i = 0; i < big.size(); ++i) EXPECT_EQ(little[i], big[i / 4 * 4 + 3 - i % 4]);
}

TEST(SimpleMessage, WrongByteOrderIsSaid) {
  MessageReader reader(ByteOrder::kLittle);
  reader.Append(Bytes(kStatusMessage));
  const auto message = reader.Next();
  EXPECT_TRUE(absl::IsDataLoss(message.status()));
  EXPECT_THAT(message.status().message(), HasSubstr("change 'byte_order'"));
}

TEST(SimpleMessage, AnyMessagesInAnyPiecesComeBackAsTheyWere) {
  Random random;
  for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig}) {
    std::vector<Message> sent;
    std::vector<uint8_t> stream;
    for (int i = 0; i < 200; ++i) {
      Message message{.type = static_cast<int32_t>(random()),
                      .comm = static_cast<int32_t>(random()),
                      .reply = static_cast<int32_t>(random())};
      message.body.resize(random() % 8 == 0 ? kMostBytes / 4 - 3 : random() % 40);
      for (uint32_t& word : message.body) word = static_cast<uint32_t>(random());
      const auto bytes = Encode(message, order);
      stream.insert(stream.end(), bytes.begin(), bytes.end());
      sent.push_back(message);
    }
    MessageReader reader(order);
    std::vector<Message> received;
    for (size_t at = 0; at < stream.size();) {
      const size_t piece = std::min<size_t>(1 + random() % 300, stream.size() - at);
      reader.Append(std::span(stream).subspan(at, piece));
      at += piece;
      for (auto next = reader.Next(); next.ok() && next->has_value(); next = reader.Next()) {
        received.push_back(**next);
      }
    }
    EXPECT_EQ(received, sent);
  }
}

TEST(SimpleMessage, GarbageEndsInAnErrorAndStaysOne) {
  Random random;
  for (int round = 0; round < 300; ++round) {
    MessageReader reader(round % 2 == 0 ? ByteOrder::kLittle : ByteOrder::kBig);
    size_t bytes = 0;
    bool broken = false;
    // A length that happens to be possible asks for kMostBytes at most.
    while (!broken && bytes < 100'000) {
      std::vector<uint8_t> piece(random() % 200);
      for (uint8_t& byte : piece) byte = static_cast<uint8_t>(random());
      bytes += piece.size();
      reader.Append(piece);
      auto next = reader.Next();
      while (next.ok() && next->has_value()) next = reader.Next();
      broken = !next.ok();
    }
    ASSERT_TRUE(broken);
    reader.Append(Encode({.type = kStatus}, ByteOrder::kLittle));
    EXPECT_TRUE(absl::IsDataLoss(reader.Next().status()));
  }
}

TEST(SimpleMessage, LengthsThatCannotBeAreRefused) {
  for (const char* length : {"00000000", "00000008", "0000000D", "00001004", "FFFFFFFF"}) {
    MessageReader reader(ByteOrder::kBig);
    reader.Append(Bytes(length));
    EXPECT_TRUE(absl::IsDataLoss(reader.Next().status())) << length;
  }
  EXPECT_THROW(Encode({.body = std::vector<uint32_t>(kMostBytes)}, ByteOrder::kBig),
               std::invalid_argument);
}

TEST(SimpleMessage, BodiesOfTheWrongLengthAreNone) {
  for (Message message :
       {ToMessage(JointTrajPt{}), ToMessage(JointTrajPtFull{}), ToMessage(JointPosition{}),
        ToMessage(JointFeedback{}), ToMessage(RobotStatus{})}) {
    for (const size_t words : {size_t{0}, message.body.size() - 1, message.body.size() + 1}) {
      Message wrong = message;
      wrong.body.resize(words);
      EXPECT_FALSE(AsJointTrajPt(wrong) || AsJointTrajPtFull(wrong) || AsJointPosition(wrong) ||
                   AsJointFeedback(wrong) || AsRobotStatus(wrong));
    }
  }
}

TEST(SimpleMessage, FeedbackComesBackAsItWas) {
  JointFeedback feedback{.robot_id = 2, .valid_fields = 3, .time = 1.5F};
  feedback.positions[9] = 0.25F;
  feedback.velocities[0] = -1;
  feedback.accelerations[4] = 7;
  EXPECT_EQ(AsJointFeedback(ToMessage(feedback)), feedback);
}

TEST(SimpleMessage, StateThatIsNoneIsUnknown) {
  Message message = ToMessage(RobotStatus{.e_stopped = TriState::kOff});
  message.body[1] = 7;
  EXPECT_EQ(AsRobotStatus(message)->e_stopped, TriState::kUnknown);
}

}  // namespace
}  // namespace silhouette::simple_message
