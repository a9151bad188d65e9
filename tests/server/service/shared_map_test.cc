// The shared map from the server's state to a client's answers: the same as the server's, or
// unknown.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <iostream>
#include <random>

#include "absl/time/clock.h"
#include "server/scene/checker.h"
#include "server/service/shared_map_writer.h"
#include "silhouette/shared_space.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using client::SharedSpace;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr absl::Duration kLong = absl::Minutes(10);

client::State Same(State state) {
  if (state == State::kFree) return client::State::kFree;
  return state == State::kOccupied ? client::State::kOccupied : client::State::kUnknown;
}

std::shared_ptr<const ConfigurationSpace> SpaceOf(const Served& served, const Policy& policy,
                                                  bool cells) {
  auto space = std::make_shared<const ConfigurationSpace>(served, policy);
  std::vector<uint64_t> tiles;
  for (uint64_t tile = 0; tile < space->tiles(); ++tile) {
    space->tile(tile);
    tiles.push_back(tile);
  }
  if (cells) space->WorkOutCells(tiles, [] { return false; });
  return space;
}

// What a server does, one step at a time.
class Publisher {
 public:
  explicit Publisher(const std::string& file, absl::Duration max_age = kLong,
                     const Policy& policy = {},
                     std::shared_ptr<const ServedDatabase> database = NewDatabase())
      : policy_(policy), settings_{.max_age = max_age}, store_(database) {
    auto made = SharedMapWriter::Create({.file = file}, max_age, database, policy);
    EXPECT_TRUE(made.ok()) << made.status();
    writer_ = *std::move(made);
  }

  // The images are so old.
  void Scene(const SceneInput& input, absl::Duration age = absl::ZeroDuration()) {
    SceneInput dated = input;
    const Moment now = SystemClock();
    for (ViewInput& view : dated.views) view.captured = now.time - age;
    auto scene = MakeScene(*store_.database(), dated, {}, {}, now);
    ASSERT_TRUE(scene.ok()) << scene.status();
    ASSERT_TRUE(store_.Publish(*std::move(scene), store_.database()).ok());
    Tell();
  }

  void Tell() {
    const Moment now = SystemClock();
    const Served served = store_.Newest(now);
    const Reason blocked = BlockedReason(served, settings_, now);
    std::shared_ptr<const ConfigurationSpace> space;
    if (blocked == Reason::kNone) space = SpaceOf(served, policy_, cells);
    const absl::Status told = writer_->Publish(served, policy_, space.get(), blocked);
    EXPECT_TRUE(told.ok()) << told;
  }

  bool cells = true;  // worked out, too
  SceneStore& store() { return store_; }
  Checker CheckerNow() {
    const Moment now = SystemClock();
    return Checker(store_.Newest(now), policy_, settings_, now);
  }

 private:
  Policy policy_;
  SceneSettings settings_;
  SceneStore store_;
  std::unique_ptr<SharedMapWriter> writer_;
};

class SharedMapTest : public ::testing::Test {
 protected:
  SharedSpace Open(absl::Duration max_age = absl::InfiniteDuration()) {
    auto space = SharedSpace::Open(file_, max_age);
    EXPECT_TRUE(space.ok()) << space.status();
    return *space;
  }
  absl::Status OpenStatus() { return SharedSpace::Open(file_).status(); }

  const std::filesystem::path folder_ = FreshFolder();
  const std::string file_ = folder_ / "map";
};

bool SharedMapWaitUntil(const std::function<bool()>& condition) {
  for (int i = 0; i < 1000; ++i) {
    if (condition()) return true;
    absl::SleepFor(absl::Milliseconds(10));
  }
  return false;
}

