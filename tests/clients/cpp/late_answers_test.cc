// SPDX-License-Identifier: Apache-2.0
// An answer that was held up on its way until it was no longer valid.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

#include "silhouette/client.h"
#include "silhouette/messages.h"
#include "tests/clients/cpp/fake_server.h"

namespace silhouette::client {
namespace {

using ::testing::HasSubstr;

const std::vector<Configuration> kLateOne = {{0.1, 0.2}};
constexpr std::chrono::milliseconds kValid{500};  // from when an answer is made
constexpr std::chrono::milliseconds kHeldUp{800};

// A server whose robot is free everywhere. It works before it makes its answers, and holds them up
// afterwards.
class LateAnswers : public testing::Test {
 protected:
  LateAnswers() {
    server_.check_configurations = [this](auto&, const auto& request, auto& response) {
      const bool asks = request.configurations_size() + request.numbers_size() > 0;
      if (asks) std::this_thread::sleep_for(works_);
      for (int i = 0; i < request.configurations_size(); ++i) SetFree(*response.add_verdicts());
      if (request.numbers_size() > 0) {
        response.set_free("\x03");
        response.set_occupied(std::string(1, '\0'));
      }
      Stamp(*response.mutable_basis());
      if (asks) std::this_thread::sleep_for(held_up_);
      return grpc::Status::OK;
    };
    server_.check_path = [this](auto&, const v1::CheckPathRequest& request, auto& response) {
      std::this_thread::sleep_for(works_);
      SetFree(*response.mutable_verdict());
      response.set_proof(v1::PATH_PROOF_GRID);
      if (request.has_separation()) {
        response.mutable_separation()->set_level(2);
        *response.mutable_separation()->mutable_valid_for() =
            ToMessage(absl::FromChrono(level_valid_));
      }
      Stamp(*response.mutable_basis());
      path_made_ = RunningClock::now();
      std::this_thread::sleep_for(held_up_);
      return grpc::Status::OK;
    };
    server_.explain = [this](auto&, const auto&, auto& response) {
      std::this_thread::sleep_for(works_);
      SetFree(*response.mutable_verdict());
      Stamp(*response.mutable_basis());
      std::this_thread::sleep_for(held_up_);
      return grpc::Status::OK;
    };
    server_.configuration_space = [this](auto&, const auto&, auto& writer) {
      std::this_thread::sleep_for(works_);
      v1::GetConfigurationSpaceResponse part;
      Stamp(*part.mutable_basis());
      v1::GridJoint& joint = *part.mutable_grid()->add_joints();
      joint.set_name("a");
      joint.set_upper(1);
      joint.set_steps(10);
      part.mutable_grid()->add_tile_edges(4096);
      part.add_tiles()->set_free(std::string(512, '\xff'));
      part.mutable_tiles(0)->set_occupied(std::string(512, '\0'));
      std::this_thread::sleep_for(held_up_);
      writer.Write(part);
      return grpc::Status::OK;
    };
    server_.stream_checks = [this](auto&, auto& stream) {
      for (v1::StreamChecksRequest question; stream.Read(&question);) {
        std::this_thread::sleep_for(works_);
        v1::StreamChecksResponse answer;
        answer.set_id(question.id());
        SetFree(*answer.mutable_configurations()->add_verdicts());
        Stamp(*answer.mutable_configurations()->mutable_basis());
        std::this_thread::sleep_for(held_up_);
        stream.Write(answer);
      }
      return grpc::Status::OK;
    };
  }

  static void SetFree(v1::Verdict& verdict) { verdict.set_state(v1::Verdict::STATE_FREE); }
  void Stamp(v1::Basis& basis) const {
    basis.set_scene_id(3);
    *basis.mutable_valid_for() = ToMessage(absl::FromChrono(valid_));
    *basis.mutable_scene_age() = ToMessage(absl::Milliseconds(20));
    *basis.mutable_server_clock() =
        ToMessage(absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch()));
  }

