// SPDX-License-Identifier: Apache-2.0
// The API with robot images that are drawn.
#include <gmock/gmock.h>

#include <algorithm>
#include <random>

#include "silhouette/client.h"
#include "silhouette/local_space.h"
#include "tests/random.h"
#include "tests/server/drawn_cell.h"
#include "tests/server/service/test_server.h"
#include "tests/server/service/watching.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

std::shared_ptr<const ServedDatabase> DrawnDatabase(
    const std::shared_ptr<const RobotModel>& model,
    const storage::v1::CellDescription& cell = DrawnCellDescription()) {
  const std::filesystem::path folder = FreshFolder();
  const auto created = Database::Create(folder / "db", cell);
  EXPECT_TRUE(created.ok()) << created.status();
  auto served = ServedDatabase::Load(
      **created, {.margin = 0}, {}, std::nullopt,
      {.calibration = DrawnCalibration(), .drawn = DrawnCell{.robot = model, .parts = {}}});
  EXPECT_TRUE(served.ok()) << served.status();
  return *std::move(served);
}

struct DrawnServiceTest : ::testing::Test {
  std::shared_ptr<const RobotModel> model = std::make_shared<const RobotModel>(DrawnModel());
  std::shared_ptr<const ServedDatabase> database = DrawnDatabase(model);
  TestServer server{database};

  // A ball that the beam meets at turn 0.
  void Publish() {
    server.Publish(
        DrawnSceneInput(*database->robot_images().drawn(), {2, 0}, {{{0.6, 0, 0.8}, 0.05}}));
  }
};

TEST_F(DrawnServiceTest, DatabaseSaysThatItsImagesAreDrawnAndWhole) {
  const v1::GetDatabaseResponse response = server.GetDatabase();
  EXPECT_EQ(response.images(), "drawn");
  EXPECT_EQ(response.configurations(), 6u);
  EXPECT_EQ(response.captured(), 6u);
}

TEST_F(DrawnServiceTest, AnswersSayThatTheModelIsNotVerified) {
  EXPECT_TRUE(server.Check({{0.5, 0.5}}).basis().unverified_model()) << "without a scene, too";
  Publish();
  EXPECT_TRUE(server.Check({{0.5, 0.5}}).basis().unverified_model());
  EXPECT_TRUE(server.Path({{1, 0}, {1.1, 0}}).basis().unverified_model());
  EXPECT_TRUE(server.Explain({1, 0}).basis().unverified_model());
  const auto client = client::Client::Connect(server.server->address());
  ASSERT_TRUE(client.ok()) << client.status();
  const auto checks = client->CheckConfigurations(std::vector<Configuration>{{0.5, 0.5}});
  ASSERT_TRUE(checks.ok()) << checks.status();
  EXPECT_TRUE(checks->basis.unverified_model);
}

TEST_F(DrawnServiceTest, FreeMotionIsProvenAndAWallIsFound) {
  Publish();
  const v1::CheckPathResponse away = server.Path({{1.4, 0}, {2, 0.1}, {3, 0}});
  EXPECT_EQ(away.verdict().state(), v1::Verdict::STATE_FREE);
  EXPECT_EQ(away.proof(), v1::PATH_PROOF_CONTINUOUS);
  EXPECT_EQ(away.sampled_step(), 0);
  const v1::CheckPathResponse wall = server.Path({{-1.5, 0}, {1.5, 0}});
  EXPECT_EQ(wall.verdict().state(), v1::Verdict::STATE_OCCUPIED);
  EXPECT_EQ(wall.proof(), v1::PATH_PROOF_UNSPECIFIED);
  EXPECT_GT(wall.fraction(), 0.2);
  EXPECT_LT(wall.fraction(), 0.5);
  const auto client = client::Client::Connect(server.server->address());
  ASSERT_TRUE(client.ok()) << client.status();
  const auto path = client->CheckPath(std::vector<Configuration>{{1.4, 0}, {2, 0.1}});
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(path->proof, client::PathProof::kContinuous);
}

