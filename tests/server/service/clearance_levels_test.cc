// SPDX-License-Identifier: Apache-2.0
// The whole configuration space in clearance levels, as planners meet it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

const std::vector<double> kLevels = {0, 0.5, 1, 1.3, 2, 3, 1000};

v1::GetConfigurationSpaceRequest ClearanceLevelsAsking(const std::vector<double>& levels,
                                                       const v1::Policy& policy = {}) {
  v1::GetConfigurationSpaceRequest request;
  *request.mutable_policy() = policy;
  request.mutable_clearance_levels()->Add(levels.begin(), levels.end());
  return request;
}

bool BitOf(const std::string& bytes, ConfigurationNumber number) {
  return (static_cast<uint8_t>(bytes.at(number / 8)) >> (number % 8) & 1) != 0;
}

// A grid with fewer than 4096 configurations has one tile.
v1::ConfigurationSpaceTile TileOf(TestServer& server, const v1::Policy& policy = {}) {
  const auto messages = server.Space(ClearanceLevelsAsking(kLevels, policy));
  EXPECT_EQ(messages.size(), 1u);
  EXPECT_EQ(messages.at(0).tiles_size(), 1);
  EXPECT_EQ(messages.at(0).tiles(0).clearances_size(), static_cast<int>(kLevels.size()));
  return messages.at(0).tiles(0);
}

// Compares all levels of all configurations with what CheckConfigurations tells of each. Returns
// how many of them are above a level.
int ExpectAsMeasuredSingly(TestServer& server, const v1::Policy& policy = {}) {
  int above = 0;
  const ConfigurationGrid grid = *GridOf(ServerTestCell());
  const v1::ConfigurationSpaceTile tile = TileOf(server, policy);
  std::vector<Configuration> all;
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) all.push_back(At(a, b));
  }
  const v1::CheckConfigurationsResponse checks = server.Check(all, policy, true);
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      const v1::Verdict& verdict = checks.verdicts(8 * a + b);
      const bool free = verdict.state() == v1::Verdict::STATE_FREE;
      const ConfigurationNumber number = grid.NumberOf({a, b});
      EXPECT_EQ(BitOf(tile.free(), number), free);
      for (size_t i = 0; i < kLevels.size(); ++i) {
        const bool is_above = free && verdict.clearance() > kLevels[i];
        EXPECT_EQ(BitOf(tile.clearances(static_cast<int>(i)), number), is_above)
            << policy.preset() << " at " << a << ", " << b << ": " << verdict.clearance();
        above += is_above ? 1 : 0;
      }
    }
  }
  for (const std::string& bits : tile.clearances()) {
    EXPECT_EQ(bits.size(), kTileSize / 8);
    for (ConfigurationNumber number = 0; number < kTileSize; ++number) {
      EXPECT_FALSE(BitOf(bits, number) && !grid.Contains(number));
    }
  }
  return above;
}

TEST(ClearanceLevels, AreAsMeasuredSinglyUnderEveryPresetWithAndWithoutAnIndex) {
  for (const bool index : {false, true}) {
    TestServer server(NewDatabase({.missing = {{0, 7}},
                                   .excluded = {{4, 7}},
                                   .corrupt = {{2, 7}},
                                   .index = index,
                                   .calibration = TestCalibration()}));
    for (const char* preset : {"uncalibrated", "paper", "calibrated", "paper-calibrated"}) {
      int above = 0;
      for (const SceneInput& scene :
           {SceneWithHighBlock(3), SceneWithBlock(2, 2), EmptyCellScene()}) {
        server.Publish(scene);
        v1::Policy policy = PolicyNamed(preset);
        above += ExpectAsMeasuredSingly(server, policy);
        policy.set_min_views(1);
        above += ExpectAsMeasuredSingly(server, policy);
      }
      EXPECT_GT(above, 0) << preset;
    }
  }
}

TEST(ClearanceLevels, ViewThatIsMissingLeavesNothingAbove) {
  TestServer server(NewDatabase({.index = true}));
  SceneInput input = SceneWithHighBlock(3);
  input.views.pop_back();
  server.Publish(input);
  EXPECT_EQ(ExpectAsMeasuredSingly(server), 0);
}

