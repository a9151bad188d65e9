// SPDX-License-Identifier: Apache-2.0
// A server whose machine vanishes without a word is missed, and found again.
#include <gtest/gtest.h>

#include <functional>
#include <thread>

#include "silhouette/check_stream.h"
#include "silhouette/local_space.h"
#include "tests/clients/cpp/vanishing_proxy.h"
#include "tests/clients/cpp/watched_space.h"

namespace silhouette::client {
namespace {

constexpr absl::Duration kVanishedServerLong = absl::Seconds(20);

bool Comes(const std::function<bool()>& what) {
  for (int i = 0; i < 6000; ++i) {
    if (what()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

TEST(VanishedServer, IsMissedByStreamsAndFoundAgainByLocalSpace) {
  WatchedServer server;
  VanishingProxy way(server.fake.address);
  server.fake.stream_checks = [](grpc::ServerContext&, auto& stream) {
    v1::StreamChecksRequest question;
    while (stream.Read(&question)) {
    }
    return grpc::Status::CANCELLED;
  };
  const Client client = Client::Connect(way.address()).value();
  const LocalSpace space(client, {.max_age = absl::Minutes(5)});
  server.Send(FirstUpdate(BasisOf(3)));
  space.WaitForUpdate(0, kVanishedServerLong);
  ASSERT_TRUE(space.IsFree(5));
  CheckStream checks = client.StreamChecks();
  ASSERT_TRUE(checks.Send(1, std::vector<Configuration>{{0, 5}}).ok());

  way.Vanish();
  EXPECT_TRUE(space.status().connected) << "nobody can know yet";
  EXPECT_EQ(checks.Receive().status().code(), absl::StatusCode::kUnavailable);
  ASSERT_TRUE(Comes([&] { return !space.status().connected; }));
  EXPECT_EQ(space.unknown_reason(), Reason::kConnectionLost);
  EXPECT_FALSE(space.IsFree(5));
  EXPECT_EQ(space.status().problem.code(), absl::StatusCode::kUnavailable);

  way.Return();
  ASSERT_TRUE(server.WaitForStreams(2));
  server.Send(FirstUpdate(BasisOf(4)));
  ASSERT_TRUE(Comes([&] { return space.IsFree(5); }));
  EXPECT_EQ(space.basis().scene_id, 4u);
  EXPECT_TRUE(space.status().connected);
}

}  // namespace
}  // namespace silhouette::client
