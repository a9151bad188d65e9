// SPDX-License-Identifier: Apache-2.0
#include "server/scene/allowed_regions.h"

#include <gmock/gmock.h>

#include <limits>
#include <set>

#include "server/scene/checker.h"
#include "server/scene/scene_store.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Moment AllowedRegionsAfter(absl::Duration duration) {
  return {absl::FromUnixSeconds(1'000'000) + duration, absl::Seconds(50) + duration};
}
const Moment kAllowedRegionsNow = AllowedRegionsAfter(absl::ZeroDuration());

std::vector<std::optional<Mask>> BlockPixels(int a, int views = 3) {
  std::vector<std::optional<Mask>> pixels(3);
  for (int view = 0; view < views; ++view) pixels[static_cast<size_t>(view)] = Block(view, a);
  return pixels;
}

class AllowedRegionTest : public testing::Test {
 protected:
  void Publish(const SceneInput& input, const Moment& now = kAllowedRegionsNow) {
    absl::StatusOr<Scene> scene = MakeScene(*database_, input, {}, {}, now);
    ASSERT_TRUE(scene.ok()) << scene.status();
    ASSERT_TRUE(store_.Publish(*std::move(scene), database_).ok());
  }

  absl::Status Allow(const std::string& name, std::vector<std::optional<Mask>> pixels,
                     absl::Duration duration, const Moment& now = kAllowedRegionsNow) {
    return store_.Allow(name, std::move(pixels), duration, now, database_).status();
  }

  Checker CheckerAt(const Moment& now = kAllowedRegionsNow, const Policy& policy = {}) {
    return Checker(store_.Newest(now), policy, {.max_age = absl::Hours(1)}, now);
  }

  const std::shared_ptr<const ServedDatabase> database_ = NewDatabase();
  SceneStore store_{database_};
};

TEST_F(AllowedRegionTest, ObstacleInItNoLongerShowsAndTheVerdictNamesTheRegion) {
  Publish(SceneWithBlock(3));
  ASSERT_EQ(CheckerAt().Check(At(3, 0)).state(), State::kOccupied);
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  const Checker checker = CheckerAt();
  EXPECT_TRUE(checker.Check(At(3, 0)).free());
  EXPECT_THAT(checker.RegionsAt(At(3, 0)), ElementsAre("part"));
  EXPECT_THAT(checker.RegionsAt(At(1, 0)), IsEmpty()) << "the robot is elsewhere";
  EXPECT_THAT(RegionsIn(checker.served(), {}), ElementsAre("part"));
  std::vector<ViewEvidence> evidence(3);
  checker.Check(At(3, 0), evidence);
  EXPECT_EQ(evidence[0].obstacle_pixels, 0u);
  EXPECT_GT(evidence[0].unknown_pixels, 0u) << "it proves nothing";
}

TEST_F(AllowedRegionTest, ObstacleBesideItIsStillFound) {
  Publish(SceneWithBlock(3));
  ASSERT_TRUE(Allow("part", BlockPixels(2), absl::Seconds(10)).ok());
  const Checker checker = CheckerAt();
  EXPECT_EQ(checker.Check(At(3, 0)).state(), State::kOccupied);
  EXPECT_THAT(checker.RegionsAt(At(3, 0)), IsEmpty());
  EXPECT_THAT(RegionsIn(checker.served(), {}), IsEmpty());
}

TEST_F(AllowedRegionTest, IsNotInForceFromItsEndOn) {
  Publish(SceneWithBlock(3));
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  EXPECT_TRUE(CheckerAt(AllowedRegionsAfter(absl::Milliseconds(9999))).Check(At(3, 0)).free());
  EXPECT_EQ(CheckerAt(AllowedRegionsAfter(absl::Seconds(10))).Check(At(3, 0)).state(),
            State::kOccupied);
  EXPECT_THAT(store_.Newest(AllowedRegionsAfter(absl::Seconds(10))).regions->regions, IsEmpty());
}

