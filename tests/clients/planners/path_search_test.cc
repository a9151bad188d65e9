// SPDX-License-Identifier: Apache-2.0
// What the search for a path asks the server.
#include "clients/planners/path_search.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "tests/clients/cpp/fake_server.h"

namespace silhouette {
namespace {

TEST(PathSearch, AsksForNoMoreMovesAtOnceThanTheServerChecks) {
  constexpr int kMoves = 20'500;
  int requests = 0;
  int asked = 0;
  FakeServer server;
  server.check_configurations = [&](auto&, const v1::CheckConfigurationsRequest& request,
                                    v1::CheckConfigurationsResponse& response) -> grpc::Status {
    if (request.configurations_size() > 10'000) return {grpc::StatusCode::INVALID_ARGUMENT, ""};
    ++requests;
    response.mutable_basis()->set_scene_id(1);
    response.mutable_basis()->mutable_valid_for()->set_seconds(60);
    for (const v1::Configuration& q : request.configurations()) {
      EXPECT_NEAR(q.positions(0), asked + 0.5, 1e-6) << "the middle of the next move";
      ++asked;
      response.add_verdicts()->set_state(v1::Verdict::STATE_FREE);
    }
    return grpc::Status::OK;
  };
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = kMoves, .steps = kMoves + 1}});
  std::vector<client::ConfigurationSpaceTile> tiles;
  for (uint64_t tile = 0; tile < grid.tiles(); ++tile) {
    tiles.push_back({.tile = tile});
    tiles.back().free.fill(~uint64_t{0});
  }
  const auto search =
      SearchPath(client::ClientOfHere(server), {},
                 client::ConfigurationSpace(grid, {.scene_id = 1}, std::move(tiles)), {0}, true,
                 {kMoves}, true, Moves::kAxes, [] { return false; });
  ASSERT_TRUE(search.ok()) << search.status();
  EXPECT_TRUE(search->plan.found());
  EXPECT_EQ(asked, kMoves);
  EXPECT_EQ(requests, 3);
}

}  // namespace
}  // namespace silhouette
