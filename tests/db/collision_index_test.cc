// The collision index in the database: what is fresh, what is stale, and what is never used.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <iostream>
#include <thread>

#include "db/collision_index.h"
#include "tests/db/test_cell.h"

namespace silhouette {
namespace {

using Access = Database::Access;

// A database of 3 tiles (one of them not full), with a record for every configuration but those of
// `left_out`.
std::unique_ptr<Database> MakeDatabase(const std::string& path,
                                       const storage::v1::CellDescription& cell = TestCell(80, 90),
                                       uint64_t every = 1) {
  auto database = Database::Create(path, cell);
  EXPECT_TRUE(database.ok()) << database.status();
  auto writer = (*database)->Write("test", absl::Hours(1));
  for (ConfigurationNumber number : AllNumbers((*database)->grid())) {
    if (number % every != 0) continue;
    EXPECT_TRUE(writer->Put(TestImage(**database, number)).ok());
  }
  EXPECT_TRUE(writer->Commit().ok());
  return *std::move(database);
}

std::shared_ptr<const CollisionIndex> OpenIndex(const Database& database) {
  auto snapshot = database.Read();
  EXPECT_TRUE(snapshot.ok()) << snapshot.status();
  auto index = CollisionIndex::Open(*std::move(snapshot));
  EXPECT_TRUE(index.ok()) << index.status();
  return *std::move(index);
}

IndexBuildReport Build(Database& database, const IndexBuildOptions& options = {}) {
  const auto report = BuildCollisionIndex(database, options);
  EXPECT_TRUE(report.ok()) << report.status();
  return *report;
}

// That every tile is fresh and holds just the robot images.
void ExpectIndexHoldsTheRobotImages(const Database& database) {
  const auto index = OpenIndex(database);
  const auto snapshot = database.Read();
  std::map<uint64_t, PlaceSet> present;
  const auto visit = [&](ConfigurationNumber number, const absl::StatusOr<RobotImage>& image) {
    present.try_emplace(number / kTileSize);
    if (!image.ok() || image->excluded) return true;
    present[number / kTileSize].Insert(number % kTileSize);
    const TileIndex* tile = index->Tile(number / kTileSize);
    if (tile == nullptr) {
      ADD_FAILURE() << "no index of tile " << number / kTileSize;
      return false;
    }
    for (size_t view = 0; view < image->masks.size(); ++view) {
      EXPECT_EQ(tile->Image(static_cast<int>(view), number % kTileSize), image->masks[view])
          << number;
    }
    return true;
  };
  ASSERT_TRUE(snapshot->ForEach(visit).ok());
  EXPECT_EQ(index->Tiles().size(), present.size());
  for (const auto& [tile, places] : present) {
    ASSERT_EQ(index->State(tile), TileState::kFresh) << tile;
    EXPECT_EQ(index->Tile(tile)->present(), places) << tile;
  }
}

TEST(CollisionIndex, HoldsTheRobotImages) {
  const FreshFolder folder;
  const auto database = MakeDatabase(folder / "db");
  const IndexBuildReport report = Build(*database);
  EXPECT_EQ(report.built, report.tiles);
  EXPECT_GT(report.tiles, 1);
  ExpectIndexHoldsTheRobotImages(*database);
}

}  // namespace
}  // namespace silhouette
