// SPDX-License-Identifier: Apache-2.0
// What a fresh collision index is: the robot images, and nothing else.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <random>
#include <vector>

#include "db/store/collision_index.h"
#include "db/store/store.h"

namespace silhouette {

inline std::shared_ptr<const CollisionIndex> OpenIndex(const Database& database) {
  auto snapshot = database.Read();
  EXPECT_TRUE(snapshot.ok()) << snapshot.status();
  auto index = CollisionIndex::Open(*std::move(snapshot));
  EXPECT_TRUE(index.ok()) << index.status();
  return *std::move(index);
}

inline IndexBuildReport BuildIndex(Database& database, const IndexBuildOptions& options = {}) {
  const auto report = BuildCollisionIndex(database, options);
  EXPECT_TRUE(report.ok()) << report.status();
  return *report;
}

// The tiles of the index in a state.
inline std::vector<uint64_t> TilesIn(const Database& database, TileState state) {
  const auto index = OpenIndex(database);
  std::vector<uint64_t> tiles;
  for (const uint64_t tile : index->Tiles()) {
    if (index->State(tile) == state) tiles.push_back(tile);
  }
  return tiles;
}

// The records of a state of the database, by the tile.
inline std::map<uint64_t, std::vector<RobotImage>> ReadTiles(const Snapshot& snapshot) {
  std::map<uint64_t, std::vector<RobotImage>> tiles;
  const auto visit = [&](ConfigurationNumber number, absl::StatusOr<RobotImage> image) {
    std::vector<RobotImage>& tile = tiles[number / kTileSize];
    if (image.ok() && !image->excluded) tile.push_back(*std::move(image));
    return true;
  };
  EXPECT_TRUE(snapshot.ForEach(visit).ok());
  return tiles;
}

// That an index gives just these robot images back, and finds those that a plane touches.
inline void ExpectHolds(const TileIndex& index, std::span<const PixelTree> trees,
                        const std::vector<RobotImage>& images) {
  std::mt19937_64 random(images.size());
  PlaceSet present;
  for (const RobotImage& image : images) {
    const uint64_t place = image.number % kTileSize;
    present.Insert(place);
    for (size_t view = 0; view < trees.size(); ++view) {
      ASSERT_EQ(index.Image(static_cast<int>(view), place), image.masks[view]) << image.number;
    }
  }
  EXPECT_EQ(index.present(), present);
  for (size_t view = 0; view < trees.size(); ++view) {
    for (int i = 0; i < 4; ++i) {
      const MaskSize size = trees[view].size();
      const int x0 = static_cast<int>(random() % static_cast<uint64_t>(size.width));
      const int y0 = static_cast<int>(random() % static_cast<uint64_t>(size.height));
      const Mask plane = Mask::FromPredicate(
          size, [&](int x, int y) { return x >= x0 && x < x0 + 5 && y >= y0 && y < y0 + 9; });
      PlaceSet expected;
      for (const RobotImage& image : images) {
        if (Intersects(plane.words(), image.masks[view].words())) {
          expected.Insert(image.number % kTileSize);
        }
      }
      PlaceSet touching;
      index.AddTouching(static_cast<int>(view), trees[view].Cover(plane), touching);
      EXPECT_EQ(touching, expected);
    }
  }
}

// That no tile says anything but its records; with `all_fresh`, that each does.
inline void ExpectIndexHoldsTheRobotImages(const Database& database, bool all_fresh = true) {
  const auto index = OpenIndex(database);
  const auto tiles = ReadTiles(index->snapshot());
  for (const auto& [tile, images] : tiles) {
    SCOPED_TRACE(tile);
    const TileIndex* held = index->Tile(tile);
    EXPECT_EQ(held != nullptr, index->State(tile) == TileState::kFresh);
    if (all_fresh) {
      ASSERT_NE(held, nullptr);
    }
    if (held != nullptr) ExpectHolds(*held, index->trees(), images);
  }
  if (all_fresh) {
    EXPECT_EQ(index->Tiles().size(), tiles.size());
  }
}

}  // namespace silhouette
