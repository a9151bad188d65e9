// SPDX-License-Identifier: Apache-2.0
// Free cells of the grid, as callers see them: only if they ask for them, and never old ones.

#include "tests/server/service/watching.h"

namespace silhouette {
namespace {

using Cells = std::map<uint64_t, std::string>;

v1::WatchConfigurationSpaceRequest CellsServiceAsking(bool cells, bool nearest = false) {
  v1::WatchConfigurationSpaceRequest request;
  request.set_include_cells(cells);
  if (nearest) request.mutable_policy()->set_off_grid(v1::OFF_GRID_NEAREST);
  return request;
}

// What GetConfigurationSpace says now.
Cells CellsNow(TestServer& server, bool* exact = nullptr) {
  v1::GetConfigurationSpaceRequest request;
  request.set_include_cells(true);
  Cells cells;
  const auto messages = server.Space(request);
  if (exact != nullptr) *exact = messages.at(0).cells_exact();
  for (const auto& message : messages) {
    for (const auto& tile : message.tiles()) cells[tile.tile()] = tile.free_cells();
  }
  return cells;
}

// Where joint a is from `a` on to the next value, and b from the first.
bool IsFree(const ConfigurationGrid& grid, const Cells& cells, int a) {
  const ConfigurationNumber number = grid.NumberOf({a, 0});
  const std::string& bits = cells.at(number / kTileSize);
  return (bits.at(number % kTileSize / 8) >> (number % 8) & 1) != 0;
}

class CellsServiceTest : public ::testing::Test {
 protected:
  const std::shared_ptr<const ServedDatabase> database = NewDatabase({.index = true});
  TestServer server{database};
};

TEST_F(CellsServiceTest, AreToldOnlyToWhoAsksAndOnlyWhereTheyMatter) {
  server.Publish(SceneWithBlock(3));
  SpaceWatching plain(server, CellsServiceAsking(false));
  SpaceWatching nearest(server, CellsServiceAsking(true, /*nearest=*/true));
  for (SpaceWatching* watching : {&plain, &nearest}) {
    EXPECT_FALSE(watching->Next().first.cells_exact());
    for (const auto& [tile, bits] : watching->free_cells()) EXPECT_EQ(bits, "") << tile;
  }
  SpaceWatching with(server, CellsServiceAsking(true));
  EXPECT_TRUE(with.Next().first.cells_exact());
  EXPECT_EQ(with.free(), plain.free());
  bool exact = false;
  EXPECT_EQ(with.free_cells(), CellsNow(server, &exact));
  EXPECT_TRUE(exact);
  EXPECT_TRUE(IsFree(database->grid(), with.free_cells(), 0));
  EXPECT_FALSE(IsFree(database->grid(), with.free_cells(), 2));
  for (const auto& message : server.Space()) {
    for (const auto& tile : message.tiles()) EXPECT_EQ(tile.free_cells(), "");
  }
}

// A view sees a block where joint a is 2, another one where it is 3: no configuration of the grid
// touches blocks in two views, those between 2 and 3 do.
TEST_F(CellsServiceTest, TileOfWhichOnlyCellsChangedIsSent) {
  SceneInput apart = EmptyCellScene();
  for (const auto& [view, block] : {std::pair(0, 2), {1, 3}}) {
    apart.views[view].image = SceneMask{RobotMask(view, 0, 0) | Block(view, block)};
  }
  server.Publish(EmptyCellScene());
  SpaceWatching watching(server, CellsServiceAsking(true));
  watching.Next();
  const auto free = watching.free();
  EXPECT_TRUE(IsFree(database->grid(), watching.free_cells(), 2));
  server.Publish(apart);
  EXPECT_EQ(watching.Next().tiles, 1u);
  EXPECT_EQ(watching.free(), free);
  EXPECT_FALSE(IsFree(database->grid(), watching.free_cells(), 2));
  EXPECT_TRUE(IsFree(database->grid(), watching.free_cells(), 0));
  server.Publish(apart);
  EXPECT_EQ(watching.Next().tiles, 0u);
  EXPECT_EQ(watching.free_cells(), CellsNow(server));
}

TEST_F(CellsServiceTest, TilesWithoutCellsInTimeAreLeftOut) {
  server.Publish(SceneWithBlock(3));
  v1::GetConfigurationSpaceRequest request;
  request.set_include_cells(true);
  request.mutable_max_time();
  EXPECT_EQ(server.Space(request).at(0).tiles_left_out(), database->grid().tiles());
}

}  // namespace
}  // namespace silhouette
