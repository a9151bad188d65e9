// The loop with devices that work.
#include "server/live/live_loop.h"

#include <gmock/gmock.h>

#include "tests/server/tool_set.h"
#include "tests/server_live/live_cell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

struct LiveLoopTest : LiveCellTest {};

TEST_F(LiveLoopTest, ImagesAndJointsBecomeScenesAgainAndAgain) {
  ASSERT_TRUE(Start().ok());
  const SharedScene first = GoodScene();
  EXPECT_GT(FreeBy(first), 0);
  const SharedScene later =
      NextScene("three more scenes", [&](const Scene& scene) { return scene.id >= first->id + 3; });
  EXPECT_GT(later->oldest, first->oldest);
  EXPECT_TRUE(record->Status().serving);
  EXPECT_GE(record->Status().to_scene.count, 3u);
}

TEST_F(LiveLoopTest, WhichOfSeveralSetsShowsTheRobotIsNotGuessed) {
  const FreshFolder folder;
  MakeDatabase(folder / "db", {.references = true});
  AddTools(folder / "db");
  const std::shared_ptr<const ServedDatabase> two_sets = LoadDatabase(folder / "db");
  // A database that gets a second set while scenes are made of it.
  ASSERT_TRUE(Start().ok());
  GoodScene();
  scenes.ReplaceDatabase(two_sets);
  WaitUntil([&] { return record->Status().lost_sets > 0; }, "a set of images without a scene");
  EXPECT_EQ(Newest(), nullptr);
  loop.reset();
  EXPECT_THAT(std::string(Start().message()), HasSubstr("nobody says which of them"));
}

TEST_F(LiveLoopTest, WhatStandsInTheCellIsInTheNextScene) {
  ASSERT_TRUE(Start().ok());
  EXPECT_TRUE(CheckerNow(GoodScene()).Check(At(3, 0)).free());
  Script([](LiveScript& to) { to.blocks = {3, 3, 3}; });
  const SharedScene blocked = NextScene("a scene with the block", [](const Scene& scene) {
    return scene.obstacle_images[0] && scene.obstacle_images[0]->obstacle().Count() > 0;
  });
  EXPECT_EQ(CheckerNow(blocked).Check(At(3, 0)).state(), State::kOccupied);
}

TEST_F(LiveLoopTest, RobotIsWhereItSaysWhateverTheOrderOfItsJoints) {
  Script([](LiveScript& to) {
    to.robot_a = 2;
    to.joints = {0.5, At(2, 0)[1], At(2, 0)[0]};
  });
  ASSERT_TRUE(Start().ok());
  const SharedScene scene = GoodScene();
  EXPECT_NEAR(scene->joints[0].position, At(2, 0)[0], 1e-12);
  EXPECT_EQ(scene->obstacle_images[0]->obstacle().Count(), 0u) << "the robot is no obstacle";
}

TEST_F(LiveLoopTest, MapIsCountedFromTheArrivalOfTheImages) {
  ASSERT_TRUE(Start().ok());
  record->NoteMap(GoodScene()->arrived);
  EXPECT_EQ(record->Status().to_map.count, 1u);
  EXPECT_GT(record->Status().to_map.median, absl::ZeroDuration());
}

TEST_F(LiveLoopTest, SameImagesAgainAreNoNewScene) {
  ASSERT_TRUE(Start().ok());
  GoodScene();
  Script([](LiveScript& to) {
    to.change = [taken = absl::Now()](auto& images) {
      for (auto& image : images) image->captured = taken;
    };
  });
  const auto sets = [&] { return record->Status().cameras[0].good; };
  const uint64_t before = sets();
  WaitUntil([&] { return sets() >= before + 3; }, "three more sets");
  const uint64_t id = Newest()->id;
  WaitUntil([&] { return sets() >= before + 6; }, "six more sets");
  EXPECT_EQ(Newest()->id, id);
}

TEST_F(LiveLoopTest, AnotherDatabaseIsServedFromTheNextSetOn) {
  ASSERT_TRUE(Start().ok());
  const uint64_t id = GoodScene()->id;
  const auto other = NewDatabase({.missing = {{1, 1}}, .references = true});
  scenes.ReplaceDatabase(other);
  const SharedScene scene =
      NextScene("a scene of it", [&](const Scene& made) { return made.id > id; });
  EXPECT_EQ(scene->generation, other->generation());
}

TEST_F(LiveLoopTest, DatabaseWithoutReferencesStopsScenesUntilThereIsOneWithThem) {
  ASSERT_TRUE(Start().ok());
  GoodScene();
  scenes.ReplaceDatabase(NewDatabase({.references = false}));
  WaitUntil([&] { return record->Status().fault.find("no reference") != std::string::npos; },
            "a fault of the database");
  EXPECT_EQ(Newest(), nullptr);
  scenes.ReplaceDatabase(database);
  EXPECT_GT(FreeBy(GoodScene()), 0);
}

TEST_F(LiveLoopTest, ReferencesAreNeededFromTheStart) {
  scenes.ReplaceDatabase(NewDatabase({.references = false}));
  const absl::Status started = Start();
  EXPECT_EQ(started.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(started.message()), HasSubstr("silhouette-capture reference"));
}

TEST_F(LiveLoopTest, DevicesThatDoNotFitTheCellAreToldAtTheStart) {
  struct OtherRobot : ScriptedRobot {
    using ScriptedRobot::ScriptedRobot;
    const std::vector<std::string>& joints() const override { return names; }
    const std::vector<std::string> names = {"lift", "b", "c"};
  };
  LiveDevices devices = Devices();
  devices.open_robot = [this] { return std::make_unique<OtherRobot>(script); };
  record = std::make_shared<LiveRecord>(kViewNames, config.scene.max_age, config.clock);
  const auto started = LiveLoop::Start(
      config, devices, {.database = [this] { return scenes.database(); }, .publish = nullptr},
      record);
  EXPECT_EQ(started.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(started.status().message()), HasSubstr("no joint 'a'"));
}

}  // namespace
}  // namespace silhouette