  // The verdicts of all calls.
  std::vector<Verdict> AskAll() {
    const Client client = ClientOfHere(server_);
    const auto checks = client.CheckConfigurations(kLateOne);
    basis_ = checks->basis;
    const auto path = client.CheckPath(kLateOne);
    EXPECT_EQ(path->proof != PathProof::kNone, path->verdict.free());
    CheckStream stream = client.StreamChecks();
    EXPECT_TRUE(stream.Send(1, kLateOne).ok());
    const auto streamed = stream.Receive();
    stream.Cancel();
    const auto explanation = client.Explain(kLateOne[0]);
    return {checks->verdicts.at(0), path->verdict, streamed->checks->verdicts.at(0),
            explanation->verdict};
  }

  // The level of a path that the server worked on for `works` is valid for 1.5 s from then.
  void ExpectWholeLevel(std::chrono::milliseconds works) {
    valid_ = std::chrono::minutes(1);
    level_valid_ = std::chrono::milliseconds(1500);
    works_ = works;
    const RunningClock::time_point asked = RunningClock::now();
    const auto path =
        ClientOfHere(server_).CheckPath(kLateOne, {}, Clearance::kOmit, {}, SeparationPolicy{});
    ASSERT_TRUE(path.ok()) << path.status();
    EXPECT_EQ(path->separation->LevelNow(), 2);
    EXPECT_GE(path->separation->valid_until, asked + works / 2 + level_valid_);
    EXPECT_LE(path->separation->valid_until, path_made_.load() + level_valid_);
    EXPECT_TRUE(path->verdict.free());
  }

