// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/picture/palette.h"
#include "server/service/answers.h"
#include "server/service/space_writer.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

struct CollisionServiceTest : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database = NewDatabase();
  TestServer server{database};

  std::string Refusal(const v1::CheckConfigurationsRequest& request) {
    v1::CheckConfigurationsResponse response;
    const grpc::Status status = server.Call(request, &response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    return status.error_message();
  }
  std::string Refusal(const v1::CheckPathRequest& request) {
    v1::CheckPathResponse response;
    const grpc::Status status = server.Call(request, &response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    return status.error_message();
  }
};

TEST_F(CollisionServiceTest, VerdictsComeInTheOrderAskedWithTheirBasis) {
  server.Publish(SceneWithBlock(3));
  server.clock.Advance(absl::Milliseconds(250));
  const auto response = server.Check({At(3, 0), At(1, 0), At(3, 1), {3.5, At(0, 0)[1]}});
  EXPECT_EQ(response.verdicts(0).state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(response.verdicts(1).state(), v1::Verdict::STATE_FREE);
  EXPECT_EQ(response.verdicts(2).state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(response.verdicts(3).state(), v1::Verdict::STATE_OCCUPIED) << "a corner is";
  EXPECT_EQ(response.basis().database_generation(), database->generation());
  EXPECT_EQ(response.basis().scene_id(), 1u);
  EXPECT_EQ(response.basis().scene_time().seconds(), 1'000'000);
  EXPECT_EQ(response.basis().scene_age().nanos(), 250'000'000);
}

TEST_F(CollisionServiceTest, EvidenceIsPerViewAndCanBeLeftOut) {
  server.Publish(SceneWithBlock(3, 1));
  const v1::Verdict verdict = server.CheckOne(At(3, 0));
  ASSERT_EQ(verdict.views_size(), 3);
  EXPECT_EQ(verdict.views(0).view(), "left");
  EXPECT_EQ(verdict.views(0).obstacle_pixels(), (Block(0, 3) & RobotMask(0, 3, 0)).Count());
  EXPECT_EQ(verdict.views(1).obstacle_pixels(), 0u);
  EXPECT_EQ(verdict.views(1).unknown_pixels(), (RobotMask(1, 0, 0) & RobotMask(1, 3, 0)).Count());
  v1::CheckConfigurationsRequest request;
  Set(At(3, 0), request.add_configurations());
  request.set_omit_evidence(true);
  v1::CheckConfigurationsResponse response;
  ASSERT_TRUE(server.Call(request, &response).ok());
  EXPECT_EQ(response.verdicts(0).views_size(), 0);
  EXPECT_EQ(response.verdicts(0).state(), verdict.state());
}

TEST_F(CollisionServiceTest, PolicyOfTheRequestDecides) {
  server.Publish(SceneWithBlock(3, 2));  // two of three views show the block
  EXPECT_EQ(server.CheckOne(At(3, 0)).state(), v1::Verdict::STATE_OCCUPIED) << "the default";
  EXPECT_EQ(server.CheckOne(At(3, 0), PolicyNamed("paper")).state(), v1::Verdict::STATE_FREE);
  v1::Policy three;
  three.set_min_views(3);
  EXPECT_EQ(server.CheckOne(At(3, 0), three).state(), v1::Verdict::STATE_FREE);
  v1::Policy none_hidden;
  none_hidden.set_max_occluded_views(0);
  EXPECT_EQ(server.CheckOne(At(3, 0), none_hidden).state(), v1::Verdict::STATE_FREE);
  v1::Policy nearest;
  nearest.set_off_grid(v1::OFF_GRID_NEAREST);
  EXPECT_EQ(server.CheckOne({2.4, At(0, 0)[1]}).state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(server.CheckOne({2.4, At(0, 0)[1]}, nearest).state(), v1::Verdict::STATE_FREE);
}

TEST_F(CollisionServiceTest, PresetOfTheRequestOverridesTheDefaultNumberOfViews) {
  ServingSettings settings;
  settings.policy.min_views = 1;
  TestServer careful(database, settings);
  careful.Publish(SceneWithBlock(3, 1));
  EXPECT_EQ(careful.CheckOne(At(3, 0)).state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(careful.CheckOne(At(3, 0), PolicyNamed("paper")).state(), v1::Verdict::STATE_FREE);
}

TEST_F(CollisionServiceTest, WrongPoliciesAreRefusedByName) {
  v1::CheckConfigurationsRequest request;
  request.mutable_policy()->set_preset("Paper");
  EXPECT_EQ(Refusal(request),
            "policy.preset: 'Paper' is unknown; known are 'uncalibrated', 'paper', 'calibrated', "
            "'paper-calibrated', 'sound-planes', 'sound'");
  request.mutable_policy()->set_preset("");
  request.mutable_policy()->set_min_views(4);
  EXPECT_EQ(Refusal(request), "policy: min_views must be 1 to 3, the number of views, not 4");
  request.mutable_policy()->set_min_views(0);
  EXPECT_THAT(Refusal(request), HasSubstr("min_views"));
  request.mutable_policy()->clear_min_views();
  request.mutable_policy()->set_max_occluded_views(-1);
  EXPECT_EQ(Refusal(request), "policy: max_occluded_views must not be negative");
  request.mutable_policy()->set_max_occluded_views(3);
  EXPECT_THAT(Refusal(request), HasSubstr("it must be less than 3, the number of views, not 3"));
  request.mutable_policy()->set_preset("paper");
  EXPECT_THAT(Refusal(request), HasSubstr("policy.max_occluded_views"));
  request.mutable_policy()->Clear();
  request.mutable_policy()->set_off_grid(static_cast<v1::OffGrid>(7));
  EXPECT_THAT(Refusal(request), HasSubstr("policy.off_grid"));
}

TEST_F(CollisionServiceTest, WrongNumberOfPositionsIsRefusedByName) {
  v1::CheckConfigurationsRequest request;
  Set(At(1, 1), request.add_configurations());
  Set({1, 2, 3}, request.add_configurations());
  EXPECT_EQ(Refusal(request),
            "configurations[1]: it has 3 positions and takes one for each of a, b");
  v1::CheckPathRequest path;
  EXPECT_EQ(Refusal(path), "waypoints: a path has at least one");
  Set({1}, path.add_waypoints());
  EXPECT_EQ(Refusal(path), "waypoints[0]: it has 1 position and takes one for each of a, b");
}

TEST_F(CollisionServiceTest, TooMuchAtOnceIsRefused) {
  v1::CheckConfigurationsRequest request;
  for (int i = 0; i <= kMaxConfigurations; ++i) request.add_configurations();
  EXPECT_EQ(Refusal(request), "configurations: there are 10001; ask for at most 10000 at once");
}

TEST_F(CollisionServiceTest, LargeBatchIsAnsweredWhole) {
  server.Publish(SceneWithBlock(3));
  std::vector<Configuration> configurations;
  for (int i = 0; i < kMaxConfigurations; ++i) {
    configurations.push_back(At(i % 5, i % 8));
  }
  const auto response = server.Check(configurations);
  for (int i = 0; i < response.verdicts_size(); ++i) {
    EXPECT_EQ(response.verdicts(i).state() == v1::Verdict::STATE_OCCUPIED, i % 5 == 3);
  }
}

TEST_F(CollisionServiceTest, PathTellsTheFirstPlaceThatIsNotFree) {
  server.Publish(SceneWithBlock(3));
  const v1::CheckPathResponse free = server.Path({At(0, 0), At(2, 0), At(2, 3)});
  EXPECT_EQ(free.verdict().state(), v1::Verdict::STATE_FREE);
  EXPECT_GT(free.checked(), 5);
  const v1::CheckPathResponse path = server.Path({At(0, 0), At(1, 0), At(4, 0)});
  EXPECT_EQ(path.verdict().state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(path.segment(), 1);
  EXPECT_GT(path.fraction(), 1.0 / 3);
  EXPECT_LT(path.fraction(), 2.0 / 3);
  EXPECT_NEAR(path.configuration().positions(0), 1 + 3 * path.fraction(), 1e-9);
  EXPECT_GT(path.verdict().views(0).obstacle_pixels(), 0u);
  EXPECT_EQ(path.basis().scene_id(), 1u);
  const Configuration place(path.configuration().positions().begin(),
                            path.configuration().positions().end());
  EXPECT_EQ(server.CheckOne(place).state(), v1::Verdict::STATE_OCCUPIED);
}

TEST_F(CollisionServiceTest, SpaceEqualsSingleChecks) {
  server.Publish(SceneWithBlock(3));
  const auto messages = server.Space();
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_EQ(messages[0].basis().scene_id(), 1u);
  EXPECT_EQ(messages[0].unknown_reason(), v1::Verdict::REASON_UNSPECIFIED);
  EXPECT_EQ(messages[0].grid().joints(1).name(), "b");
  ASSERT_EQ(messages[0].tiles_size(), 1);
  const v1::ConfigurationSpaceTile& tile = messages[0].tiles(0);
  const auto bit = [](const std::string& bytes, uint64_t place) {
    return (static_cast<uint8_t>(bytes[place / 8]) >> (place % 8)) & 1;
  };
  std::set<uint64_t> places;
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      const uint64_t place = database->grid().NumberOf({a, b});
      places.insert(place);
      const v1::Verdict::State state = server.CheckOne(At(a, b)).state();
      EXPECT_EQ(bit(tile.free(), place), state == v1::Verdict::STATE_FREE);
      EXPECT_EQ(bit(tile.occupied(), place), state == v1::Verdict::STATE_OCCUPIED);
    }
  }
  for (uint64_t place = 0; place < kTileSize; ++place) {
    if (places.contains(place)) continue;
    EXPECT_EQ(bit(tile.free(), place) + bit(tile.occupied(), place), 0) << "absent place";
  }
}

TEST_F(CollisionServiceTest, NumbersEqualSingleChecks) {
  server.Publish(SceneWithBlock(3));
  std::vector<uint32_t> numbers;
  std::vector<v1::Verdict::State> states;
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      numbers.push_back(static_cast<uint32_t>(database->grid().NumberOf({a, b})));
      states.push_back(server.CheckOne(At(a, b)).state());
    }
  }
  for (const uint32_t nobody : {4095u, 4096u, 4'000'000'000u}) {
    numbers.push_back(nobody);
    states.push_back(v1::Verdict::STATE_UNKNOWN);
  }
  const v1::CheckConfigurationsResponse response = server.CheckNumbers(numbers);
  EXPECT_EQ(response.basis().scene_id(), 1u);
  EXPECT_EQ(response.unknown_reason(), v1::Verdict::REASON_UNSPECIFIED);
  EXPECT_EQ(response.verdicts_size(), 0);
  ASSERT_EQ(response.free().size(), (numbers.size() + 7) / 8);
  ASSERT_EQ(response.occupied().size(), (numbers.size() + 7) / 8);
  for (size_t i = 0; i < numbers.size(); ++i) {
    const auto bit = [i](const std::string& bytes) {
      return static_cast<uint8_t>(bytes[i / 8]) >> (i % 8) & 1;
    };
    EXPECT_EQ(bit(response.free()), states[i] == v1::Verdict::STATE_FREE) << numbers[i];
    EXPECT_EQ(bit(response.occupied()), states[i] == v1::Verdict::STATE_OCCUPIED) << numbers[i];
  }
}

TEST_F(CollisionServiceTest, NumbersAndConfigurationsAtOnceAreRefused) {
  v1::CheckConfigurationsRequest request;
  request.add_numbers(1);
  Set(At(0, 0), request.add_configurations());
  EXPECT_THAT(Refusal(request), HasSubstr("not for both at once"));
}

TEST_F(CollisionServiceTest, SpaceWithoutTimeLeavesTilesOutUntilTheyAreDone) {
  server.Publish(SceneWithBlock(3));
  v1::GetConfigurationSpaceRequest request;
  request.mutable_max_time();
  auto messages = server.Space(request);
  ASSERT_EQ(messages.size(), 1u);
  EXPECT_EQ(messages[0].tiles_size(), 0);
  EXPECT_EQ(messages[0].tiles_left_out(), 1u);
  EXPECT_EQ(server.Space()[0].tiles_size(), 1);
  messages = server.Space(request);
  EXPECT_EQ(messages[0].tiles_size(), 1) << "done for another request";
  EXPECT_EQ(messages[0].tiles_left_out(), 0u);
  request.mutable_max_time()->set_seconds(-1);
  const grpc::Status status = server.Call(request, &messages);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status.error_message(), "max_time: a time cannot be negative");
}

TEST_F(CollisionServiceTest, SpaceFollowsPolicyAndScene) {
  server.Publish(SceneWithBlock(3, 2));
  v1::GetConfigurationSpaceRequest paper;
  paper.mutable_policy()->set_preset("paper");
  const auto occupied = [](const v1::GetConfigurationSpaceResponse& message) {
    return message.tiles(0).occupied().find_first_not_of('\0') != std::string::npos;
  };
  EXPECT_TRUE(occupied(server.Space()[0]));
  EXPECT_FALSE(occupied(server.Space(paper)[0]));
  EXPECT_TRUE(occupied(server.Space()[0])) << "asked again";
  server.Publish(EmptyCellScene());
  EXPECT_FALSE(occupied(server.Space()[0]));
  EXPECT_EQ(server.Space()[0].basis().scene_id(), 2u);
}

TEST_F(CollisionServiceTest, SpaceOfTilesThatAreNotThereIsRefused) {
  v1::GetConfigurationSpaceRequest request;
  request.add_tiles(0);
  request.add_tiles(1);
  std::vector<v1::GetConfigurationSpaceResponse> messages;
  const grpc::Status status = server.Call(request, &messages);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status.error_message(), "tiles[1]: there is no tile 1; the grid has 1, counted from 0");
}

TEST(GetConfigurationSpace, EachTileComesOnceInMessagesThatClientsTakeByDefault) {
  storage::v1::CellDescription cell = ServerTestCell();
  cell.mutable_grid_joints(0)->set_steps(2048);
  cell.mutable_grid_joints(1)->set_steps(1026);
  const ConfigurationGrid grid = *GridOf(cell);
  const std::filesystem::path folder = FreshFolder();
  {
    // Only the robot images around the scene's configuration and one far away are there.
    const auto database = Database::Create(folder / "db", cell);
    auto writer = (*database)->Write("test");
    for (const GridIndex index : {GridIndex{0, 0}, GridIndex{2000, 1000}}) {
      RobotImage image = TestRobotImage(grid, 0, 0);
      image.number = grid.NumberOf(index);
      ASSERT_TRUE(writer->Put(image).ok());
    }
    ASSERT_TRUE(writer->Commit().ok());
  }
  const auto database = LoadDatabase(folder / "db");
  TestServer server(database);
  server.Publish(EmptyCellScene());
  std::set<uint64_t> tiles;
  uint64_t free = 0;
  const auto messages = server.Space();
  EXPECT_EQ(messages.size(),
            (grid.tiles() + SpaceWriter::kTilesPerMessage - 1) / SpaceWriter::kTilesPerMessage);
  ASSERT_GT(messages.size(), 1u);
  for (const auto& message : messages) {
    EXPECT_LT(message.ByteSizeLong(), size_t{1} << 20);
    EXPECT_EQ(message.has_basis(), &message == &messages.front());
    for (const auto& tile : message.tiles()) {
      EXPECT_TRUE(tiles.insert(tile.tile()).second);
      for (char byte : tile.free()) free += std::popcount(static_cast<uint8_t>(byte));
    }
  }
  EXPECT_EQ(tiles.size(), grid.tiles());
  EXPECT_EQ(free, 2u);
  v1::GetConfigurationSpaceRequest some;
  for (uint64_t tile : {5, 3, 5}) some.add_tiles(tile);
  const auto part = server.Space(some);
  ASSERT_EQ(part[0].tiles_size(), 2) << "each once";
  EXPECT_EQ(part[0].tiles(0).tile(), 5u);
  v1::GetConfigurationSpaceRequest levels;
  for (int level = 0; level < 16; ++level) levels.add_clearance_levels(level);
  size_t sent = 0;
  for (const auto& message : server.Space(levels)) {
    EXPECT_LT(message.ByteSizeLong(), size_t{1} << 20);
    sent += static_cast<size_t>(message.tiles_size());
  }
  EXPECT_EQ(sent, grid.tiles());
}

Colour ColourAt(const std::string& png, int x, int y) {
  const cv::Mat image =
      cv::imdecode(cv::Mat(1, static_cast<int>(png.size()), CV_8UC1, const_cast<char*>(png.data())),
                   cv::IMREAD_COLOR);
  const cv::Vec3b pixel = image.at<cv::Vec3b>(y, x);
  return {pixel[2], pixel[1], pixel[0]};
}

TEST_F(CollisionServiceTest, ExplainShowsWhatTheVerdictRestsOn) {
  server.Publish(SceneWithBlock(3));
  const v1::ExplainResponse response = server.Explain(At(3, 0));
  EXPECT_EQ(response.verdict().state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(response.basis().scene_id(), 1u);
  ASSERT_EQ(response.views_size(), 3);
  const v1::ViewExplanation& left = response.views(0);
  EXPECT_EQ(left.view(), "left");
  // The block's lower row is in the robot's way, its upper row above it; the robot stands at a = 0.
  EXPECT_EQ(ColourAt(left.scene_png(), 6, 10), palette::kInk);
  EXPECT_EQ(ColourAt(left.obstacle_png(), 6, 9), palette::kObstacle);
  EXPECT_EQ(ColourAt(left.obstacle_png(), 0, 10), palette::kUnknown);
  EXPECT_EQ(ColourAt(left.intersection_png(), 6, 10), palette::kObstacle);
  EXPECT_EQ(ColourAt(left.intersection_png(), 6, 9), palette::kBackground);
  EXPECT_EQ(ColourAt(left.intersection_png(), 6, 11), palette::kUnknown);
  EXPECT_EQ(ColourAt(left.collision_png(), 6, 10), palette::kObstacle);
  EXPECT_EQ(ColourAt(left.collision_png(), 6, 11), palette::kBackground);
}

TEST_F(CollisionServiceTest, ExplainWithoutSceneOrOutsideTheGridShowsWhatThereIs) {
  EXPECT_EQ(server.Explain(At(3, 0)).views_size(), 0);
  server.Publish(SceneWithBlock(3));
  const v1::ExplainResponse outside = server.Explain({9, 0});
  EXPECT_EQ(outside.verdict().reason(), v1::Verdict::REASON_OUTSIDE_GRID);
  EXPECT_FALSE(outside.views(0).obstacle_png().empty());
  EXPECT_TRUE(outside.views(0).intersection_png().empty());
}

TEST(GetDatabase, TellsWhatIsServed) {
  const auto database =
      NewDatabase({.missing = {{0, 7}}, .excluded = {{4, 7}, {4, 6}}, .corrupt = {{2, 7}}});
  ServingSettings settings;
  settings.policy = {.max_occluded_views = 2, .off_grid = OffGrid::kNearest};
  settings.joint_slides = {{"a", true}};
  TestServer server(database, settings);
  const v1::GetDatabaseResponse response = server.GetDatabase();
  EXPECT_EQ(response.cell_name(), "server test");
  EXPECT_EQ(response.generation(), database->generation());
  EXPECT_EQ(response.grid().joints(0).steps(), 5);
  EXPECT_TRUE(response.grid().joints(1).continuous());
  EXPECT_EQ(response.grid().tile_edges_size(), 2);
  EXPECT_EQ(response.fixed_joints(0).name(), "lift");
  EXPECT_EQ(response.fixed_joints(0).position(), 0.5);
  EXPECT_EQ(response.views(2).name(), "top");
  EXPECT_EQ(response.views(2).image_width(), 40);
  EXPECT_EQ(response.views(0).mask_height(), 12);
  EXPECT_EQ(response.configurations(), 40u);
  EXPECT_EQ(response.captured(), 36u);
  EXPECT_EQ(response.excluded(), 2u);
  EXPECT_EQ(response.corrupt(), 1u);
  EXPECT_EQ(response.permanent_pixels(0), 16u) << "the foot";
  EXPECT_EQ(response.default_policy().preset(), "uncalibrated");
  EXPECT_EQ(response.default_policy().max_occluded_views(), 2);
  EXPECT_TRUE(response.grid().joints(0).slides());
  EXPECT_FALSE(response.grid().joints(1).slides()) << "it is continuous";
  EXPECT_TRUE(response.grid().joints(1).has_slides());
  EXPECT_EQ(response.default_policy().off_grid(), v1::OFF_GRID_NEAREST);
}

TEST(GetDatabase, TellsHowManyViewsMayHideAnObstacleBesideMinViews) {
  ServingSettings settings;
  settings.policy = {.min_views = 1, .max_occluded_views = 0};
  TestServer server(NewDatabase(), settings);
  const v1::GetDatabaseResponse response = server.GetDatabase();
  EXPECT_EQ(response.default_policy().min_views(), 1);
  EXPECT_TRUE(response.default_policy().has_max_occluded_views());
  EXPECT_EQ(response.default_policy().max_occluded_views(), 0);
}

}  // namespace
}  // namespace silhouette
