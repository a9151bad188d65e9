// SPDX-License-Identifier: Apache-2.0
// One client used by many threads at once.
#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "silhouette/client.h"
#include "tests/clients/cpp/fake_server.h"

namespace silhouette::client {
namespace {

TEST(ClientThreads, EachGetsTheAnswerToItsOwnQuestion) {
  FakeServer server;
  server.check_configurations = [](auto&, const v1::CheckConfigurationsRequest& request,
                                   v1::CheckConfigurationsResponse& response) {
    response.mutable_basis()->set_scene_id(1);
    response.mutable_basis()->mutable_valid_for()->set_seconds(60);
    for (const v1::Configuration& q : request.configurations()) {
      response.add_verdicts()->set_state(q.positions(0) > 0 ? v1::Verdict::STATE_FREE
                                                            : v1::Verdict::STATE_OCCUPIED);
    }
    return grpc::Status::OK;
  };
  const Client client = ClientOfHere(server);
  std::vector<int> right(4, 0);
  std::vector<std::jthread> threads;
  for (size_t t = 0; t < right.size(); ++t) {
    threads.emplace_back([&client, &right, t] {
      for (int i = 0; i < 50; ++i) {
        const bool free = (t + static_cast<size_t>(i)) % 2 == 0;
        const auto checks = client.CheckConfigurations({{free ? 1.0 : -1.0}});
        right[t] += checks.ok() && checks->verdicts[0].free() == free ? 1 : 0;
      }
    });
  }
  threads.clear();
  for (int count : right) EXPECT_EQ(count, 50);
}

}  // namespace
}  // namespace silhouette::client