TEST_F(AllowedRegionTest, WallClockThatStepsBackDoesNotProlongIt) {
  Publish(SceneWithBlock(3));
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  Moment later = AllowedRegionsAfter(absl::Seconds(11));
  later.time = kAllowedRegionsNow.time - absl::Hours(1);
  EXPECT_THAT(store_.Newest(later).regions->regions, IsEmpty());
}

TEST_F(AllowedRegionTest, IsReplacedByOneOfItsNameAndRevoked) {
  Publish(SceneWithBlock(3));
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  ASSERT_TRUE(Allow("part", BlockPixels(1), absl::Seconds(10)).ok());
  EXPECT_EQ(CheckerAt().Check(At(3, 0)).state(), State::kOccupied);
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  EXPECT_TRUE(CheckerAt().Check(At(3, 0)).free());
  EXPECT_FALSE(store_.Revoke("other", kAllowedRegionsNow));
  EXPECT_TRUE(store_.Revoke("part", kAllowedRegionsNow));
  EXPECT_EQ(CheckerAt().Check(At(3, 0)).state(), State::kOccupied);
  EXPECT_FALSE(store_.Revoke("part", kAllowedRegionsNow));
}

TEST_F(AllowedRegionTest, HoldsForScenesThatComeLaterToo) {
  Publish(EmptyCellScene());
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  EXPECT_THAT(CheckerAt().RegionsAt(At(3, 0)), IsEmpty()) << "nothing is there yet";
  Publish(SceneWithBlock(3));
  EXPECT_TRUE(CheckerAt().Check(At(3, 0)).free());
  EXPECT_EQ(store_.Find(0)->obstacle_images[0]->obstacle(), Block(0, 3))
      << "the scene as it was published";
}

TEST_F(AllowedRegionTest, OverlappingRegionsAreAllNamed) {
  Publish(SceneWithBlock(3));
  ASSERT_TRUE(Allow("b", BlockPixels(3), absl::Seconds(10)).ok());
  ASSERT_TRUE(Allow("a", BlockPixels(3, 1), absl::Seconds(10)).ok());
  EXPECT_THAT(CheckerAt().RegionsAt(At(3, 0)), ElementsAre("a", "b"));
}

TEST_F(AllowedRegionTest, MakesNothingFreeThatIsUnknown) {
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Minutes(5)).ok());
  EXPECT_EQ(CheckerAt().Check(At(3, 0)).reason(), Reason::kNoScene);
  SceneInput lacking = SceneWithBlock(3);
  lacking.views.pop_back();
  Publish(lacking);
  EXPECT_FALSE(CheckerAt().Check(At(3, 0)).free());
  Publish(SceneWithBlock(3), AllowedRegionsAfter(absl::Seconds(1)));
  const Moment stale = AllowedRegionsAfter(absl::Minutes(2));
  EXPECT_EQ(Checker(store_.Newest(stale), {}, {}, stale).Check(At(3, 0)).reason(),
            Reason::kSceneStale);
}

TEST_F(AllowedRegionTest, GoesWithItsDatabase) {
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  store_.ReplaceDatabase(NewDatabase());
  EXPECT_THAT(store_.Newest(kAllowedRegionsNow).regions->regions, IsEmpty());
  EXPECT_TRUE(absl::IsAborted(Allow("part", BlockPixels(3), absl::Seconds(10))));
}

TEST_F(AllowedRegionTest, WhatCannotBeARegionIsRefused) {
  const auto message = [&](const std::string& name, std::vector<std::optional<Mask>> pixels,
                           absl::Duration duration) {
    const absl::Status status = Allow(name, std::move(pixels), duration);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    return std::string(status.message());
  };
  EXPECT_THAT(message("", BlockPixels(3), absl::Seconds(1)), HasSubstr("a name of 1 to 64"));
  EXPECT_THAT(message("two\nlines", BlockPixels(3), absl::Seconds(1)), HasSubstr("printable"));
  EXPECT_THAT(message(std::string(65, 'x'), BlockPixels(3), absl::Seconds(1)), HasSubstr("name"));
  EXPECT_THAT(message("part", BlockPixels(3), absl::ZeroDuration()), HasSubstr("duration"));
  EXPECT_THAT(message("part", BlockPixels(3), absl::Minutes(11)), HasSubstr("at most 10 min"));
  EXPECT_THAT(message("part", BlockPixels(3, 0), absl::Seconds(1)), HasSubstr("no pixel"));
  for (size_t i = 0; i < AllowedRegions::kMost; ++i) {
    ASSERT_TRUE(Allow("region " + std::to_string(i), BlockPixels(3), absl::Seconds(1)).ok());
  }
  EXPECT_TRUE(absl::IsResourceExhausted(Allow("one more", BlockPixels(3), absl::Seconds(1))));
  EXPECT_TRUE(
      Allow("one more", BlockPixels(3), absl::Seconds(1), AllowedRegionsAfter(absl::Seconds(2)))
          .ok())
      << "the others have ended";
}