TEST_F(DrawnServiceTest, SampledMotionSaysItsStep) {
  Publish();
  // Ever nearer to the ball, until it is no longer proven.
  v1::CheckPathResponse response;
  response.set_proof(v1::PATH_PROOF_CONTINUOUS);
  for (double turn = 1.4; response.proof() == v1::PATH_PROOF_CONTINUOUS; turn -= 0.01) {
    v1::CheckPathRequest request;
    Set({turn, 0}, request.add_waypoints());
    Set({1.5, 0}, request.add_waypoints());
    request.set_path_resolution(0.1);
    ASSERT_TRUE(server.Call(request, &response).ok());
  }
  ASSERT_EQ(response.verdict().state(), v1::Verdict::STATE_FREE);
  EXPECT_EQ(response.proof(), v1::PATH_PROOF_SAMPLED);
  EXPECT_GT(response.sampled_step(), 0);
  EXPECT_LE(response.sampled_step(), 0.0501);
}

TEST_F(DrawnServiceTest, ResolutionThatCannotBeIsRefused) {
  v1::CheckPathRequest request;
  Set({0, 0}, request.add_waypoints());
  Set({1, 0}, request.add_waypoints());
  v1::CheckPathResponse response;
  for (const double resolution : {0.0, -1.0, 0.0001, 0.2, double{NAN}}) {
    request.set_path_resolution(resolution);
    const grpc::Status status = server.Call(request, &response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_THAT(status.error_message(), HasSubstr("path_resolution"));
  }
}

TEST_F(DrawnServiceTest, OutsideTheLimitsIsUnknown) {
  Publish();
  EXPECT_EQ(server.CheckOne({0, 2.1}).reason(), v1::Verdict::REASON_OUTSIDE_GRID);
  EXPECT_EQ(server.Path({{1.4, 0}, {1.4, 2.1}}).verdict().reason(),
            v1::Verdict::REASON_OUTSIDE_GRID);
  const double huge = 1e308;
  for (const std::vector<Configuration>& path :
       std::vector<std::vector<Configuration>>{{{huge, 0}, {-huge, 0}},
                                               {{0, huge}, {0, -huge}},
                                               {{huge, huge}, {-huge, -huge}},
                                               {{1.4, 0}, {huge, 0}},
                                               {{1.4, 0}, {NAN, 0}}}) {
    for (const bool clearance : {false, true}) {
      EXPECT_EQ(server.Path(path, clearance).verdict().reason(), v1::Verdict::REASON_OUTSIDE_GRID);
    }
    EXPECT_EQ(server.Check(path, {}, /*clearance=*/true).verdicts(1).reason(),
              v1::Verdict::REASON_OUTSIDE_GRID);
    EXPECT_EQ(server.Explain(path[1]).verdict().reason(), v1::Verdict::REASON_OUTSIDE_GRID);
  }
}

TEST_F(DrawnServiceTest, MapInTheClientFreesNothingOffTheGrid) {
  ServingSettings settings;
  settings.scene.max_age = absl::Minutes(10);
  TestServer running(database, settings, [](const Clock&) { return SystemClock; });
  running.Publish(DrawnSceneInput(*database->robot_images().drawn(), {2, 0}, {}));
  for (const client::OffGrid off_grid : {client::OffGrid::kCell, client::OffGrid::kNearest}) {
    const client::LocalSpace space(client::Client::Connect(running.server->address()).value(),
                                   {.policy = {.min_views = 1, .off_grid = off_grid},
                                    .max_age = absl::Minutes(5),
                                    .obstacles = false});
    // The first snapshots have no map.
    const Configuration on = database->grid().At(GridIndex{1, 0});
    uint64_t number = 0;
    for (int i = 0; i < 4; ++i) {
      const auto snapshot = space.WaitForUpdate(number, absl::Milliseconds(500));
      number = snapshot->number();
      ASSERT_FALSE(snapshot->Check(Configuration{1, 0.3}).free());
      if (snapshot->Check(on).free()) break;
    }
    EXPECT_TRUE(space.Check(on).free());
    EXPECT_FALSE(space.Check({1, 0.3}).free());
    EXPECT_FALSE(
        space.WaitForUpdate(number, absl::Milliseconds(300))->Check(Configuration{1, 0.3}).free());
  }
}

TEST_F(DrawnServiceTest, MapIsDrawnForThoseWhoAskAndHasNoCells) {
  Publish();
  v1::GetConfigurationSpaceRequest request;
  request.set_include_cells(true);
  const auto messages = server.Space(request);
  ASSERT_FALSE(messages.empty());
  EXPECT_FALSE(messages[0].cells_exact());
  ASSERT_EQ(messages[0].tiles_size(), 1);
  const v1::ConfigurationSpaceTile& tile = messages[0].tiles(0);
  EXPECT_NE(tile.free().find_first_not_of('\0'), std::string::npos);
  EXPECT_EQ(tile.free_cells().find_first_not_of('\0'), std::string::npos);
}

TEST_F(DrawnServiceTest, WhoChecksByHimselfGetsTheRobotOnceAndTheObstaclesOfEachScene) {
  v1::WatchConfigurationSpaceRequest request;
  request.set_obstacles(true);
  SpaceWatching watching(server, request);
  SpaceUpdate update = watching.Next();
  EXPECT_TRUE(update.first.whole());
  EXPECT_EQ(update.first.planes_size(), 0) << "without a scene";
  const DrawnRobot& robot = *database->robot_images().drawn();
  ASSERT_EQ(update.first.robot().parts_size(), static_cast<int>(robot.parts().size()));
  ASSERT_EQ(update.first.robot().links_size(), static_cast<int>(robot.chain().links().size()));
  for (size_t i = 0; i < robot.parts().size(); ++i) {
    const v1::DrawnPart& part = update.first.robot().parts(static_cast<int>(i));
    EXPECT_EQ(part.radius(), robot.parts()[i].radius);
    EXPECT_TRUE(std::equal(part.points().begin(), part.points().end(),
                           robot.parts()[i].points.data(),
                           robot.parts()[i].points.data() + robot.parts()[i].points.size()));
  }
  Publish();
  update = watching.Next();
  EXPECT_FALSE(update.first.whole() || update.first.has_robot());
  EXPECT_EQ(update.tiles, 0u);
  EXPECT_EQ(update.first.min_views(), 3);
  ASSERT_EQ(update.first.planes_size(), 4);
  EXPECT_EQ(update.first.planes(3).view(), "d");
  EXPECT_NE(update.first.planes(3).mask().bits().find_first_not_of('\0'), std::string::npos);
  SceneInput input = DrawnSceneInput(robot, {2, 0}, {});
  input.views.pop_back();
  server.Publish(input);
  update = watching.Next();
  EXPECT_TRUE(update.first.planes(3).missing());
  EXPECT_FALSE(update.first.planes(3).has_mask());
  EXPECT_FALSE(update.first.planes(0).missing());
}

TEST_F(DrawnServiceTest, MapComesBesideObstaclesIfItIsAskedFor) {
  Publish();
  v1::WatchConfigurationSpaceRequest request;
  request.set_obstacles(true);
  request.add_tiles(0);
  EXPECT_EQ(SpaceWatching(server, request).Next().tiles, 1u);
  request.set_obstacles(false);
  const SpaceUpdate update = SpaceWatching(server, request).Next();
  EXPECT_EQ(update.tiles, 1u);
  EXPECT_FALSE(update.first.has_robot());
  EXPECT_EQ(update.first.planes_size(), 0);
}

TEST_F(DrawnServiceTest, ObstaclesAreRefusedWherePlanesDoNotDecide) {
  v1::WatchConfigurationSpaceRequest request;
  request.set_obstacles(true);
  *request.mutable_policy() = PolicyNamed("calibrated");
  const grpc::Status status = SpaceWatching(server, request).Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("'uncalibrated' or 'paper'"));
  request.set_obstacles(false);
  EXPECT_TRUE(SpaceWatching(server, request).Next().first.whole());
}

