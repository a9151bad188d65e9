// SPDX-License-Identifier: Apache-2.0
// A database whose robot images stay in its file: served as one that is held in memory.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <random>

#include "server/scene/checker.h"
#include "server/scene/configuration_space.h"
#include "tests/random.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

const LoadSettings kInPlace{.robot_image_memory = 0};
const Moment kServedInPlaceNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

struct ServedInPlace : ::testing::TestWithParam<bool> {
  const std::filesystem::path folder = FreshFolder();
  std::string path = folder / "db";

  // Both ways: in memory, and in place.
  std::vector<std::shared_ptr<const ServedDatabase>> Load() const {
    return {LoadDatabase(path, {.margin = 0}, {}), LoadDatabase(path, {.margin = 0}, {}, kInPlace)};
  }

  static Served ServedScene(const std::shared_ptr<const ServedDatabase>& database,
                            const SceneInput& input) {
    absl::StatusOr<Scene> scene = MakeScene(*database, input, {}, {}, kServedInPlaceNow);
    EXPECT_TRUE(scene.ok()) << scene.status();
    scene->id = 1;
    return {database, std::make_shared<const Scene>(*std::move(scene)), Reason::kNone};
  }
};

TEST_P(ServedInPlace, AnswersAsFromMemory) {
  MakeDatabase(path, {.missing = {{0, 7}},
                      .excluded = {{4, 7}},
                      .corrupt = {{2, 7}},
                      .index = GetParam(),
                      .calibration = TestCalibration()});
  const auto databases = Load();
  ASSERT_TRUE(databases[0]->robot_images().in_memory());
  ASSERT_FALSE(databases[1]->robot_images().in_memory());
  ASSERT_EQ(databases[1]->index() != nullptr, GetParam());
  Random random;
  for (int round = 0; round < 40; ++round) {
    const int block = static_cast<int>(random() % 5);
    const SceneInput input =
        round % 2 == 0 ? SceneWithBlock(block, 1 + round % 3, 1, 2) : SceneWithHighBlock(block);
    const std::vector<Served> served = {ServedScene(databases[0], input),
                                        ServedScene(databases[1], input)};
    for (size_t view = 0; view < 3; ++view) {
      const auto& held_image = served[0].scene->obstacle_images[view];
      const auto& read_image = served[1].scene->obstacle_images[view];
      ASSERT_EQ(held_image->obstacle(), read_image->obstacle());
      ASSERT_EQ(held_image->unknown(), read_image->unknown());
      ASSERT_EQ(held_image->error(), read_image->error());
    }
    const Policy policy{.preset = AllPresets()[random() % 4],
                        .off_grid = random() % 2 == 0 ? OffGrid::kCell : OffGrid::kNearest};
    const Checker held(served[0], policy, {}, kServedInPlaceNow);
    const Checker read(served[1], policy, {}, kServedInPlaceNow);
    for (int i = 0; i < 50; ++i) {
      const auto any = [&] { return std::uniform_real_distribution(0.0, 4.0)(random); };
      const Configuration q = i % 2 == 0 ? At(static_cast<int>(random() % 5), random() % 8)
                                         : Configuration{any(), any() - 2};
      const std::vector<Configuration> way = {q, {any(), any() - 2}};
      ASSERT_EQ(held.Check(q), read.Check(q));
      ASSERT_EQ(held.CheckPath(way).verdict, read.CheckPath(way).verdict);
      ASSERT_EQ(held.CollisionImagesAt(q), read.CollisionImagesAt(q));
      ASSERT_EQ(held.TestRobotImages(q), read.TestRobotImages(q));
    }
    ASSERT_EQ(CheckAllTiles(served[0], policy), CheckAllTiles(served[1], policy));
  }
}

INSTANTIATE_TEST_SUITE_P(Index, ServedInPlace, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "With" : "Without"; });

struct ServedInPlaceDamaged : ServedInPlace {};

TEST_F(ServedInPlaceDamaged, RecordDamagedWhileItIsServedIsUnknownAndCorrupt) {
  MakeDatabase(path);
  const auto database = Load()[1];
  const SceneInput input = EmptyCellScene();
  const Served served = ServedScene(database, input);
  const Checker checker(served, {}, {}, kServedInPlaceNow);
  ASSERT_TRUE(checker.Check(At(2, 3)).free());
  DamageRecord(path, TestRobotImage(database->grid(), 2, 3));
  EXPECT_EQ(checker.Check(At(2, 3)), Verdict::Unknown(Reason::kRobotImageCorrupt));
  EXPECT_EQ(checker.Check(Configuration{2.5, At(2, 3)[1]}),
            Verdict::Unknown(Reason::kRobotImageCorrupt));
  EXPECT_TRUE(checker.Check(At(1, 3)).free());
  // Where the robot stands now is not known either.
  const absl::StatusOr<Scene> scene =
      MakeScene(*database, EmptyCellScene(2, 3), {}, {}, kServedInPlaceNow);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->Blocked(), Reason::kRobotImageOfSceneMissing);
}

