// SPDX-License-Identifier: Apache-2.0
// StreamChecks, as a caller sees it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "tests/server/service/test_server.h"
#include "tests/server/service/watching.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

class StreamServiceTest : public ::testing::Test {
 protected:
  TestServer server{NewDatabase({.index = true})};
};

TEST_F(StreamServiceTest, AnswersComeInTheOrderAsked) {
  server.Publish(SceneWithBlock(3));
  Asking asking(server);
  std::thread asker([&] {
    for (uint64_t id = 0; id < 500; ++id) asking.Send(id, At(static_cast<int>(id % 5), 0));
    asking.NoMore();
  });
  for (uint64_t id = 0; id < 500; ++id) {
    const v1::StreamChecksResponse answer = asking.Next();
    EXPECT_EQ(answer.id(), id);
    EXPECT_EQ(answer.configurations().verdicts(0).state(),
              id % 5 == 3 ? v1::Verdict::STATE_OCCUPIED : v1::Verdict::STATE_FREE);
    EXPECT_EQ(answer.configurations().basis().scene_id(), 1u);
  }
  asker.join();
  EXPECT_TRUE(asking.Finish().ok());
}

TEST_F(StreamServiceTest, AnswersAreThoseOfSingleCalls) {
  server.Publish(SceneWithBlock(3));
  Asking asking(server);
  v1::StreamChecksRequest path;
  for (int a : {0, 4}) Set(At(a, 0), path.mutable_path()->add_waypoints());
  asking.Send(path);
  EXPECT_EQ(asking.Next().path().SerializeAsString(),
            server.Path({At(0, 0), At(4, 0)}).SerializeAsString());
  v1::StreamChecksRequest numbers;
  for (uint32_t number = 0; number < 100; ++number) {
    numbers.mutable_configurations()->add_numbers(number);
  }
  asking.Send(numbers);
  EXPECT_EQ(asking.Next().configurations().free(),
            server
                .CheckNumbers({numbers.configurations().numbers().begin(),
                               numbers.configurations().numbers().end()})
                .free());
}

