// SPDX-License-Identifier: Apache-2.0
// No call holds a worker longer than its caller waits, or for too much work.
#include <gmock/gmock.h>

#include <numbers>

#include "server/service/answers.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

constexpr double kTurn = 2 * std::numbers::pi;

v1::CheckPathRequest PathRequest(const std::vector<Configuration>& waypoints) {
  v1::CheckPathRequest request;
  for (const Configuration& q : waypoints) Set(q, request.add_waypoints());
  return request;
}

struct LimitsTest : ::testing::Test {
  LimitsTest() {
    absl::StatusOr<Scene> scene = MakeScene(*database, SceneWithBlock(3), {}, {}, clock.clock()());
    EXPECT_TRUE(serving.scenes.Publish(*std::move(scene), database).ok());
  }

  ServingSettings Settings() {
    ServingSettings settings;
    settings.clock = clock.clock();
    settings.map_time = absl::ZeroDuration();
    settings.most_path_checks = 100;
    return settings;
  }

  // Says at the `after`th time that the call is cancelled.
  Stop CancelledAfter(int after) {
    asked = 0;
    return [this, after] { return ++asked > after; };
  }

  std::shared_ptr<const ServedDatabase> database = NewDatabase();
  TestClock clock;
  Serving serving{database, Settings()};
  int asked = 0;
};

TEST_F(LimitsTest, CancelledCallEndsWithItsNextCheck) {
  v1::CheckConfigurationsRequest request;
  for (int i = 0; i < 1000; ++i) Set(At(1, 0), request.add_configurations());
  v1::CheckConfigurationsResponse response;
  EXPECT_TRUE(absl::IsCancelled(Answer(serving, request, CancelledAfter(10), &response)));
  EXPECT_EQ(asked, 11);
  request.set_include_clearance(true);
  EXPECT_TRUE(absl::IsCancelled(Answer(serving, request, CancelledAfter(10), &response)));
  EXPECT_EQ(asked, 11);
  request.Clear();
  for (uint32_t number = 0; number < 1000; ++number) request.add_numbers(number);
  EXPECT_TRUE(absl::IsCancelled(Answer(serving, request, CancelledAfter(0), &response)));
  EXPECT_EQ(asked, 1);

  const v1::CheckPathRequest path = PathRequest({At(1, 0), {At(1, 0)[0], 3 * kTurn}});
  v1::CheckPathResponse checked;
  EXPECT_TRUE(absl::IsCancelled(Answer(serving, path, CancelledAfter(10), &checked)));
  EXPECT_EQ(asked, 11);
}

TEST_F(LimitsTest, PathThatTakesTooManyChecksIsGivenUp) {
  v1::CheckPathRequest request = PathRequest({At(1, 0), At(2, 0), {At(2, 0)[0], 1000 * kTurn}});
  v1::CheckPathResponse response;
  const absl::Status status = Answer(serving, request, nullptr, &response);
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("more than 100 checks"));
  EXPECT_THAT(status.message(), HasSubstr("split it"));
  EXPECT_FALSE(response.has_verdict());
  request = PathRequest({At(1, 0), At(2, 0)});
  EXPECT_TRUE(Answer(serving, request, nullptr, &response).ok());
  EXPECT_EQ(response.verdict().state(), v1::Verdict::STATE_FREE);
}

TEST(Limits, ByDefaultAPathMayTakeAMillionChecksOrFewThatSearch) {
  EXPECT_EQ(ServingSettings().most_path_checks, 1'000'000);
  EXPECT_EQ(ServingSettings().most_path_searches, 20'000);
}

}  // namespace
}  // namespace silhouette