// A store with a margin of half a pixel and a block above the foot.
struct RegionWithMargin : testing::Test {
  std::shared_ptr<const ServedDatabase> database =
      NewDatabase({}, {}, WithMargins({.pixels = 0.5}));
  SceneStore store{database};

  void SetUp() override {
    absl::StatusOr<Scene> scene =
        MakeScene(*database, SceneWithHighBlock(3), {}, {}, kAllowedRegionsNow);
    ASSERT_TRUE(store.Publish(*std::move(scene), database).ok());
  }
  Checker CheckerWithRegionAround(int a) {
    std::vector<std::optional<Mask>> pixels;
    for (int view = 0; view < 3; ++view) pixels.emplace_back(HighBlock(view, a));
    EXPECT_TRUE(store.Allow("part", pixels, absl::Seconds(10), kAllowedRegionsNow, database).ok());
    return Checker(store.Newest(kAllowedRegionsNow), {}, {}, kAllowedRegionsNow);
  }
};

TEST_F(RegionWithMargin, TakesTheMarginOfItsPartAwayAndIsNamedThere) {
  ASSERT_EQ(
      Checker(store.Newest(kAllowedRegionsNow), {}, {}, kAllowedRegionsNow).Check(At(2, 7)).state(),
      State::kOccupied);
  const Checker checker = CheckerWithRegionAround(3);
  EXPECT_TRUE(checker.Check(At(2, 7)).free()) << "beside the part";
  EXPECT_THAT(checker.RegionsAt(At(2, 7)), ElementsAre("part"));
  EXPECT_THAT(checker.RegionsAt(At(1, 7)), IsEmpty());
}

TEST_F(RegionWithMargin, DoesNotCutTheMarginOfAnObstacleBesideIt) {
  const Checker checker = CheckerWithRegionAround(2);
  EXPECT_EQ(checker.Check(At(2, 7)).state(), State::kOccupied) << "the margin reaches into it";
  EXPECT_THAT(RegionsIn(checker.served(), {}), IsEmpty());
}

TEST_F(AllowedRegionTest, ThatEndsWhileAVerdictIsMadeTakesItBack) {
  Publish(SceneWithBlock(3));
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  const Checker checker = CheckerAt();
  const SceneSettings settings{.max_age = absl::Hours(1)};
  EXPECT_EQ(BlockedReason(checker.served(), settings, AllowedRegionsAfter(absl::Seconds(9))),
            Reason::kNone);
  EXPECT_EQ(BlockedReason(checker.served(), settings, AllowedRegionsAfter(absl::Seconds(10))),
            Reason::kRegionEnded);
}

TEST_F(AllowedRegionTest, ThatWasRevokedOrMovedIsKnownToBe) {
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  const auto taken = store_.Newest(kAllowedRegionsNow).regions;
  EXPECT_FALSE(store_.Revoked(*taken));
  ASSERT_TRUE(Allow("other", BlockPixels(1), absl::Seconds(10)).ok());
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(20)).ok());
  EXPECT_FALSE(store_.Revoked(*taken)) << "it only lasts longer";
  const auto longer = store_.Newest(kAllowedRegionsNow).regions;
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(1)).ok());
  EXPECT_TRUE(store_.Revoked(*longer)) << "it ends sooner";
  ASSERT_TRUE(Allow("part", BlockPixels(3, 2), absl::Seconds(20)).ok());
  EXPECT_TRUE(store_.Revoked(*taken));
  const auto moved = store_.Newest(kAllowedRegionsNow).regions;
  EXPECT_FALSE(store_.Revoked(*moved));
  EXPECT_TRUE(store_.Revoke("part", kAllowedRegionsNow));
  EXPECT_TRUE(store_.Revoked(*moved));
}

