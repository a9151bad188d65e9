// SPDX-License-Identifier: Apache-2.0
// Checks over one call: each question gets its own answer, and none that did not come is made up.
#include "silhouette/check_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <thread>
#include <vector>

#include "silhouette/client.h"
#include "silhouette/messages.h"
#include "silhouette/running_clock.h"
#include "tests/clients/cpp/fake_server.h"

namespace silhouette::client {
namespace {

using ::testing::HasSubstr;

using Question = v1::StreamChecksRequest;
using Answer = v1::StreamChecksResponse;
using Stream = grpc::ServerReaderWriter<Answer, Question>;

// The basis of an answer that is made now.
void SetBasis(v1::Basis& basis) {
  basis.set_scene_id(3);
  basis.mutable_valid_for()->set_seconds(60);
  *basis.mutable_server_clock() =
      ToMessage(absl::FromChrono(RunningClock::now().time_since_epoch()));
}

// Free where the first joint is positive.
v1::CheckConfigurationsResponse Judge(const v1::CheckConfigurationsRequest& request) {
  v1::CheckConfigurationsResponse response;
  SetBasis(*response.mutable_basis());
  for (const v1::Configuration& q : request.configurations()) {
    response.add_verdicts()->set_state(q.positions(0) > 0 ? v1::Verdict::STATE_FREE
                                                          : v1::Verdict::STATE_OCCUPIED);
  }
  return response;
}

Answer RightAnswer(const Question& question) {
  Answer answer;
  answer.set_id(question.id());
  if (question.has_configurations()) {
    *answer.mutable_configurations() = Judge(question.configurations());
  } else {
    SetBasis(*answer.mutable_path()->mutable_basis());
    answer.mutable_path()->mutable_verdict()->set_state(v1::Verdict::STATE_FREE);
    answer.mutable_path()->set_checked(question.path().waypoints_size());
  }
  return answer;
}

// Answers every question with what `answer` makes of it.
void Serve(FakeServer& server, const std::function<Answer(const Question&)>& answer) {
  server.check_configurations = [](auto&, const auto& request, auto& response) {
    response = Judge(request);
    return grpc::Status::OK;
  };
  server.stream_checks = [answer](grpc::ServerContext&, Stream& stream) {
    Question question;
    while (stream.Read(&question)) stream.Write(answer(question));
    return grpc::Status::OK;
  };
}

CheckStream StreamTo(const FakeServer& server) { return ClientOfHere(server).StreamChecks(); }

TEST(CheckStream, AnswersComeInTheOrderOfTheQuestions) {
  FakeServer server;
  Serve(server, RightAnswer);
  CheckStream stream = StreamTo(server);
  constexpr uint64_t kQuestions = 3000;
  for (uint64_t i = 0; i < kQuestions; ++i) {
    ASSERT_TRUE(stream.Send(i, {{i % 3 == 0 ? 1.0 : -1.0}, {1.0}}).ok());
  }
  stream.EndQuestions();
  for (uint64_t i = 0; i < kQuestions; ++i) {
    const auto answer = stream.Receive();
    ASSERT_TRUE(answer.ok()) << answer.status();
    ASSERT_EQ(answer->id, i);
    ASSERT_TRUE(answer->checks.ok());
    ASSERT_EQ(answer->checks->verdicts.size(), 2u);
    ASSERT_EQ(answer->checks->AllFree(), i % 3 == 0);
    ASSERT_EQ(answer->path.status().code(), absl::StatusCode::kFailedPrecondition);
  }
  EXPECT_EQ(stream.Receive().status().code(), absl::StatusCode::kOutOfRange);
  EXPECT_EQ(stream.Send(1, {{1.0}}).code(), absl::StatusCode::kFailedPrecondition);
}

TEST(CheckStream, AgeCountsFromWhenTheQuestionWasSent) {
  FakeServer server;
  Serve(server, [](const Question& question) {
    std::this_thread::sleep_for(std::chrono::milliseconds(60));
    return RightAnswer(question);
  });
  CheckStream stream = StreamTo(server);
  ASSERT_TRUE(stream.Send(1, {{1.0}}).ok());
  const auto answer = stream.Receive();
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_GE(answer->checks->basis.Age(), absl::Milliseconds(60));
}

TEST(CheckStream, PathsAreAnsweredAmongTheOthers) {
  FakeServer server;
  Serve(server, RightAnswer);
  CheckStream stream = StreamTo(server);
  const std::vector<Configuration> path = {{1.0}, {2.0}, {3.0}};
  ASSERT_TRUE(stream.SendPath(8, path).ok());
  ASSERT_TRUE(stream.Send(9, {{1.0}}).ok());
  const auto first = stream.Receive();
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->id, 8u);
  ASSERT_TRUE(first->path.ok());
  EXPECT_TRUE(first->path->verdict.free());
  EXPECT_EQ(first->path->checked, 3);
  EXPECT_FALSE(first->checks.ok());
  EXPECT_EQ(stream.Receive()->id, 9u);
  EXPECT_EQ(stream.SendPath(1, {}).code(), absl::StatusCode::kInvalidArgument);
}

TEST(CheckStream, PathIsAskedWithItsResolution) {
  FakeServer server;
  std::atomic<double> asked = 0;
  Serve(server, [&](const Question& question) {
    asked = question.path().path_resolution();
    return RightAnswer(question);
  });
  CheckStream stream = StreamTo(server);
  const std::vector<Configuration> path = {{1.0}, {2.0}};
  ASSERT_TRUE(stream.SendPath(1, path, {}, Clearance::kOmit, /*resolution=*/0.001).ok());
  EXPECT_TRUE(stream.Receive().ok());
  EXPECT_EQ(asked, 0.001);
}

TEST(CheckStream, QuestionThatCannotBeAnsweredDoesNotEndTheCall) {
  FakeServer server;
  Serve(server, [](const Question& question) {
    if (question.id() != 1) return RightAnswer(question);
    Answer answer;
    answer.set_id(1);
    answer.mutable_error()->set_code(grpc::StatusCode::INVALID_ARGUMENT);
    answer.mutable_error()->set_message("2 values are needed");
    return answer;
  });
  CheckStream stream = StreamTo(server);
  ASSERT_TRUE(stream.Send(1, {{1.0}}).ok());
  ASSERT_TRUE(stream.Send(2, {{1.0}}).ok());
  const auto first = stream.Receive();
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->checks.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(first->checks.status().message()), HasSubstr("2 values are needed"));
  EXPECT_TRUE(stream.Receive()->checks->AllFree());
}