// The slide at the tip is the wrist.
TEST(ArmNodesService, NodesOfTheMapAgreeWithChecksOfAnyWrist) {
  storage::v1::CellDescription cell = DrawnCellDescription();
  cell.mutable_grid_joints(0)->set_steps(30);
  cell.mutable_grid_joints(1)->set_steps(20);
  cell.clear_fixed_joints();
  storage::v1::GridJoint& reach = *cell.add_grid_joints();
  reach.set_name("reach");
  reach.set_upper(0.2);
  reach.set_steps(1);
  const auto database = DrawnDatabase(std::make_shared<const RobotModel>(DrawnModel()), cell);
  const ConfigurationGrid& grid = database->grid();
  TestServer server{database};
  server.Publish(DrawnSceneInput(*database->robot_images().drawn(), {2, 0, 0.1},
                                 {{{0.6, 0, 0.8}, 0.05}, {{-0.3, -0.7, 0.9}, 0.1}}));
  const auto messages = server.Space();
  ASSERT_EQ(messages.size(), 1u);
  ASSERT_EQ(messages[0].tiles_size(), 1) << "600 nodes";

  Random random;
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  constexpr int kWrists = 8;
  size_t free = 0;
  size_t occupied = 0;
  size_t depend = 0;
  for (int turn = 0; turn < 30; ++turn) {
    for (int lift = 0; lift < 20; ++lift) {
      const ConfigurationNumber node = grid.NumberOf({turn, lift, 0});
      const auto bit = [&](const std::string& bits) {
        return (bits.at(node / 8) >> (node % 8) & 1) != 0;
      };
      const bool is_free = bit(messages[0].tiles(0).free());
      const bool is_occupied = bit(messages[0].tiles(0).occupied());
      ASSERT_FALSE(is_free && is_occupied);
      const auto looked_up = server.CheckNumbers({static_cast<uint32_t>(node)});
      EXPECT_EQ(looked_up.free()[0] & 1, is_free);
      EXPECT_EQ(looked_up.occupied()[0] & 1, is_occupied);
      std::vector<Configuration> places;
      for (int i = 0; i < kWrists; ++i) {
        Configuration& q = places.emplace_back(grid.At(node));
        q[2] = between(0, 0.2);
        // Free holds in the whole cell.
        if (is_free) q[0] += between(-0.49, 0.49) * grid.joints()[0].step();
      }
      int free_wrists = 0;
      const auto response = server.Check(places);
      for (const v1::Verdict& verdict : response.verdicts()) {
        if (verdict.state() == v1::Verdict::STATE_FREE) ++free_wrists;
        EXPECT_TRUE(!is_occupied || verdict.state() == v1::Verdict::STATE_OCCUPIED);
      }
      EXPECT_TRUE(!is_free || free_wrists == kWrists);
      free += is_free;
      occupied += is_occupied;
      depend += !is_free && !is_occupied && free_wrists > 0 && free_wrists < kWrists;
    }
  }
  EXPECT_GT(free, 100u);
  EXPECT_GT(occupied, 10u);
  EXPECT_GT(depend, 0u) << "what depends on the wrist";
}

TEST(CapturedService, SendsItsMapToThoseWhoAskForObstacles) {
  TestServer server(NewDatabase());
  server.Publish(EmptyCellScene());
  v1::WatchConfigurationSpaceRequest request;
  request.set_obstacles(true);
  const SpaceUpdate update = SpaceWatching(server, request).Next();
  EXPECT_EQ(update.tiles, 1u);
  EXPECT_FALSE(update.first.has_robot());
}

}  // namespace
}  // namespace silhouette
