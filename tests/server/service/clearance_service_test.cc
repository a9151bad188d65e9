// SPDX-License-Identifier: Apache-2.0
// Clearances as planners meet them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct ClearanceService : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database = NewDatabase({.calibration = TestCalibration()});
  TestServer server{database};

  v1::Verdict Measured(const Configuration& q, const v1::Policy& policy = {}) {
    return server.Check({q}, policy, true).verdicts(0);
  }
};

// HighBlock(3) is two pixels above the foot; beside it, the post at a = 2 reaches it from b = 4 on
// and ends a pixel below at b = 0.
TEST_F(ClearanceService, IsTheDistanceInTheImages) {
  server.Publish(SceneWithHighBlock(3));
  EXPECT_EQ(Measured(At(0, 0)).clearance(), 2);
  EXPECT_EQ(Measured(At(2, 0)).clearance(), 1);
  const v1::Verdict touching = Measured(At(2, 4));
  EXPECT_EQ(touching.state(), v1::Verdict::STATE_FREE);
  EXPECT_TRUE(touching.has_clearance());
  EXPECT_EQ(touching.clearance(), 0);
  EXPECT_EQ(Measured({1.5, At(0, 0)[1]}).clearance(), 1) << "the nearer corner's";
  ASSERT_EQ(touching.views_size(), 3);
  for (const v1::ViewEvidence& view : touching.views()) EXPECT_EQ(view.distance(), 0);
}

TEST_F(ClearanceService, IsNoneIfOccupiedAndInfiniteIfNothingIsSeen) {
  server.Publish(SceneWithBlock(3));
  const v1::Verdict occupied = Measured(At(3, 0));
  EXPECT_EQ(occupied.state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_TRUE(occupied.has_clearance());
  EXPECT_EQ(occupied.clearance(), 0);
  server.Publish(EmptyCellScene());
  EXPECT_EQ(Measured(At(3, 0)).clearance(), kInfinity);
}

TEST_F(ClearanceService, CountsAsManyViewsAsThePolicy) {
  SceneInput input = SceneWithHighBlock(3);
  input.views[2].image = SceneMask{RobotMask(2, 0, 0)};  // "top" sees no block
  server.Publish(input);
  v1::Policy all;
  all.set_min_views(3);
  EXPECT_EQ(Measured(At(0, 0)).clearance(), 2);
  EXPECT_EQ(Measured(At(0, 0), all).clearance(), kInfinity);
}

TEST_F(ClearanceService, IsToldOnlyIfAskedFor) {
  server.Publish(SceneWithHighBlock(3));
  const v1::Verdict verdict = server.CheckOne(At(0, 0));
  EXPECT_FALSE(verdict.has_clearance());
  EXPECT_FALSE(verdict.views(0).has_distance());
  const v1::CheckPathResponse path = server.Path({At(0, 0), At(2, 0)});
  EXPECT_FALSE(path.verdict().has_clearance());
  EXPECT_FALSE(path.has_narrowest());
}

TEST_F(ClearanceService, IsToldWithoutEvidenceToo) {
  server.Publish(SceneWithHighBlock(3));
  v1::CheckConfigurationsRequest request;
  Set(At(2, 0), request.add_configurations());
  request.set_omit_evidence(true);
  request.set_include_clearance(true);
  v1::CheckConfigurationsResponse response;
  ASSERT_TRUE(server.Call(request, &response).ok());
  EXPECT_EQ(response.verdicts(0).views_size(), 0);
  EXPECT_EQ(response.verdicts(0).clearance(), 1);
}

TEST_F(ClearanceService, IsTheSmallestOnAFreePathWithItsPlace) {
  server.Publish(SceneWithHighBlock(3));
  const v1::CheckPathResponse path = server.Path({At(0, 0), At(2, 0), At(0, 0)}, true);
  EXPECT_EQ(path.verdict().state(), v1::Verdict::STATE_FREE);
  EXPECT_EQ(path.verdict().clearance(), 1);
  ASSERT_TRUE(path.has_narrowest());
  EXPECT_EQ(path.narrowest().segment(), 0);
  EXPECT_EQ(path.narrowest().fraction(), 0.75) << "in the first cell that has the corner";
  EXPECT_EQ(path.narrowest().configuration().positions(0), 1.5);
  EXPECT_EQ(path.narrowest().configuration().positions_size(), 2);
}

TEST_F(ClearanceService, OfAPathThatIsNotFreeHasNoPlaceOfItsOwn) {
  server.Publish(SceneWithBlock(3));
  const v1::CheckPathResponse path = server.Path({At(0, 0), At(4, 0)}, true);
  EXPECT_EQ(path.verdict().state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_TRUE(path.verdict().has_clearance());
  EXPECT_EQ(path.verdict().clearance(), 0);
  EXPECT_FALSE(path.has_narrowest());
  EXPECT_TRUE(path.verdict().views(0).has_distance());
}

TEST_F(ClearanceService, IsOfferedUnderEveryPresetThatIsServed) {
  server.Publish(SceneWithHighBlock(3));
  const v1::GetDatabaseResponse described = server.GetDatabase();
  ASSERT_EQ(described.presets_size(), 4);
  for (const std::string& preset : described.presets()) {
    for (int a = 0; a < 5; ++a) {
      const v1::Verdict verdict = Measured(At(a, 0), PolicyNamed(preset));
      EXPECT_NE(verdict.state(), v1::Verdict::STATE_UNKNOWN);
      EXPECT_TRUE(verdict.has_clearance()) << preset;
      const bool occupied = verdict.state() == v1::Verdict::STATE_OCCUPIED;
      EXPECT_TRUE(!occupied || verdict.clearance() == 0);
    }
  }
}

// Pixels in the region are unknown: they do not count.
TEST_F(ClearanceService, OfEverySceneAndRegionIsItsOwn) {
  server.Publish(SceneWithHighBlock(3));
  EXPECT_EQ(Measured(At(2, 0)).clearance(), 1);
  server.Allow("part", 3, absl::Seconds(10), HighBlock);
  const v1::CheckConfigurationsResponse allowed = server.Check({At(2, 0)}, {}, true);
  EXPECT_EQ(allowed.verdicts(0).clearance(), kInfinity);
  EXPECT_THAT(allowed.basis().regions(), ::testing::ElementsAre("part"));
  server.Publish(SceneWithHighBlock(4));
  EXPECT_EQ(Measured(At(2, 0)).clearance(), 2) << "another block, beside the region";
}

// A margin is in the planes already.
TEST(ClearanceWithMargin, IsMeasuredFromTheMarginOn) {
  TestServer plain(NewDatabase());
  TestServer margin(NewDatabase({}, {.margin = 0}, WithMargins({.pixels = 1})));
  for (TestServer* server : {&plain, &margin}) server->Publish(SceneWithHighBlock(3));
  EXPECT_EQ(plain.Check({At(0, 0)}, {}, true).verdicts(0).clearance(), 2);
  EXPECT_EQ(margin.Check({At(0, 0)}, {}, true).verdicts(0).clearance(), 1);
}

}  // namespace
}  // namespace silhouette