TEST(CheckStream, AnswerThatDoesNotFitItsQuestionEndsTheCall) {
  const auto refused = [](const std::function<void(Answer&)>& break_it, const std::string& what) {
    FakeServer server;
    Serve(server, [&](const Question& question) {
      Answer answer = RightAnswer(question);
      break_it(answer);
      return answer;
    });
    CheckStream stream = StreamTo(server);
    ASSERT_TRUE(stream.Send(5, {{1.0}}).ok());
    for (int i = 0; i < 2; ++i) {
      const absl::Status status = stream.Receive().status();
      EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
      EXPECT_THAT(std::string(status.message()), HasSubstr(what));
    }
    EXPECT_FALSE(stream.Send(6, {{1.0}}).ok());
  };
  refused([](Answer& answer) { answer.set_id(6); }, "question 6 instead of 5");
  refused([](Answer& answer) { answer.clear_answer(); }, "not the answer");
  refused([](Answer& answer) { answer.mutable_path(); }, "not the answer");
  refused([](Answer& answer) { answer.mutable_error(); }, "an error is none");
}

TEST(CheckStream, AnswerWithTooFewVerdictsIsAnErrorAndNoVerdict) {
  FakeServer server;
  Serve(server, [](const Question& question) {
    Answer answer = RightAnswer(question);
    answer.mutable_configurations()->mutable_verdicts()->RemoveLast();
    return answer;
  });
  CheckStream stream = StreamTo(server);
  ASSERT_TRUE(stream.Send(5, {{1.0}, {1.0}}).ok());
  EXPECT_EQ(stream.Receive()->checks.status().code(), absl::StatusCode::kInternal);
}

