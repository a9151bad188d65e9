// SPDX-License-Identifier: Apache-2.0
#include "clients/planners/joint_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "absl/status/status.h"

namespace silhouette {
namespace {

const std::vector<GridJoint> kSearched(4, {.name = "joint", .lower = -2, .upper = 2});

// A wall between the halves of the first joint, with a gap where the second is above 1.
bool IsInWall(const Configuration& q) { return std::abs(q[0]) < 0.3 && q[1] < 1; }

absl::StatusOr<bool> IsFreeOfWall(const Configuration& from, const Configuration& to) {
  for (int i = 0; i <= 100; ++i) {
    Configuration q = from;
    for (size_t j = 0; j < q.size(); ++j) q[j] += 0.01 * i * (to[j] - from[j]);
    if (IsInWall(q)) return false;
  }
  return true;
}

const Configuration kFromHere = {-1.5, -1, 0, 0.5};
const Configuration kToThere = {1.5, -1, 0, -0.5};

TEST(JointSearch, FindsAFreePathThroughTheGap) {
  for (uint64_t seed = 1; seed < 6; ++seed) {
    const auto found = SearchJoints(kSearched, kFromHere, kToThere, {.seed = seed}, IsFreeOfWall,
                                    [] { return false; });
    ASSERT_TRUE(found.ok()) << found.status();
    ASSERT_GE(found->waypoints.size(), 3u);
    EXPECT_EQ(found->waypoints.front(), kFromHere);
    EXPECT_EQ(found->waypoints.back(), kToThere);
    for (size_t i = 0; i + 1 < found->waypoints.size(); ++i) {
      EXPECT_TRUE(*IsFreeOfWall(found->waypoints[i], found->waypoints[i + 1]));
      for (size_t j = 0; j < 4; ++j) EXPECT_LE(std::abs(found->waypoints[i][j]), 2);
    }
  }
}

TEST(JointSearch, StraightWayThatIsFreeIsThePath) {
  const auto found =
      SearchJoints(kSearched, kFromHere, {-1, 0, 0, 0}, {}, IsFreeOfWall, [] { return false; });
  ASSERT_TRUE(found.ok());
  EXPECT_EQ(found->waypoints.size(), 2u);
}

TEST(JointSearch, EndsWithoutAPathOrWithTheErrorOfACheck) {
  const auto closed = SearchJoints(
      kSearched, kFromHere, kToThere, {.most_checks = 200},
      [](const Configuration& a, const Configuration& b) -> absl::StatusOr<bool> {
        return a[0] * b[0] > 0;
      },
      [] { return false; });
  ASSERT_TRUE(closed.ok());
  EXPECT_TRUE(closed->waypoints.empty());
  const auto failed = SearchJoints(
      kSearched, kFromHere, kToThere, {},
      [](const Configuration&, const Configuration&) -> absl::StatusOr<bool> {
        return absl::UnavailableError("gone");
      },
      [] { return false; });
  EXPECT_TRUE(absl::IsUnavailable(failed.status()));
  EXPECT_TRUE(absl::IsAborted(SearchJoints(kSearched, kFromHere, kToThere, {}, IsFreeOfWall, [] {
                                return true;
                              }).status()));
}

}  // namespace
}  // namespace silhouette