TEST_F(SharedMapTest, SaysWhatTheServerSays) {
  for (const Policy& policy :
       {Policy{}, Policy{.min_views = 1}, Policy{.off_grid = OffGrid::kNearest}}) {
    Publisher publisher(file_, kLong, policy,
                        NewDatabase({.missing = {{1, 1}}, .excluded = {{4, 2}}}));
    const SharedSpace space = Open();
    EXPECT_EQ(space.database().cell_name, "server test");
    EXPECT_EQ(space.grid(), publisher.store().database()->grid());
    for (const SceneInput& scene : {SceneWithBlock(3), SceneWithBlock(2, 2), EmptyCellScene()}) {
      publisher.Scene(scene);
      const Checker checker = publisher.CheckerNow();
      const ConfigurationGrid& grid = space.grid();
      std::vector<uint32_t> numbers;
      for (ConfigurationNumber number = 0; number < grid.number_limit() + 5000; ++number) {
        const bool on_grid = grid.Contains(number);
        const client::State expected =
            on_grid ? Same(checker.Check(grid.At(number)).state()) : client::State::kUnknown;
        ASSERT_EQ(space.StateAt(number), expected) << number;
        if (on_grid) {
          EXPECT_EQ(space.Check(grid.At(number)).state, expected);
        }
        numbers.push_back(static_cast<uint32_t>(number));
      }
      const client::NumberChecks checks = space.CheckNumbers(numbers);
      const client::ConfigurationSpace copy = space.Copy();
      EXPECT_EQ(checks.unknown_reason, client::Reason::kUnspecified);
      for (const client::Basis& basis : {checks.basis, copy.basis(), space.basis()}) {
        EXPECT_EQ(basis.scene_id, checker.served().scene->id);
        EXPECT_EQ(basis.database_generation, checker.served().database->generation());
        EXPECT_EQ(basis.scene_time, checker.served().scene->oldest);
        EXPECT_LT(basis.Age(), absl::Minutes(1));
        EXPECT_GE(basis.Age(), absl::ZeroDuration());
      }
      for (size_t i = 0; i < numbers.size(); ++i) {
        ASSERT_EQ(checks.StateOf(i), space.StateAt(numbers[i])) << i;
        ASSERT_EQ(copy.StateAt(numbers[i]), space.StateAt(numbers[i])) << i;
      }
    }
  }
}

class SharedMapOffTheGrid : public SharedMapTest, public ::testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(WithCellsOrWithout, SharedMapOffTheGrid, ::testing::Bool());

TEST_P(SharedMapOffTheGrid, IsWhatTheServerSaysOrUnknown) {
  const bool cells = GetParam();
  const unsigned seed = std::random_device()();
  std::cout << "seed " << seed << std::endl;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> a(-0.5, 4.5);
  std::uniform_real_distribution<double> b(-4, 4);
  Publisher publisher(file_, kLong, {}, NewDatabase({.missing = {{4, 5}}}));
  const SharedSpace space = Open();
  publisher.cells = cells;
  publisher.Scene(SceneWithBlock(2));
  const Checker checker = publisher.CheckerNow();
  std::vector<Configuration> configurations;
  for (int i = 0; i < 300; ++i) configurations.push_back({a(random), b(random)});
  for (int i = 0; i < 100; ++i) configurations.push_back({std::floor(a(random)), b(random)});
  const client::ConfigurationChecks checks = space.CheckConfigurations(configurations);
  ASSERT_EQ(checks.verdicts.size(), configurations.size());
  int free = 0;
  int occupied = 0;
  int asked = 0;
  for (size_t i = 0; i < configurations.size(); ++i) {
    client::Basis basis;
    const client::Verdict verdict = space.Check(configurations[i], &basis);
    EXPECT_EQ(basis.scene_id, 1u);
    EXPECT_EQ(verdict.state, checks.verdicts[i].state);
    EXPECT_EQ(verdict.reason, checks.verdicts[i].reason);
    const Verdict server = checker.Check(configurations[i]);
    EXPECT_TRUE(verdict.state == client::State::kUnknown || verdict.state == Same(server.state()));
    EXPECT_EQ(verdict.reason == client::Reason::kOutsideGrid,
              server.reason() == Reason::kOutsideGrid);
    if (verdict.state == client::State::kOccupied) ++occupied;
    if (verdict.state == client::State::kFree) ++free;
    if (verdict.reason == client::Reason::kBetweenGridPoints) {
      ++asked;
      EXPECT_TRUE(!cells || configurations[i][0] == std::floor(configurations[i][0]));
    }
  }
  EXPECT_GT(occupied, 10);
  EXPECT_EQ(free > 10, cells);
  if (!cells) {
    EXPECT_GT(asked, 10);
  }
}

