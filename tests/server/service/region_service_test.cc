// SPDX-License-Identifier: Apache-2.0
// Allowed regions and ignored pixels as planners meet them: what is told, and for how long.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "common/picture/palette.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

ServingSettings Patient() {
  ServingSettings settings;
  settings.scene.max_age = absl::Hours(1);
  return settings;
}

class RegionService : public testing::Test {
 protected:
  grpc::Status Allow(const v1::AllowRegionRequest& request, v1::AllowedRegion* region = nullptr) {
    v1::AllowRegionResponse response;
    const grpc::Status status =
        server.Call(&v1::SceneService::Stub::AllowRegion, request, &response);
    if (region != nullptr) *region = response.region();
    return status;
  }
  void AllowAt(int a, absl::Duration duration = absl::Seconds(10)) {
    server.Allow("part", a, duration);
  }
  bool Revoke(const std::string& name) {
    v1::RevokeRegionRequest request;
    request.set_name(name);
    return server.Ask(&v1::SceneService::Stub::RevokeRegion, request).was_in_force();
  }
  std::vector<v1::AllowedRegion> List() {
    const v1::ListAllowedRegionsResponse response =
        server.Ask(&v1::SceneService::Stub::ListAllowedRegions, v1::ListAllowedRegionsRequest());
    return {response.regions().begin(), response.regions().end()};
  }
  // Whether the configuration space has grid point (a, b) free.
  bool FreeInSpace(int a, int b) {
    const ConfigurationNumber number = database->grid().NumberOf({a, b});
    for (const auto& message : server.Space()) {
      for (const v1::ConfigurationSpaceTile& tile : message.tiles()) {
        if (tile.tile() != number / kTileSize) continue;
        const size_t place = number % kTileSize;
        return (static_cast<uint8_t>(tile.free()[place / 8]) >> (place % 8) & 1) != 0;
      }
    }
    return false;
  }
  v1::Verdict::State State(int a) { return server.CheckOne(At(a, 0)).state(); }

  const std::shared_ptr<const ServedDatabase> database = NewDatabase();
  TestServer server{database, Patient()};
};

TEST_F(RegionService, EveryReplyThatARegionTouchedNamesIt) {
  server.Publish(SceneWithBlock(3));
  AllowAt(3);
  const v1::CheckConfigurationsResponse batch = server.Check({At(1, 0), At(3, 0), {2.5, 0.1}});
  EXPECT_THAT(batch.basis().regions(), ElementsAre("part"));
  EXPECT_THAT(batch.verdicts(0).regions(), IsEmpty()) << "the robot is elsewhere";
  EXPECT_THAT(batch.verdicts(1).regions(), ElementsAre("part"));
  EXPECT_EQ(batch.verdicts(1).state(), v1::Verdict::STATE_FREE);
  EXPECT_THAT(batch.verdicts(2).regions(), ElementsAre("part")) << "at a corner of its cell";
  const v1::CheckPathResponse through = server.Path({At(1, 0), At(4, 0)});
  EXPECT_EQ(through.verdict().state(), v1::Verdict::STATE_FREE);
  EXPECT_THAT(through.verdict().regions(), ElementsAre("part"));
  EXPECT_THAT(server.Path({At(0, 0), At(1, 0)}).verdict().regions(), IsEmpty());
  EXPECT_THAT(server.Explain(At(3, 0)).verdict().regions(), ElementsAre("part"));
  EXPECT_THAT(server.Space().at(0).basis().regions(), ElementsAre("part"));
  // Without an effect on the scene there is nothing to tell.
  server.Publish(EmptyCellScene());
  EXPECT_THAT(server.Check({At(3, 0)}).basis().regions(), IsEmpty());
}