TEST(CheckStream, UnaskedAnswerEndsTheCall) {
  FakeServer server;
  Serve(server, RightAnswer);
  server.stream_checks = [](grpc::ServerContext&, Stream& stream) {
    Question question;
    stream.Read(&question);
    stream.Write(RightAnswer(question));
    stream.Write(RightAnswer(question));
    return grpc::Status::OK;
  };
  CheckStream stream = StreamTo(server);
  ASSERT_TRUE(stream.Send(5, {{1.0}}).ok());
  absl::Status status = stream.Receive().status();
  if (status.ok()) status = stream.Receive().status();
  EXPECT_THAT(std::string(status.message()), HasSubstr("was not asked"));
}

TEST(CheckStream, LossLeavesTheOtherQuestionsWithoutAnAnswer) {
  for (const auto code : {grpc::StatusCode::UNAVAILABLE, grpc::StatusCode::CANCELLED,
                          grpc::StatusCode::DEADLINE_EXCEEDED, grpc::StatusCode::OK}) {
    FakeServer server;
    server.stream_checks = [code](grpc::ServerContext&, Stream& stream) {
      Question question;
      for (int i = 0; i < 3; ++i) stream.Read(&question);
      return grpc::Status(code, "broke off");
    };
    CheckStream stream = StreamTo(server);
    for (uint64_t i = 0; i < 3; ++i) ASSERT_TRUE(stream.Send(i, {{1.0}}).ok());
    const absl::StatusCode expected =
        code == grpc::StatusCode::OK ? absl::StatusCode::kInternal : absl::StatusCode::kUnavailable;
    EXPECT_EQ(stream.Receive().status().code(), expected);
    EXPECT_EQ(stream.Receive().status().code(), expected);
    EXPECT_EQ(stream.Send(4, {{1.0}}).code(), expected);
  }
}

TEST(CheckStream, QuestionsWhoseAnswersNobodyReceivesAreBounded) {
  FakeServer server;
  Serve(server, RightAnswer);
  CheckStream stream = StreamTo(server);
  for (uint64_t i = 0; i < CheckStream::kMostUnanswered; ++i) {
    ASSERT_TRUE(stream.Send(i, {{1.0}}).ok());
  }
  EXPECT_EQ(stream.Send(1, {{1.0}}).code(), absl::StatusCode::kResourceExhausted);
  ASSERT_TRUE(stream.Receive().ok());
  EXPECT_TRUE(stream.Send(1, {{1.0}}).ok());
}

TEST(CheckStream, CancelEndsItFromAnotherThread) {
  FakeServer server;
  server.stream_checks = [](grpc::ServerContext& context, Stream&) {
    while (!context.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    return grpc::Status::CANCELLED;
  };
  CheckStream stream = StreamTo(server);
  ASSERT_TRUE(stream.Send(1, {{1.0}}).ok());
  std::jthread other([&stream] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    stream.Cancel();
  });
  EXPECT_EQ(stream.Receive().status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(stream.Send(2, {{1.0}}).code(), absl::StatusCode::kCancelled);
  CheckStream not_begun = StreamTo(server);
  std::jthread another([&not_begun] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    not_begun.Cancel();
  });
  EXPECT_EQ(not_begun.Receive().status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(not_begun.Send(1, {{1.0}}).code(), absl::StatusCode::kCancelled);
  CheckStream never_used = StreamTo(server);
  never_used.EndQuestions();
  EXPECT_EQ(never_used.Receive().status().code(), absl::StatusCode::kOutOfRange);
  CheckStream goes_away = StreamTo(server);
  EXPECT_TRUE(goes_away.Send(1, {{1.0}}).ok());
}

TEST(CheckStream, ServerThatCannotIsNamed) {
  FakeServer server;
  CheckStream stream = StreamTo(server);
  stream.Send(1, {{1.0}}).IgnoreError();
  EXPECT_EQ(stream.Receive().status().code(), absl::StatusCode::kUnimplemented);
}

}  // namespace
}  // namespace silhouette::client