  FakeServer server_;
  std::chrono::milliseconds valid_ = kValid;
  std::chrono::milliseconds level_valid_ = kValid;
  std::atomic<RunningClock::time_point> path_made_{};
  std::chrono::milliseconds works_{0};
  std::chrono::milliseconds held_up_{0};
  Basis basis_;
};

TEST_F(LateAnswers, AreNeverFreeAndSaySo) {
  held_up_ = kHeldUp;
  for (const Verdict& verdict : AskAll()) {
    EXPECT_EQ(verdict.state, State::kUnknown);
    EXPECT_EQ(verdict.reason, Reason::kAnswerLate);
  }
  ASSERT_EQ(basis_.defects.size(), 1u);
  EXPECT_EQ(basis_.defects[0].reason, Reason::kAnswerLate);
  EXPECT_THAT(basis_.defects[0].message,
              testing::ContainsRegex("the answer was valid for 0.50 s and came after [0-9.]+ s:"));
  const auto numbers = ClientOfHere(server_).CheckNumbers(std::vector<uint32_t>{0, 1});
  EXPECT_EQ(numbers->StateOf(0), State::kUnknown);
  EXPECT_EQ(numbers->unknown_reason, Reason::kAnswerLate);
  const auto space = ClientOfHere(server_).GetConfigurationSpace();
  ASSERT_TRUE(space.ok()) << space.status();
  EXPECT_EQ(space->Count().unknown, 10u);
  EXPECT_EQ(space->unknown_reason(), Reason::kAnswerLate);
}

TEST_F(LateAnswers, OfAPathNameNoPlace) {
  server_.check_path = [this](auto&, const auto&, auto& response) {
    response.mutable_verdict()->set_state(v1::Verdict::STATE_OCCUPIED);
    response.set_segment(2);
    response.set_fraction(0.5);
    response.mutable_configuration()->add_positions(0.3);
    Stamp(*response.mutable_basis());
    std::this_thread::sleep_for(kHeldUp);
    return grpc::Status::OK;
  };
  const auto path = ClientOfHere(server_).CheckPath(kLateOne);
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(path->verdict.reason, Reason::kAnswerLate);
  EXPECT_EQ(path->segment, 0);
  EXPECT_EQ(path->fraction, 0);
  EXPECT_TRUE(path->configuration.empty());
  EXPECT_EQ(path->basis.scene_id, 3u);
}

TEST_F(LateAnswers, OfAStreamAreAlsoThoseThatWaitForReceiveUntilTheyExpire) {
  const Client client = ClientOfHere(server_);
  CheckStream stream = client.StreamChecks();
  ASSERT_TRUE(stream.Send(1, kLateOne).ok());
  ASSERT_TRUE(stream.Send(2, kLateOne).ok());
  EXPECT_TRUE(stream.Receive()->checks->AllFree());
  std::this_thread::sleep_for(kHeldUp);
  const auto late = stream.Receive();
  stream.Cancel();
  EXPECT_EQ(late->checks->verdicts.at(0).state, State::kUnknown);
  EXPECT_EQ(late->checks->verdicts.at(0).reason, Reason::kAnswerLate);
}

TEST_F(LateAnswers, AreNotThoseThatTheServerWorkedOnForLong) {
  // Valid for long enough to arrive on a busy machine.
  valid_ = std::chrono::milliseconds(1500);
  works_ = valid_ + std::chrono::milliseconds(200);
  for (const Verdict& verdict : AskAll()) EXPECT_TRUE(verdict.free()) << NameOf(verdict.reason);
  EXPECT_TRUE(basis_.defects.empty());
  const auto numbers = ClientOfHere(server_).CheckNumbers(std::vector<uint32_t>{0, 1});
  EXPECT_EQ(numbers->StateOf(0), State::kFree);
  const auto space = ClientOfHere(server_).GetConfigurationSpace();
  EXPECT_EQ(space->Count().free, 10u);
}

TEST_F(LateAnswers, HaveTheirSpeedLevelThoughTheServerWorkedLongerThanItIsValid) {
  ExpectWholeLevel(std::chrono::milliseconds(1700));
}

TEST_F(LateAnswers, HaveTheirSpeedLevelForAllOfItsTimeIfTheServerWorkedForMostOfIt) {
  ExpectWholeLevel(std::chrono::milliseconds(1000));
}

TEST_F(LateAnswers, HaveNoSpeedLevelOnceItHasExpired) {
  valid_ = std::chrono::minutes(1);
  held_up_ = kHeldUp;
  const auto path =
      ClientOfHere(server_).CheckPath(kLateOne, {}, Clearance::kOmit, {}, SeparationPolicy{});
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(path->separation->level, 2);
  EXPECT_EQ(path->separation->LevelNow(), 0);
  EXPECT_TRUE(path->verdict.free());
}

TEST_F(LateAnswers, AreNotThoseThatAreStillValid) {
  held_up_ = kHeldUp;
  valid_ = std::chrono::minutes(1);
  for (const Verdict& verdict : AskAll()) EXPECT_TRUE(verdict.free()) << NameOf(verdict.reason);
  EXPECT_TRUE(basis_.defects.empty());
}

TEST_F(LateAnswers, AreUnknownIfTheServerVouchesForNoTime) {
  valid_ = std::chrono::milliseconds(0);
  for (const Verdict& verdict : AskAll()) EXPECT_EQ(verdict.reason, Reason::kAnswerLate);
}

TEST_F(LateAnswers, ServerThatDoesNotStateHowLongItsAnswersAreValidIsRefused) {
  server_.check_path = [](auto&, const auto&, auto& response) {
    SetFree(*response.mutable_verdict());
    response.mutable_basis()->set_scene_id(3);
    return grpc::Status::OK;
  };
  const auto path = ClientOfHere(server_).CheckPath(kLateOne);
  EXPECT_EQ(path.status().code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(path.status().message()), HasSubstr("how long its answers are valid"));
}

TEST_F(LateAnswers, AreThoseOfAServerWhoseClockIsNotKnown) {
  works_ = kHeldUp;
  server_.check_configurations = nullptr;
  const auto path = ClientOfHere(server_).CheckPath(kLateOne);
  EXPECT_EQ(path->verdict.reason, Reason::kAnswerLate);
}

}  // namespace
}  // namespace silhouette::client