TEST_F(AllowedRegionTest, IsNamedForEveryPathThatLeadsThroughIt) {
  Publish(SceneWithBlock(3));
  ASSERT_TRUE(Allow("part", BlockPixels(3), absl::Seconds(10)).ok());
  const auto names = [&](const Configuration& from, const Configuration& to, bool free) {
    std::set<std::string> regions;
    const std::vector<Configuration> waypoints = {from, to};
    EXPECT_EQ(CheckerAt().CheckPath(waypoints, {}, &regions).verdict.free(), free);
    return regions;
  };
  EXPECT_THAT(names(At(0, 3), At(4, 3), true), ElementsAre("part")) << "in the middle of it";
  EXPECT_THAT(names(At(0, 3), At(1, 3), true), IsEmpty());
}

TEST_F(AllowedRegionTest, WhatHasEndedIsToldOnce) {
  ASSERT_TRUE(Allow("short", BlockPixels(3), absl::Seconds(1)).ok());
  ASSERT_TRUE(Allow("long", BlockPixels(3), absl::Seconds(10)).ok());
  EXPECT_THAT(store_.TakeEnded(kAllowedRegionsNow), IsEmpty());
  store_.Newest(AllowedRegionsAfter(absl::Seconds(2)));
  EXPECT_THAT(store_.TakeEnded(AllowedRegionsAfter(absl::Seconds(3))),
              ElementsAre(testing::Field(&AllowedRegion::name, "short")));
  store_.Revoke("long", AllowedRegionsAfter(absl::Seconds(3)));
  EXPECT_THAT(store_.TakeEnded(AllowedRegionsAfter(absl::Seconds(20))), IsEmpty())
      << "revoked, not ended";
}

TEST(PixelsInPolygon, AreThoseWhoseCentresItHolds) {
  const std::vector<std::pair<double, double>> triangle = {{0.5, 0.5}, {4.5, 0.5}, {0.5, 4.5}};
  const Mask mask = *PixelsInPolygon({6, 6}, triangle);
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 6; ++x) EXPECT_EQ(mask.at(x, y), x >= 1 && y >= 1 && x + y <= 5);
  }
  const std::vector<std::pair<double, double>> line = {{0, 0}, {1, 1}};
  EXPECT_TRUE(absl::IsInvalidArgument(PixelsInPolygon({6, 6}, line).status()));
  const std::vector<std::pair<double, double>> endless = {
      {0, 0}, {1, 1}, {0, std::numeric_limits<double>::infinity()}};
  EXPECT_TRUE(absl::IsInvalidArgument(PixelsInPolygon({6, 6}, endless).status()));
}

TEST(PixelsInPolygon, HasNoCornerOutsideTheMask) {
  const std::vector<std::pair<double, double>> all = {
      {-0.5, -0.5}, {95.5, -0.5}, {95.5, 71.5}, {-0.5, 71.5}};
  EXPECT_EQ(PixelsInPolygon({96, 72}, all)->Count(), 96u * 72);
  // Pixels of a camera image of 640 x 480.
  const std::vector<std::pair<double, double>> camera = {{50, 40}, {600, 40}, {600, 440}};
  EXPECT_EQ(PixelsInPolygon({96, 72}, camera).status(),
            absl::InvalidArgumentError(
                "the corner 600,40 is outside the view's mask: corners are pixels of the mask, "
                "which has 96x72, not of the camera's image"));
  for (const std::pair<double, double>& outside :
       {std::pair(96.0, 0.0), std::pair(0.0, 72.0), std::pair(-0.6, 0.0), std::pair(0.0, -1.0)}) {
    const std::vector<std::pair<double, double>> corners = {{0, 0}, {5, 5}, outside};
    EXPECT_TRUE(absl::IsInvalidArgument(PixelsInPolygon({96, 72}, corners).status()));
  }
}

}  // namespace
}  // namespace silhouette