TEST(ClearanceLevels, IgnoredPixelsAndMarginsAreAsInSingleClearances) {
  for (const TreatmentSettings& treatments :
       {WithMargins({.pixels = 1}), Ignoring(1, HighBlock(1, 3))}) {
    TestServer server(NewDatabase({.index = true}, {.margin = 0}, treatments));
    server.Publish(SceneWithHighBlock(3));
    EXPECT_GT(ExpectAsMeasuredSingly(server), 0);
  }
}

TEST(ClearanceLevels, AllowedRegionIsAsInSingleClearances) {
  TestServer server(NewDatabase({.index = true}));
  server.Publish(SceneWithHighBlock(3));
  const int before = ExpectAsMeasuredSingly(server);
  server.Allow("part", 3, absl::Seconds(10), HighBlock);
  EXPECT_GT(ExpectAsMeasuredSingly(server), before);
  server.clock.Advance(absl::Seconds(11));
  server.Publish(SceneWithHighBlock(3));
  EXPECT_EQ(ExpectAsMeasuredSingly(server), before) << "the region has ended";
}

TEST(ClearanceLevels, AreThoseOfTheNewestScene) {
  TestServer server(NewDatabase({.index = true}));
  server.Publish(SceneWithHighBlock(3));
  const v1::ConfigurationSpaceTile first = TileOf(server);
  server.Publish(EmptyCellScene());
  const v1::ConfigurationSpaceTile empty = TileOf(server);
  EXPECT_NE(first.clearances(1), empty.clearances(1));
  for (const std::string& bits : empty.clearances()) EXPECT_EQ(bits, empty.free());
}

TEST(ClearanceLevels, AreNotToldIfNobodyAsks) {
  TestServer server(NewDatabase());
  server.Publish(SceneWithHighBlock(3));
  EXPECT_EQ(server.Space()[0].tiles(0).clearances_size(), 0);
}

TEST(ClearanceLevels, OfASceneThatCannotBeRestedOnAreNotSent) {
  TestServer server(NewDatabase());
  EXPECT_EQ(server.Space(ClearanceLevelsAsking(kLevels))[0].tiles_size(), 0) << "no scene";
  server.Publish(SceneWithHighBlock(3));
  server.clock.Advance(absl::Hours(1));
  const auto stale = server.Space(ClearanceLevelsAsking(kLevels));
  EXPECT_EQ(stale[0].tiles_size(), 0);
  EXPECT_EQ(stale[0].unknown_reason(), v1::Verdict::REASON_SCENE_STALE);
}

TEST(ClearanceLevels, TilesWithoutThemWhenTheTimeIsOverAreLeftOut) {
  TestServer server(NewDatabase());
  server.Publish(SceneWithHighBlock(3));
  ASSERT_EQ(server.Space()[0].tiles_size(), 1) << "the verdicts are there";
  v1::GetConfigurationSpaceRequest request = ClearanceLevelsAsking(kLevels);
  request.mutable_max_time();
  const auto messages = server.Space(request);
  EXPECT_EQ(messages[0].tiles_size(), 0);
  EXPECT_EQ(messages[0].tiles_left_out(), 1u);
  TileOf(server);
  EXPECT_EQ(server.Space(request)[0].tiles_size(), 1) << "done for another request";
}

TEST(ClearanceLevels, ThatCannotBeAreRefused) {
  TestServer server(NewDatabase());
  const auto message_for = [&](const std::vector<double>& levels) {
    std::vector<v1::GetConfigurationSpaceResponse> messages;
    const grpc::Status status = server.Call(ClearanceLevelsAsking(levels), &messages);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    return status.error_message();
  };
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double level : {-1.0, infinity, std::nan("")}) {
    EXPECT_EQ(message_for({level}),
              "clearance_levels: a clearance level must be finite, and 0 or more");
  }
  EXPECT_EQ(message_for({1, 1}), "clearance_levels: clearance levels must ascend");
  EXPECT_EQ(message_for({2, 1}), "clearance_levels: clearance levels must ascend");
  std::vector<double> many;
  for (int i = 0; i < 17; ++i) many.push_back(i);
  EXPECT_EQ(message_for(many), "clearance_levels: there are 17; ask for at most 16");
}

}  // namespace
}  // namespace silhouette