TEST_F(ServedInPlaceDamaged, WhatIsWrittenAfterwardsIsNotSeen) {
  MakeDatabase(path);
  const auto database = Load()[1];
  const ConfigurationNumber number = database->grid().NumberOf({2, 3});
  const auto before = database->robot_images().Images(number);
  {
    const auto writing = Database::Open(path, Database::Access::kWrite);
    auto writer = (*writing)->Write("test");
    for (int round = 0; round < 5; ++round) {
      RobotImage image = TestRobotImage(database->grid(), 4, round);
      image.number = number;
      ASSERT_TRUE(writer->Put(image, true).ok() && writer->Commit().ok());
    }
  }
  EXPECT_EQ(database->robot_images().Images(number), before);
  EXPECT_NE(Load()[1]->robot_images().Images(number), before);
}

TEST_F(ServedInPlaceDamaged, ReportsItsProgress) {
  storage::v1::CellDescription cell = ServerTestCell();
  MakeDatabase(path, {.cell = cell});
  const auto database = Database::Open(path, Database::Access::kRead);
  std::vector<uint64_t> done;
  const LoadSettings settings{.progress = [&](uint64_t records, uint64_t all) {
    EXPECT_EQ(all, 40u);
    done.push_back(records);
  }};
  ASSERT_TRUE(ServedDatabase::Load(**database, {}, {}, std::nullopt, settings).ok());
  EXPECT_EQ(done, std::vector<uint64_t>{40});
}

// 512 x 512 pixels in three views: 96 KiB of masks per configuration.
TEST_F(ServedInPlaceDamaged, TakesLittleMemoryHoweverManyMasksThereAre) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer takes memory of its own";
#endif
  constexpr int kSteps = 4000;  // masks of 375 MiB in all
  constexpr MaskSize kSize{512, 512};
  storage::v1::CellDescription cell = ServerTestCell();
  cell.mutable_grid_joints(0)->set_steps(kSteps);
  cell.mutable_grid_joints(1)->set_continuous(false);
  cell.mutable_grid_joints(1)->set_upper(cell.grid_joints(1).lower());
  cell.mutable_grid_joints(1)->set_steps(1);
  for (auto& view : *cell.mutable_views()) {
    view.set_mask_width(kSize.width);
    view.set_mask_height(kSize.height);
  }
  const pid_t child = fork();
  if (child == 0) {
    const ConfigurationGrid grid = *GridOf(cell);
    {
      const auto database = Database::Create(path, cell);
      auto writer = (*database)->Write("test", absl::Hours(1));
      for (int step = 0; step < kSteps; ++step) {
        std::vector<uint64_t> words(kSize.words());
        for (int x = step / 8; x < step / 8 + 5; ++x) words[x / 64] |= uint64_t{1} << x % 64;
        const Mask mask = Mask::FromWords(kSize, std::move(words));
        RobotImage image;
        image.number = grid.NumberOf({step});
        image.masks = {mask, mask, mask};
        if (!writer->Put(image).ok()) _exit(1);
      }
      if (!writer->Commit().ok()) _exit(2);
    }
    constexpr rlim_t kMost = rlim_t{96} << 20;
    if (kSteps * kSize.bytes() * 3 < 3 * kMost) _exit(7);
    const rlimit limit{kMost, kMost};
    if (setrlimit(RLIMIT_DATA, &limit) != 0) _exit(3);
    const auto database = LoadDatabase(path, {.margin = 0}, {}, {.robot_image_memory = kMost / 2});
    if (database == nullptr || database->robot_images().in_memory()) _exit(4);
    ObstacleImages images;
    for (int view = 0; view < 3; ++view) {
      const Mask obstacle =
          Mask::FromPredicate(kSize, [](int x, int y) { return x == 300 && y == 0; });
      images.push_back(ObstacleImage::FromScene(obstacle, Mask(kSize)));
    }
    const CollisionChecker test(database->robot_images(), images, {});
    for (int step = 0; step < kSteps; ++step) {
      const bool touches = step / 8 <= 300 && step / 8 + 5 > 300;
      const State expected = touches ? State::kOccupied : State::kFree;
      if (test.Check(grid.NumberOf({step})).state() != expected) _exit(5);
    }
    _exit(::testing::Test::HasFailure() ? 6 : 0);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0) << "exit code " << WEXITSTATUS(status);
}

}  // namespace
}  // namespace silhouette