TEST_F(SharedMapTest, IsUnknownBeforeTheFirstScene) {
  Publisher publisher(file_);
  const SharedSpace space = Open();
  EXPECT_EQ(space.unknown_reason(), client::Reason::kNoScene);
  publisher.Tell();
  EXPECT_EQ(space.unknown_reason(), client::Reason::kNoScene);
  EXPECT_EQ(space.Check({0, 0}).reason, client::Reason::kNoScene);
  EXPECT_EQ(space.StateAt(0), client::State::kUnknown);
  EXPECT_EQ(space.Age(), absl::InfiniteDuration());
  publisher.Scene(EmptyCellScene());
  EXPECT_TRUE(space.Check({0, 0}).free());
  EXPECT_EQ(space.unknown_reason(), client::Reason::kUnspecified);
}

TEST_F(SharedMapTest, IsUnknownWhereTheSceneCannotBeRestedOn) {
  Publisher publisher(file_);
  const SharedSpace space = Open();
  publisher.Scene(EmptyCellScene());
  SceneInput moved = EmptyCellScene();
  moved.joints[2].position = 0.7;
  publisher.Scene(moved);
  const client::NumberChecks checks = space.CheckNumbers(std::vector<uint32_t>{0, 1, 2});
  EXPECT_EQ(checks.unknown_reason, client::Reason::kFixedJointMoved);
  EXPECT_EQ(checks.basis.scene_id, 2u);
  EXPECT_THAT(checks.free, ElementsAre(0));
  EXPECT_EQ(space.Copy().Count().unknown, space.grid().size());
  EXPECT_EQ(space.Check({0, 0}).reason, client::Reason::kFixedJointMoved);
  publisher.Scene(EmptyCellScene());
  EXPECT_TRUE(space.Check({0, 0}).free()) << "states of two updates before must not be missed";
}

TEST_F(SharedMapTest, IsUnknownOnceTheSceneIsOlderThanTheServerAllows) {
  Publisher publisher(file_, absl::Milliseconds(400));
  const SharedSpace space = Open();
  ASSERT_TRUE(SharedMapWaitUntil([&] {
    publisher.Scene(EmptyCellScene());
    return space.Check({0, 0}).free() && space.Check({0.4, 0.1}).free();
  }));
  // Nobody tells the reader.
  ASSERT_TRUE(SharedMapWaitUntil([&] { return !space.Check({0, 0}).free(); }));
  EXPECT_GE(space.Age(), absl::Milliseconds(400));
  EXPECT_EQ(space.unknown_reason(), client::Reason::kSceneStale);
  EXPECT_EQ(space.StateAt(0), client::State::kUnknown);
  EXPECT_EQ(space.Check({0.4, 0.1}).reason, client::Reason::kSceneStale) << "between grid points";
}