TEST_F(StreamServiceTest, QuestionThatCannotBeAnsweredDoesNotEndTheCall) {
  server.Publish(SceneWithBlock(3));
  Asking asking(server);
  asking.Send(1, {0.0});
  asking.Send(v1::StreamChecksRequest());
  v1::StreamChecksRequest path;
  path.mutable_path();
  asking.Send(path);
  asking.Send(4, At(0, 0));
  const v1::StreamChecksResponse wrong = asking.Next();
  EXPECT_EQ(wrong.id(), 1u);
  EXPECT_EQ(wrong.error().code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(wrong.error().message(),
            "configurations[0]: it has 1 position and takes one for each of a, b");
  EXPECT_EQ(asking.Next().error().message(), "question: ask for configurations or for a path");
  EXPECT_EQ(asking.Next().error().message(), "waypoints: a path has at least one");
  EXPECT_EQ(asking.Next().configurations().verdicts(0).state(), v1::Verdict::STATE_FREE);
}

TEST(StreamService, QuestionBeyondTheLimitIsRefusedUnderItsIdAndLaterOnesAreAnswered) {
  ServingSettings settings;
  settings.limits.calls_per_second = 5;
  TestServer server(NewDatabase({.index = true}), settings);
  server.Publish(SceneWithBlock(3));
  Asking asking(server);
  uint64_t id = 100;
  const auto ask = [&] {
    asking.Send(++id, At(0, 0));
    v1::StreamChecksResponse answer = asking.Next();
    EXPECT_EQ(answer.id(), id);
    return answer;
  };
  EXPECT_TRUE(ask().has_configurations());
  v1::StreamChecksResponse refused = ask();
  for (int i = 0; i < 10'000 && !refused.has_error(); ++i) refused = ask();
  EXPECT_EQ(refused.error().code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(refused.error().message(), HasSubstr("'calls_per_second'"));
  std::this_thread::sleep_for(std::chrono::milliseconds(400));
  EXPECT_EQ(ask().configurations().verdicts(0).state(), v1::Verdict::STATE_FREE);
  asking.NoMore();
  EXPECT_TRUE(asking.Finish().ok());
}

TEST(StreamService, LargeQuestionBeyondTheLimitEndsTheCallWithTheLimit) {
  ServingSettings settings;
  settings.limits.calls_per_second = 2;
  TestServer server(NewDatabase({.index = true}), settings);
  server.Publish(SceneWithBlock(3));
  Asking asking(server);
  v1::StreamChecksResponse answer;
  for (uint64_t id = 1; id < 10 && !answer.has_error(); ++id) {
    asking.Send(id, At(0, 0));
    answer = asking.Next();
  }
  ASSERT_TRUE(answer.has_error());
  v1::StreamChecksRequest large;
  large.mutable_configurations()->mutable_numbers()->Resize(20'000, 0);
  asking.Send(large);
  asking.NoMore();
  const grpc::Status ended = asking.Finish();
  EXPECT_EQ(ended.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(ended.error_message(), HasSubstr("'calls_per_second'"));
}

TEST_F(StreamServiceTest, QuestionThatIsTooLargeEndsTheCallAndTheErrorNamesTheLimit) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "34 MB take minutes";
#endif
  Asking asking(server);
  v1::StreamChecksRequest request;
  request.set_id(1);
  request.mutable_configurations()->mutable_numbers()->Resize(8'500'000, 0);
  asking.Send(request);
  const grpc::Status ended = asking.Finish();
  EXPECT_EQ(ended.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(ended.error_message(), HasSubstr("at most 33554432"));
}

TEST_F(StreamServiceTest, EachQuestionIsAnsweredFromTheNewestScene) {
  Asking asking(server);
  asking.Send(0, At(3, 0));
  const v1::Verdict none = asking.Next().configurations().verdicts(0);
  EXPECT_EQ(none.state(), v1::Verdict::STATE_UNKNOWN);
  EXPECT_EQ(none.reason(), v1::Verdict::REASON_NO_SCENE);
  for (uint64_t scene = 1; scene < 10; ++scene) {
    server.Publish(scene % 2 == 1 ? SceneWithBlock(3) : EmptyCellScene());
    asking.Send(scene, At(3, 0));
    const v1::StreamChecksResponse answer = asking.Next();
    EXPECT_EQ(answer.configurations().basis().scene_id(), scene);
    EXPECT_EQ(answer.configurations().verdicts(0).state(),
              scene % 2 == 1 ? v1::Verdict::STATE_OCCUPIED : v1::Verdict::STATE_FREE);
  }
}

TEST_F(StreamServiceTest, CallerWhoDoesNotReadHoldsBackNobody) {
  server.Publish(SceneWithBlock(3));
  Asking asking(server);
  std::thread asker([&] {
    // More than the transport takes unread, in both directions.
    v1::StreamChecksRequest request;
    for (uint32_t number = 0; number < 20'000; ++number) {
      request.mutable_configurations()->add_numbers(number % 32);
    }
    for (int i = 0; i < 100; ++i) asking.Send(request);
    asking.NoMore();
  });
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(server.CheckOne(At(0, 0)).state(), v1::Verdict::STATE_FREE);
  }
  int answers = 0;
  for (; answers < 100; ++answers) EXPECT_EQ(asking.Next().configurations().free().size(), 2'500u);
  asker.join();
  EXPECT_TRUE(asking.Finish().ok());
}

TEST_F(StreamServiceTest, ServerThatStopsSaysSo) {
  server.Publish(SceneWithBlock(3));
  Asking waiting(server);
  waiting.Send(0, At(0, 0));
  waiting.Next();
  server.server->Stop(absl::Seconds(100));
  EXPECT_EQ(waiting.Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

}  // namespace
}  // namespace silhouette
