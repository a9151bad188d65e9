// SPDX-License-Identifier: Apache-2.0
// A build that is killed at any instant, a full disk, and damaged values.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <iostream>
#include <thread>

#include "db/store/collision_index.h"
#include "db/store/environment.h"
#include "db/store/schema.h"
#include "tests/db/store/full_disk.h"
#include "tests/db/store/index_checks.h"
#include "tests/db/store/raw_values.h"
#include "tests/db/store/test_database.h"
#include "tests/random.h"

namespace silhouette {
namespace {

void ExpectRecordsAreThere(const Database& database, uint64_t every) {
  const auto snapshot = database.Read();
  uint64_t count = 0;
  for (ConfigurationNumber number : AllNumbers(database.grid())) {
    if (number % every != 0) continue;
    ++count;
    const auto found = snapshot->Find(number);
    ASSERT_TRUE(found.ok()) << found.status();
    ASSERT_TRUE(*found && **found == TestImage(database, number)) << number;
  }
  EXPECT_EQ(snapshot->size(), count);
}

TEST(CollisionIndex, KilledBuildLeavesWholeTilesOrNone) {
  const std::string path = MakeFilledDatabase(40)->path();
  Random random;
  int killed = 0;
  for (int round = 0; round < 25; ++round) {
    int ready[2];
    ASSERT_EQ(pipe(ready), 0);
    const pid_t child = fork();
    if (child == 0) {
      const auto database = Database::Open(path, Access::kWrite);
      if (!database.ok() || write(ready[1], "r", 1) != 1) _exit(1);
      // A tile at a time, as often as it takes.
      for (;;) {
        if (!BuildCollisionIndex(**database, {.all = true, .buffer = 0}).ok()) _exit(2);
      }
    }
    char byte = 0;
    ASSERT_EQ(read(ready[0], &byte, 1), 1);
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 30'000));
    kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    killed += WIFSIGNALED(status) ? 1 : 0;
    close(ready[0]);
    close(ready[1]);
    const auto database = Database::Open(path, Access::kRead);
    ASSERT_TRUE(database.ok()) << database.status();
    const CollisionIndexSummary summary = OpenIndex(**database)->Summary();
    EXPECT_EQ(summary.fresh + summary.missing, summary.tiles);
    ExpectIndexHoldsTheRobotImages(**database, false);
  }
  EXPECT_EQ(killed, 25);
  const auto database = Database::Open(path, Access::kWrite);
  ExpectRecordsAreThere(**database, 40);
  ASSERT_TRUE(BuildCollisionIndex(**database).ok());
  ExpectIndexHoldsTheRobotImages(**database);
}

TEST_F(FullDisk, KeepsRecordsAndWholeTilesOfABuild) {
  const std::string path = disk_ + "/db";
  storage::v1::CellDescription cell = TestCell(300, 300);
  cell.mutable_views(0)->set_mask_width(16);
  cell.mutable_views(0)->set_mask_height(16);
  MakeFilledDatabase(500, cell, path);
  const auto database = Database::Open(path, Access::kWrite);
  const auto full = BuildCollisionIndex(**database, {.buffer = 0});
  EXPECT_EQ(full.status().code(), absl::StatusCode::kResourceExhausted) << full.status();
  const CollisionIndexSummary summary = OpenIndex(**database)->Summary();
  EXPECT_GT(summary.fresh, 0);
  EXPECT_GT(summary.missing, 0);
  EXPECT_EQ(summary.fresh + summary.missing, summary.tiles);
  ExpectIndexHoldsTheRobotImages(**database, false);
  ExpectRecordsAreThere(**database, 500);
  ASSERT_EQ(mount("tmpfs", disk_.c_str(), "tmpfs", MS_REMOUNT, "size=40m"), 0);
  const auto rest = BuildCollisionIndex(**database);
  ASSERT_TRUE(rest.ok()) << rest.status();
  EXPECT_EQ(rest->built, summary.missing);
  ExpectIndexHoldsTheRobotImages(**database);
}

// A database with an index, and the bytes of its file.
std::string MakeIndexedDatabase(const std::string& path) {
  EXPECT_TRUE(BuildCollisionIndex(*MakeFilledDatabase(40, TestCell(100, 140), path)).ok());
  return ReadFile(path + "/data.mdb");
}

TEST(CollisionIndex, DamagedTileIsFoundNeverUsedAndBuiltAnew) {
  const std::filesystem::path folder = FreshFolder();
  const std::string sound = MakeIndexedDatabase(folder / "db");
  const auto state_of = [&](const Database& database, uint64_t tile) {
    return OpenIndex(database)->State(tile);
  };
  size_t at = 0;
  size_t size = 0;
  {
    const auto database = Database::Open(folder / "db", Access::kRead);
    const auto index = OpenIndex(**database);
    const auto bytes = index->Bytes(2);
    size = bytes.size();
    at = sound.find(std::string(reinterpret_cast<const char*>(bytes.data()), size));
    ASSERT_NE(at, std::string::npos);
    EXPECT_EQ(at % 4096, 64);
  }
  // Of the index, of its header, and of the page's head before it.
  for (const size_t place : {at, at + size / 2, at + size - 1, at - 1, at - 30, at - 40, at - 48,
                             at - 54, at - 64, at - 63}) {
    SCOPED_TRACE(place - at);
    std::string bytes = sound;
    bytes[place] = static_cast<char>(bytes[place] ^ 4);
    WriteFile(folder / "db/data.mdb", bytes);
    const auto database = Database::Open(folder / "db", Access::kWrite);
    ASSERT_TRUE(database.ok()) << database.status();
    EXPECT_EQ(state_of(**database, 2), TileState::kDamaged);
    EXPECT_EQ(OpenIndex(**database)->Tile(2), nullptr);
    EXPECT_TRUE(OpenIndex(**database)->Bytes(2).empty());
    EXPECT_EQ(state_of(**database, 1), TileState::kFresh);
    EXPECT_EQ(OpenIndex(**database)->Summary().damaged, 1);
    const auto report = BuildCollisionIndex(**database);
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_EQ(report->built, 1);
    ExpectIndexHoldsTheRobotImages(**database);
  }
}

// A value of the tile before under this tile's key.
TEST(CollisionIndex, OfAnotherTileIsDamaged) {
  const std::filesystem::path folder = FreshFolder();
  MakeIndexedDatabase(folder / "db");
  const auto database = Database::Open(folder / "db", Access::kWrite);
  PutRaw(folder / "db", schema::kCollisionIndex, 1, 2, [](const auto& value) { return value; });
  EXPECT_EQ(OpenIndex(**database)->State(1), TileState::kFresh);
  EXPECT_EQ(OpenIndex(**database)->State(2), TileState::kDamaged);
}

// Whatever happens to the file: what an index says is what the records are, and the process lives.
TEST(CollisionIndex, WithFlippedBitsAnywhereNeverGivesWrongRobotImages) {
  const std::filesystem::path folder = FreshFolder();
  const std::string sound = MakeIndexedDatabase(folder / "db");
  Random random;
  uint64_t fresh = 0;
  uint64_t unusable = 0;
  std::filesystem::create_directories(folder / "spoilt");
  for (int round = 0; round < 100; ++round) {
    WriteFile(folder / "spoilt/data.mdb", WithFlippedBits(sound, random));
    const auto database = Database::Open(folder / "spoilt", Access::kRead);
    if (!database.ok()) continue;
    auto snapshot = (*database)->Read();
    if (!snapshot.ok()) continue;
    const auto index = CollisionIndex::Open(*std::move(snapshot));
    if (!index.ok()) continue;
    for (const uint64_t tile : (*index)->Tiles()) {
      const TileIndex* held = (*index)->Tile(tile);
      held == nullptr ? ++unusable : ++fresh;
      if (held == nullptr) continue;
      for (uint64_t place = 0; place < kTileSize; ++place) {
        if (!held->present().Contains(place)) continue;
        const RobotImage image = TestImage(**database, tile * kTileSize + place);
        ASSERT_EQ(held->Image(0, place), image.masks[0]);
      }
    }
  }
  std::cout << fresh << " fresh, " << unusable << " not" << std::endl;
  EXPECT_GT(fresh, 0);
  EXPECT_GT(unusable, 0);
}

TEST(CollisionIndex, IsNotOneOfAnotherKindUnderItsName) {
  const auto database = MakeFilledDatabase(40);
  const auto environment = Environment::Open(database->path());
  constexpr MDB_dbi kSubDatabases = 1;
  ASSERT_TRUE((*environment)
                  ->Update(0,
                           [&](WriteTransaction& transaction) {
                             return transaction.Put(kSubDatabases, schema::kCollisionIndex,
                                                    "something");
                           })
                  .ok());
  EXPECT_EQ(OpenIndex(*database)->Summary().fresh, 0);
  EXPECT_FALSE(BuildCollisionIndex(*database).ok());
  ExpectRecordsAreThere(*database, 40);
}

}  // namespace
}  // namespace silhouette