TEST_F(SharedMapTest, IsUnknownOnceTheSceneIsOlderThanTheReaderAllows) {
  Publisher publisher(file_);
  const SharedSpace strict = Open(absl::Milliseconds(400));
  const SharedSpace lenient = Open(absl::Minutes(5));
  publisher.Scene(EmptyCellScene(), absl::Milliseconds(401));
  EXPECT_EQ(strict.Check({0, 0}).reason, client::Reason::kSceneStale) << "the images' age counts";
  const auto is_free_at_first = [&] {
    publisher.Scene(EmptyCellScene());
    return strict.Check({0, 0}).free();
  };
  ASSERT_TRUE(SharedMapWaitUntil(is_free_at_first));
  ASSERT_TRUE(SharedMapWaitUntil([&] { return !strict.Check({0, 0}).free(); }));
  EXPECT_GE(strict.Age(), absl::Milliseconds(400));
  EXPECT_EQ(strict.Check({0, 0}).reason, client::Reason::kSceneStale);
  EXPECT_TRUE(lenient.Check({0, 0}).free());
  EXPECT_TRUE(SharedMapWaitUntil(is_free_at_first)) << "it goes on with the next scene";
  EXPECT_EQ(SharedSpace::Open(file_, -absl::Seconds(1)).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(SharedMapTest, EndsWithAnAllowedRegion) {
  Publisher publisher(file_);
  const SharedSpace space = Open();
  publisher.Scene(SceneWithBlock(3));
  EXPECT_EQ(space.Check(At(3, 4)).state, client::State::kOccupied);
  std::vector<std::optional<Mask>> pixels;
  for (int view = 0; view < 3; ++view) pixels.emplace_back(Block(view, 3));
  client::Basis basis;
  client::Verdict verdict;
  client::ConfigurationChecks checks;
  ASSERT_TRUE(SharedMapWaitUntil([&] {
    const auto allowed = publisher.store().Allow("part", pixels, absl::Milliseconds(400),
                                                 SystemClock(), publisher.store().database());
    EXPECT_TRUE(allowed.ok()) << allowed.status();
    publisher.Tell();
    verdict = space.Check(At(3, 4), &basis);
    checks = space.CheckConfigurations(std::vector<Configuration>{At(3, 4)});
    return verdict.free() && checks.verdicts[0].free();
  }));
  EXPECT_THAT(basis.regions, ElementsAre("part"));
  EXPECT_THAT(verdict.regions, ElementsAre("part"));
  EXPECT_THAT(checks.verdicts[0].regions, ElementsAre("part"));
  ASSERT_TRUE(SharedMapWaitUntil([&] { return !space.Check(At(3, 4)).free(); }));
  EXPECT_EQ(space.unknown_reason(), client::Reason::kRegionEnded);
  publisher.Tell();
  verdict = space.Check(At(3, 4), &basis);
  EXPECT_EQ(verdict.state, client::State::kOccupied);
  EXPECT_THAT(verdict.regions, IsEmpty());
  EXPECT_THAT(basis.regions, IsEmpty());
}

TEST_F(SharedMapTest, SaysThatTheServerWasStopped) {
  std::optional<Publisher> publisher(file_);
  const SharedSpace space = Open();
  publisher->Scene(EmptyCellScene());
  EXPECT_TRUE(space.Check({0, 0}).free());
  publisher.reset();
  EXPECT_EQ(space.Check({0, 0}).reason, client::Reason::kMapClosed);
  EXPECT_EQ(space.StateAt(0), client::State::kUnknown);
  EXPECT_FALSE(std::filesystem::exists(file_));
  EXPECT_EQ(space.Reopen().status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(OpenStatus().message()), HasSubstr("--shared-map"));
  publisher.emplace(file_);
  publisher->Scene(EmptyCellScene());
  EXPECT_EQ(space.Check({0, 0}).reason, client::Reason::kMapClosed);
  EXPECT_TRUE(space.Reopen().value().Check({0, 0}).free());
}

TEST_F(SharedMapTest, AnotherDatabaseGetsAFileOfItsOwn) {
  Publisher publisher(file_);
  const SharedSpace space = Open();
  publisher.Scene(EmptyCellScene());
  storage::v1::CellDescription finer = ServerTestCell();
  finer.mutable_grid_joints(1)->set_steps(4096);
  TestDatabase other{.cell = finer};
  publisher.store().ReplaceDatabase(NewDatabase(other));
  EXPECT_TRUE(space.Check({0, 0}).free()) << "until the writer is told";
  publisher.Tell();
  EXPECT_EQ(space.Check({0, 0}).reason, client::Reason::kMapClosed);
  const absl::StatusOr<SharedSpace> reopened = space.Reopen();
  ASSERT_TRUE(reopened.ok()) << reopened.status();
  EXPECT_EQ(reopened->grid(), publisher.store().database()->grid());
  EXPECT_NE(reopened->grid().tiles(), space.grid().tiles());
  EXPECT_EQ(reopened->unknown_reason(), client::Reason::kGenerationMismatch);
  publisher.Scene(EmptyCellScene());
  EXPECT_TRUE(reopened->Check({0, -std::numbers::pi}).free());
  EXPECT_EQ(space.Check({0, 0}).reason, client::Reason::kMapClosed);
}

TEST_F(SharedMapTest, FileThatCannotBeReplacedIsClosedAllTheSame) {
  const auto database = NewDatabase();
  const auto writer = SharedMapWriter::Create({.file = file_}, kLong, database, {});
  ASSERT_TRUE(writer.ok()) << writer.status();
  const SharedSpace space = Open();
  SceneStore store(NewDatabase());
  const auto publish = [&] {
    return (*writer)->Publish(store.Newest(SystemClock()), {}, nullptr, Reason::kNoScene);
  };
  std::filesystem::remove(file_);
  std::filesystem::create_directory(file_);
  EXPECT_EQ(publish().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(space.unknown_reason(), client::Reason::kMapClosed);
  std::filesystem::remove(file_);
  EXPECT_TRUE(publish().ok()) << "it is tried again";
  EXPECT_EQ(space.Reopen().value().unknown_reason(), client::Reason::kNoScene);
}

}  // namespace
}  // namespace silhouette