TEST_F(RegionService, AnExpiredOrRevokedRegionIsNoLongerInForceAnywhere) {
  server.Publish(SceneWithBlock(3));
  const auto expect = [&](bool free) {
    EXPECT_EQ(State(3), free ? v1::Verdict::STATE_FREE : v1::Verdict::STATE_OCCUPIED);
    EXPECT_EQ(FreeInSpace(3, 0), free) << "a map of other regions was served";
    EXPECT_EQ(server.Path({At(1, 0), At(3, 0)}).verdict().state(),
              free ? v1::Verdict::STATE_FREE : v1::Verdict::STATE_OCCUPIED);
    EXPECT_EQ(List().size(), free ? 1u : 0u);
  };
  expect(false);
  AllowAt(3);
  expect(true);
  server.clock.Advance(absl::Seconds(10));
  expect(false);
  AllowAt(3);
  expect(true);
  EXPECT_TRUE(Revoke("part"));
  expect(false);
  EXPECT_FALSE(Revoke("part"));
}

TEST_F(RegionService, IsListedWithItsPixelsAndTheTimeLeft) {
  EXPECT_THAT(List(), IsEmpty());
  AllowAt(3);
  server.clock.Advance(absl::Seconds(4));
  const std::vector<v1::AllowedRegion> regions = List();
  ASSERT_EQ(regions.size(), 1u);
  EXPECT_EQ(regions[0].name(), "part");
  EXPECT_EQ(regions[0].remaining().seconds(), 6);
  EXPECT_EQ(regions[0].end_time().seconds(), 1'000'010);
  ASSERT_EQ(regions[0].views_size(), 3);
  EXPECT_EQ(regions[0].views(2).view(), "top");
  EXPECT_EQ(regions[0].views(2).mask().bits(), [] {
    v1::Mask mask;
    Set(Block(2, 3), &mask);
    return mask.bits();
  }());
}

TEST_F(RegionService, MayBeAPolygon) {
  server.Publish(SceneWithBlock(3));
  v1::AllowRegionRequest request;
  request.set_name("part");
  request.mutable_duration()->set_seconds(10);
  for (int view = 0; view < 3; ++view) {
    v1::RegionPixels& pixels = *request.add_views();
    pixels.set_view(kViewNames[static_cast<size_t>(view)]);
    const double below = kViewSizes[static_cast<size_t>(view)].height - 0.5;
    for (const auto& [x, y] : {std::pair(5.5, 0.0), {8.0, 0.0}, {8.0, below}, {5.5, below}}) {
      v1::Point& corner = *pixels.mutable_polygon()->add_corners();
      corner.set_x(x);
      corner.set_y(y);
    }
  }
  v1::AllowedRegion region;
  ASSERT_TRUE(Allow(request, &region).ok());
  EXPECT_EQ(region.views(0).mask().width(), kViewSizes[0].width);
  EXPECT_EQ(State(3), v1::Verdict::STATE_FREE);
}

TEST_F(RegionService, WhatCannotBeARegionIsRefusedAndChangesNothing) {
  server.Publish(SceneWithBlock(3));
  const auto refusal = [&](const v1::AllowRegionRequest& request) {
    const grpc::Status status = Allow(request);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    return status.error_message();
  };
  const v1::AllowRegionRequest good = RegionAt("part", 3, absl::Seconds(10));
  v1::AllowRegionRequest bad = good;
  bad.mutable_views(1)->set_view("back");
  EXPECT_THAT(refusal(bad), HasSubstr("views[1] 'back': the cell has no such view"));
  bad.mutable_views(1)->set_view("left");
  EXPECT_THAT(refusal(bad), HasSubstr("views[1] 'left': the view is given twice"));
  bad = good;
  bad.mutable_views(2)->clear_mask();
  EXPECT_THAT(refusal(bad), HasSubstr("one of mask and polygon"));
  Set(Mask({3, 3}), bad.mutable_views(2)->mutable_mask());
  EXPECT_THAT(refusal(bad), HasSubstr("views[2] 'top'.mask: it is 3x3, and should be 10x10"));
  bad.mutable_views(2)->mutable_polygon()->add_corners();
  EXPECT_THAT(refusal(bad), HasSubstr("3 to 1000 corners"));
  bad = good;
  bad.clear_duration();
  EXPECT_THAT(refusal(bad), HasSubstr("duration"));
  bad.mutable_duration()->set_seconds(std::numeric_limits<int64_t>::max());
  EXPECT_THAT(refusal(bad), HasSubstr("at most 10 min"));
  bad = good;
  bad.clear_views();
  EXPECT_THAT(refusal(bad), HasSubstr("no pixel"));
  EXPECT_EQ(State(3), v1::Verdict::STATE_OCCUPIED);
  EXPECT_THAT(List(), IsEmpty());
}

