// SPDX-License-Identifier: Apache-2.0
// The collision index in the database: what it holds, when it is stale, who may use it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "db/store/collision_index.h"
#include "db/store/environment.h"
#include "db/store/raw_records.h"
#include "db/store/robot_image_format.h"
#include "db/store/schema.h"
#include "tests/db/store/index_checks.h"
#include "tests/db/store/test_database.h"

namespace silhouette {
namespace {

using testing::ElementsAre;

TEST(CollisionIndex, HoldsTheRobotImages) {
  const auto database = MakeFilledDatabase(3);
  const IndexBuildReport report = BuildIndex(*database);
  EXPECT_GT(report.tiles, 3);
  EXPECT_EQ(report.built, report.tiles);
  EXPECT_FALSE(report.stopped);
  ExpectIndexHoldsTheRobotImages(*database);
  const CollisionIndexSummary summary = OpenIndex(*database)->Summary();
  EXPECT_EQ(summary.fresh, summary.tiles);
  EXPECT_EQ(summary.bytes, report.bytes);
}

class CollisionIndexOfMasks : public testing::TestWithParam<MaskSize> {};

TEST_P(CollisionIndexOfMasks, HoldsTheRobotImagesAlignedToCacheLines) {
  storage::v1::CellDescription cell = TestCell(100, 140);
  cell.mutable_views(0)->set_mask_width(GetParam().width);
  cell.mutable_views(0)->set_mask_height(GetParam().height);
  cell.mutable_views(1)->set_mask_width(1);
  cell.mutable_views(1)->set_mask_height(1);
  const auto database = MakeFilledDatabase(313, cell);
  BuildIndex(*database);
  ExpectIndexHoldsTheRobotImages(*database);
  const auto index = OpenIndex(*database);
  for (const uint64_t tile : index->Tiles()) {
    EXPECT_EQ(reinterpret_cast<uintptr_t>(index->Bytes(tile).data()) % 64, 0) << tile;
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, CollisionIndexOfMasks,
                         testing::Values(MaskSize{1, 1}, MaskSize{64, 64}, MaskSize{128, 96},
                                         MaskSize{256, 192}, MaskSize{320, 240}),
                         [](const auto& tested) {
                           return std::to_string(tested.param.width) + "x" +
                                  std::to_string(tested.param.height);
                         });

TEST(CollisionIndex, CheckedAgainFindsWhatChangedInItsFile) {
  const auto database = MakeFilledDatabase(7);
  BuildIndex(*database);
  const auto index = OpenIndex(*database);
  const std::vector<uint64_t> tiles = index->Tiles();
  for (const uint64_t tile : tiles) {
    const auto bytes = index->CheckAgain(tile);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    EXPECT_GE(*bytes, index->Bytes(tile).size());
  }
  EXPECT_EQ(*index->CheckAgain(1'000'000), 0u);

  const std::filesystem::path path = database->path() + "/data.mdb";
  const std::string sound = ReadFile(path);
  const std::span<const std::byte> bytes = index->Bytes(tiles[1]);
  const std::string held(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  const size_t at = sound.find(held);
  ASSERT_NE(at, std::string::npos);
  file.seekp(static_cast<std::streamoff>(at + held.size() / 2)).put('x').flush();
  EXPECT_NE(index->Tile(tiles[1]), nullptr) << "which was checked when it was first asked for";
  EXPECT_TRUE(index->CheckAgain(tiles[0]).ok());
  const absl::Status damaged = index->CheckAgain(tiles[1]).status();
  EXPECT_EQ(damaged.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(damaged.message()),
              testing::HasSubstr(absl::StrCat("index of tile ", tiles[1], " fails its checksum")));

  std::filesystem::resize_file(path, 8192);  // no page of the index is left under the map
  EXPECT_EQ(index->CheckAgain(tiles[0]).status().code(), absl::StatusCode::kDataLoss);
  std::filesystem::resize_file(path, sound.size());
}

TEST(CollisionIndex, OfNoRobotImagesIsEmpty) {
  const auto database = MakeDatabase();
  for (int i = 0; i < 2; ++i) {
    const auto index = OpenIndex(*database);
    EXPECT_TRUE(index->Tiles().empty());
    EXPECT_EQ(index->State(0), TileState::kNoRecords);
    EXPECT_EQ(index->Tile(0), nullptr);
    EXPECT_EQ(index->State(1'000'000), TileState::kNoRecords);
    const IndexBuildReport report = BuildIndex(*database);
    EXPECT_EQ(report.tiles, 0);
    EXPECT_FALSE(report.stopped);
  }
}

TEST(CollisionIndex, IsMissingInADatabaseThatHasNone) {
  const auto database = MakeFilledDatabase();
  const auto index = OpenIndex(*database);
  const CollisionIndexSummary summary = index->Summary();
  EXPECT_GT(summary.tiles, 3);
  EXPECT_EQ(summary.missing, summary.tiles);
  for (const uint64_t tile : index->Tiles()) EXPECT_EQ(index->Tile(tile), nullptr);
}

TEST(CollisionIndex, NeedsTheRightToWriteToBeBuilt) {
  const std::string path = MakeFilledDatabase()->path();
  const auto database = Database::Open(path, Access::kRead);
  EXPECT_EQ(BuildCollisionIndex(**database).status().code(), absl::StatusCode::kFailedPrecondition);
}

// What may happen to the records of a tile, by Silhouette and by other programs.
struct Change {
  std::string name;
  std::function<void(Database&)> make;
};

// Writes below the store's own functions.
void ChangeRaw(const std::string& path, const Environment::Change& change) {
  const auto environment = Environment::Open(path);
  ASSERT_TRUE(environment.ok());
  ASSERT_TRUE((*environment)->Update(0, change).ok());
}

// In tile 1: there is a record, and there is none.
constexpr ConfigurationNumber kThere = kTileSize + 5 - kTileSize % 5 + 5;
constexpr ConfigurationNumber kNotThere = kThere + 1;

std::string_view View(const schema::NumberKey& key) { return {key.data(), key.size()}; }

class CollisionIndexAfter : public testing::TestWithParam<Change> {};

TEST_P(CollisionIndexAfter, ChangeIsStaleInThatTileOnlyAndMendedByBuildingIt) {
  const auto database = MakeFilledDatabase();
  ASSERT_TRUE(*database->Read()->Contains(kThere));
  ASSERT_FALSE(*database->Read()->Contains(kNotThere));
  BuildIndex(*database);
  const auto before = OpenIndex(*database);
  GetParam().make(*database);
  EXPECT_THAT(TilesIn(*database, TileState::kStale), ElementsAre(1));
  EXPECT_EQ(OpenIndex(*database)->Tile(1), nullptr);
  EXPECT_NE(before->Tile(1), nullptr);  // of its own state
  ExpectIndexHoldsTheRobotImages(*database, false);
  EXPECT_EQ(BuildIndex(*database).built, 1);
  ExpectIndexHoldsTheRobotImages(*database);
  EXPECT_LE(BuildIndex(*database).built, 1);  // 1 where a record cannot be read
}

INSTANTIATE_TEST_SUITE_P(
    Records, CollisionIndexAfter,
    testing::Values(Change{"Replaced",
                           [](Database& database) {
                             RobotImage image = TestImage(database, kThere, 7);
                             image.number = kThere;
                             PutAll(database, {image}, true);
                           }},
                    Change{"Added",
                           [](Database& database) {
                             PutAll(database, {TestImage(database, kNotThere)}, false);
                           }},
                    Change{"Excluded",
                           [](Database& database) {
                             RobotImage image;
                             image.number = kNotThere;
                             image.excluded = true;
                             PutAll(database, {image}, false);
                           }},
                    Change{"ReplacedUnannounced",
                           [](Database& database) {
                             ChangeRaw(database.path(), [&](WriteTransaction& transaction) {
                               return transaction.Put(
                                   transaction.environment().robot_images(),
                                   View(schema::EncodeKey(kThere)),
                                   EncodeRobotImage(TestImage(database, kThere, 9)));
                             });
                           }},
                    Change{"DeletedUnannounced",
                           [](Database& database) {
                             ChangeRaw(database.path(), [](WriteTransaction& transaction) {
                               return transaction.Delete(transaction.environment().robot_images(),
                                                         View(schema::EncodeKey(kThere)));
                             });
                           }},
                    Change{"SpoiltInItsChecksum",
                           [](Database& database) {
                             std::string value = EncodeRobotImage(TestImage(database, kThere));
                             value[3] = static_cast<char>(value[3] ^ 16);
                             ChangeRaw(database.path(), [&](WriteTransaction& transaction) {
                               return transaction.Put(transaction.environment().robot_images(),
                                                      View(schema::EncodeKey(kThere)), value);
                             });
                           }}),
    [](const auto& tested) { return tested.param.name; });

TEST(CollisionIndex, StaysFreshWhenOnlyTheCalibrationOrTheReferencesChange) {
  const auto database = MakeFilledDatabase();
  BuildIndex(*database);
  const uint64_t generation = database->Read()->generation();
  storage::v1::References references;
  references.add_views();
  references.add_views();
  ASSERT_TRUE(database->SetReferences(references, "test").ok());
  storage::v1::Calibration calibration;
  storage::v1::FundamentalMatrix* matrix = calibration.add_fundamental_matrices();
  matrix->set_view_b(1);
  for (int i = 0; i < 9; ++i) matrix->add_f(i == 5 ? 1 : i == 7 ? -1 : 0);
  ASSERT_TRUE(database->SetCalibration(calibration, "test").ok());
  EXPECT_EQ(database->Read()->generation(), generation + 2);
  ExpectIndexHoldsTheRobotImages(*database);
  EXPECT_EQ(BuildIndex(*database).built, 0);
}

TEST(CollisionIndex, BuildingDoesNotRaiseTheGeneration) {
  const auto database = MakeFilledDatabase();
  const uint64_t generation = database->Read()->generation();
  BuildIndex(*database);
  EXPECT_EQ(database->Read()->generation(), generation);
}

TEST(CollisionIndex, BuildsAllTilesWhereAskedTo) {
  const auto database = MakeFilledDatabase();
  const uint64_t tiles = BuildIndex(*database).built;
  EXPECT_EQ(BuildIndex(*database).built, 0);
  EXPECT_EQ(BuildIndex(*database, {.all = true}).built, tiles);
  ExpectIndexHoldsTheRobotImages(*database);
}

TEST(CollisionIndex, OfATileThatLostItsRecordsIsRemoved) {
  const auto database = MakeFilledDatabase();
  BuildIndex(*database);
  ChangeRaw(database->path(), [&](WriteTransaction& transaction) {
    absl::Status status;
    for (ConfigurationNumber number = kTileSize; number < 2 * kTileSize; ++number) {
      status.Update(transaction.Delete(transaction.environment().robot_images(),
                                       View(schema::EncodeKey(number))));
    }
    return status;
  });
  EXPECT_EQ(OpenIndex(*database)->State(1), TileState::kStale);
  EXPECT_EQ(BuildIndex(*database).removed, 1);
  EXPECT_EQ(OpenIndex(*database)->State(1), TileState::kNoRecords);
  ExpectIndexHoldsTheRobotImages(*database);
}

// A record that rots keeps its checksum, and gets it back when it is restored byte by byte.
TEST(CollisionIndex, TakesInARecordThatCanBeReadAgain) {
  const auto database = MakeFilledDatabase();
  RobotImage image = TestImage(*database, kThere);
  for (uint64_t seed = 1; image.excluded; ++seed) image = TestImage(*database, kThere, seed);
  const std::string sound = EncodeRobotImage(image);
  const auto store = [&](const std::string& value) {
    ChangeRaw(database->path(), [&](WriteTransaction& transaction) {
      return transaction.Put(transaction.environment().robot_images(),
                             View(schema::EncodeKey(kThere)), value);
    });
  };
  std::string rotten = sound;
  rotten.back() = static_cast<char>(rotten.back() ^ 1);
  store(rotten);
  EXPECT_EQ(BuildIndex(*database).unreadable, 1);
  EXPECT_FALSE(OpenIndex(*database)->Tile(1)->present().Contains(kThere % kTileSize));
  EXPECT_EQ(OpenIndex(*database)->Summary().unreadable, 1);
  store(sound);
  EXPECT_EQ(BuildIndex(*database).built, 1);
  EXPECT_TRUE(OpenIndex(*database)->Tile(1)->present().Contains(kThere % kTileSize));
  ExpectIndexHoldsTheRobotImages(*database);
}

TEST(CollisionIndex, OutlivesItsDatabase) {
  auto database = MakeFilledDatabase();
  BuildIndex(*database);
  const auto index = OpenIndex(*database);
  const auto tiles = ReadTiles(index->snapshot());
  database.reset();
  for (const auto& [tile, images] : tiles) {
    ExpectHolds(*index->Tile(tile), index->trees(), images);
  }
}

// Another process builds it in a database that this one has open.
TEST(CollisionIndex, BuiltByAnotherProcessIsFoundByTheNextSnapshot) {
  const std::string path = MakeFilledDatabase()->path();
  int go[2];
  ASSERT_EQ(pipe(go), 0);
  const pid_t child = fork();
  if (child == 0) {
    char byte = 0;
    if (read(go[0], &byte, 1) != 1) _exit(1);
    const auto database = Database::Open(path, Access::kWrite);
    _exit(database.ok() && BuildCollisionIndex(**database).ok() ? 0 : 2);
  }
  const auto database = Database::Open(path, Access::kRead);
  ASSERT_TRUE(database.ok());
  EXPECT_THAT(TilesIn(**database, TileState::kFresh), ElementsAre());
  auto earlier = (*database)->Read();
  ASSERT_EQ(write(go[1], "g", 1), 1);
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  ExpectIndexHoldsTheRobotImages(**database);
  const auto of_earlier = CollisionIndex::Open(*std::move(earlier));
  ASSERT_TRUE(of_earlier.ok());
  EXPECT_EQ((*of_earlier)->Summary().missing, (*of_earlier)->Summary().tiles);
  close(go[0]);
  close(go[1]);
}

TEST(CollisionIndex, IsCopiedByCompactAndCountedAsUsed) {
  const std::string copied = FreshFolder() / "copy";
  const auto database = MakeFilledDatabase();
  const uint64_t before = database->GetUsage()->used_bytes;
  const IndexBuildReport report = BuildIndex(*database);
  EXPECT_GE(database->GetUsage()->used_bytes, before + report.bytes);
  ASSERT_TRUE(database->Compact(copied).ok());
  const auto copy = Database::Open(copied, Access::kRead);
  ASSERT_TRUE(copy.ok()) << copy.status();
  ExpectIndexHoldsTheRobotImages(**copy);
}

// Records that are small, with an index that is large: what is held must not grow with it.
TEST(CollisionIndex, IsBuiltInBoundedMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer takes memory of its own";
#endif
  const std::filesystem::path folder = FreshFolder();
  storage::v1::CellDescription cell = TestCell(600, 600);
  std::mt19937_64 random(3);
  const pid_t child = fork();
  if (child == 0) {
    auto database = Database::Create(folder / "db", cell);
    auto writer = (*database)->Write("test", absl::Hours(1));
    uint64_t tiles = 0;
    for (uint64_t tile = 0; tile < (*database)->grid().tiles(); ++tile, ++tiles) {
      for (uint64_t place = 0; place < 20; ++place) {
        RobotImage image;
        image.number = tile * kTileSize + place;
        if (!(*database)->grid().Contains(image.number)) continue;
        for (const MaskSize size : (*database)->mask_sizes()) {
          image.masks.push_back(RandomMask(size, random, true));
        }
        if (!writer->Put(image).ok()) _exit(1);
      }
    }
    if (!writer->Commit().ok()) _exit(2);
    // The map of the file is no part of this; what the threads' heaps reserve is.
    constexpr rlim_t kMost = rlim_t{96} << 20;
    const rlimit limit{kMost, kMost};
    if (setrlimit(RLIMIT_DATA, &limit) != 0) _exit(3);
    const auto report = BuildCollisionIndex(**database, {.buffer = 1 << 20});
    if (!report.ok() || report->built != tiles) _exit(4);
    _exit(report->bytes > 2 * kMost ? 0 : 5);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0) << "exit code " << WEXITSTATUS(status);
}

}  // namespace
}  // namespace silhouette