TEST_F(RegionService, EndsWithItsDatabase) {
  AllowAt(3);
  server.server->ReplaceDatabase(NewDatabase());
  server.Publish(SceneWithBlock(3));
  EXPECT_EQ(State(3), v1::Verdict::STATE_OCCUPIED);
}

TEST_F(RegionService, HasItsOwnColourInThePicturesOfExplain) {
  server.Publish(SceneWithBlock(3));
  AllowAt(3);
  const std::string png = server.Explain(At(3, 0)).views(0).obstacle_png();
  const cv::Mat picture =
      cv::imdecode(std::vector<uint8_t>(png.begin(), png.end()), cv::IMREAD_COLOR);
  const Mask block = Block(0, 3);
  for (int y = 0; y < block.height(); ++y) {
    for (int x = 0; x < block.width(); ++x) {
      const cv::Vec3b pixel = picture.at<cv::Vec3b>(y, x);
      const Colour colour{pixel[2], pixel[1], pixel[0]};
      EXPECT_EQ(colour == palette::kAllowed, block.at(x, y)) << x << ", " << y;
    }
  }
}

TEST(TreatmentService, TellsMarginsAndIgnoredPixelsOfDatabaseAndScene) {
  TreatmentSettings treatments = Ignoring(1, Block(1, 3));
  treatments.views[2].margin.pixels = 1.5;
  TestServer server(NewDatabase({}, {}, treatments));
  const v1::GetDatabaseResponse database = server.GetDatabase();
  EXPECT_EQ(database.views(0).ignored_pixels(), 0u);
  EXPECT_EQ(database.views(1).ignored_pixels(), 4u);
  EXPECT_EQ(database.views(2).margin(), 1.5);
  const v1::Scene scene = server.Publish(EmptyCellScene());
  EXPECT_EQ(scene.views(1).ignored_pixels(), 4u);
  EXPECT_EQ(scene.views(1).margin(), 0);
  EXPECT_EQ(scene.views(2).margin(), 1.5);
  v1::GetSceneRequest request;
  request.set_include_planes(true);
  const v1::GetSceneResponse response = server.Ask(&v1::SceneService::Stub::GetScene, request);
  EXPECT_TRUE(response.scene().views(1).has_ignored());
  EXPECT_FALSE(response.scene().views(0).has_ignored());
}

TEST(TreatmentService, AfterADatabaseWhoseMarginsAreNotKnownNothingIsFree) {
  TestServer server(NewDatabase());
  server.Publish(EmptyCellScene());
  EXPECT_EQ(server.CheckOne(At(1, 0)).state(), v1::Verdict::STATE_FREE);
  server.server->ReplaceDatabase(NewDatabase({}, {}, WithMargins({.metres = 0.05})));
  const v1::Scene scene = server.Publish(EmptyCellScene());
  ASSERT_EQ(scene.defects_size(), 1);
  EXPECT_EQ(scene.defects(0).reason(), v1::Verdict::REASON_MARGIN_UNKNOWN);
  EXPECT_THAT(scene.defects(0).message(), HasSubstr("needs the camera models"));
  EXPECT_EQ(server.CheckOne(At(1, 0)).reason(), v1::Verdict::REASON_MARGIN_UNKNOWN);
  EXPECT_EQ(server.Space().at(0).unknown_reason(), v1::Verdict::REASON_MARGIN_UNKNOWN);
}

}  // namespace
}  // namespace silhouette
