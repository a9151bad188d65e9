// SPDX-License-Identifier: Apache-2.0
// Parts of a watched configuration space: what does not fit is refused, what did not come is
// unknown.
#include "clients/cpp/space_assembly.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/clients/cpp/watched_space.h"

namespace silhouette::client {
namespace {

using ::testing::HasSubstr;

constexpr ConfigurationNumber kInTile[] = {0, kTileSize, 2 * kTileSize, 3 * kTileSize};

// The update that a part completes.
SpaceUpdate Complete(SpaceAssembly& assembly, const SpacePart& part) {
  const auto update = assembly.Add(part);
  EXPECT_TRUE(update.ok()) << update.status();
  if (update.ok() && *update) return **update;
  ADD_FAILURE() << "the update is not complete";
  return {};
}

void IsRefused(const std::vector<SpacePart>& parts, const std::string& what) {
  SpaceAssembly assembly;
  for (const SpacePart& part : parts) {
    const auto update = assembly.Add(part);
    if (&part != &parts.back()) {
      ASSERT_TRUE(update.ok()) << update.status();
    } else {
      EXPECT_EQ(update.status().code(), absl::StatusCode::kInternal) << what;
      EXPECT_THAT(std::string(update.status().message()), HasSubstr(what));
    }
  }
}

TEST(SpaceAssembly, IsReadAsItWasSent) {
  SpaceAssembly assembly;
  SpacePart part = FirstUpdate(BasisOf(5));
  part.set_skipped_scenes(2);
  const SpaceUpdate update = Complete(assembly, part);
  EXPECT_EQ(update.basis.scene_id(), 5u);
  EXPECT_FALSE(update.unknown);
  EXPECT_EQ(update.skipped_scenes, 2u);
  EXPECT_EQ(update.tiles_changed, 3u);
  EXPECT_TRUE(update.whole);
  EXPECT_EQ(update.map->grid, WatchedGrid());
  EXPECT_EQ(update.map->StateAt(kInTile[0]), State::kFree);
  EXPECT_EQ(update.map->StateAt(kInTile[1]), State::kOccupied);
  EXPECT_EQ(update.map->StateAt(kInTile[3]), State::kUnknown) << "was not sent";
  EXPECT_EQ(update.map->StateAt(WatchedGrid().number_limit()), State::kUnknown);
}

TEST(SpaceAssembly, MissingUpdateIsNoticed) {
  const SpacePart whole = FirstUpdate(BasisOf(5));
  IsRefused({whole, Update(BasisOf(7))}, "update of scene 6 or of a later one, before 7");
  IsRefused({whole, Update(BasisOf(6)), Update(BasisOf(9))}, "update of scene 7");
  SpaceAssembly assembly;
  Complete(assembly, whole);
  SpacePart skips = Update(BasisOf(9));
  skips.set_skipped_scenes(3);
  Complete(assembly, skips);
  Complete(assembly, Update(BasisOf(9)));
  Complete(assembly, Update(BasisOf(10)));
}

TEST(SpaceAssembly, CellsAreFreeOnlyWhereTheyAreToldToBe) {
  SpacePart part = FirstUpdate(BasisOf(5));
  part.mutable_tiles(0)->set_free_cells(std::string(1, '\x01') + std::string(511, '\0'));
  part.mutable_tiles(1)->set_free_cells(std::string(512, '\xff'));  // none begins at a free one
  SpaceAssembly assembly;
  SpaceUpdate update = Complete(assembly, part);
  EXPECT_EQ(update.map->CellAt(0), CellState::kFree);
  EXPECT_EQ(update.map->CellAt(1), CellState::kUnknown);
  EXPECT_EQ(update.map->CellAt(kInTile[1]), CellState::kUnknown);
  EXPECT_EQ(update.map->CellAt(kInTile[2]), CellState::kUnknown) << "an older server";
  EXPECT_EQ(update.map->CellAt(kInTile[3]), CellState::kUnknown) << "was not sent";
  EXPECT_EQ(update.map->CellAt(WatchedGrid().number_limit()), CellState::kUnknown);
  part = Update(BasisOf(6));
  part.set_cells_exact(true);
  update = Complete(assembly, part);
  EXPECT_EQ(update.map->CellAt(0), CellState::kFree);
  EXPECT_EQ(update.map->CellAt(1), CellState::kOccupied);
  EXPECT_EQ(update.map->CellAt(kInTile[2]), CellState::kUnknown);
  EXPECT_EQ(Complete(assembly, Update(BasisOf(7))).map->CellAt(1), CellState::kUnknown);
  SpacePart broken = Update(BasisOf(8));
  AddTile(broken, 0, true);
  broken.mutable_tiles(0)->set_free_cells("short");
  EXPECT_FALSE(assembly.Add(broken).ok());
}

TEST(SpaceAssembly, CountsWhenItsLastPartIsThere) {
  SpacePart first = FirstUpdate(BasisOf(5));
  first.set_last_part(false);
  SpacePart last;
  AddTile(last, 3, true);
  last.set_last_part(true);
  SpaceAssembly assembly;
  const auto waiting = assembly.Add(first);
  ASSERT_TRUE(waiting.ok()) << waiting.status();
  EXPECT_FALSE(*waiting);
  const SpaceUpdate update = Complete(assembly, last);
  EXPECT_EQ(update.tiles_changed, 4u);
  EXPECT_EQ(update.map->StateAt(kInTile[0]), State::kFree);
  EXPECT_EQ(update.map->StateAt(kInTile[3]), State::kFree);
}

TEST(SpaceAssembly, LaterUpdateChangesOnlyTheTilesThatItSends) {
  SpaceAssembly assembly;
  const SpaceUpdate before = Complete(assembly, FirstUpdate(BasisOf(5)));
  SpacePart part = Update(BasisOf(6));
  AddTile(part, 0, false);
  const SpaceUpdate after = Complete(assembly, part);
  EXPECT_FALSE(after.whole);
  EXPECT_EQ(after.map->StateAt(kInTile[0]), State::kOccupied);
  EXPECT_EQ(after.map->StateAt(kInTile[2]), State::kFree);
  EXPECT_EQ(before.map->StateAt(kInTile[0]), State::kFree) << "a map never changes";
}

TEST(SpaceAssembly, WholeUpdateTakesThePlaceOfEverything) {
  SpaceAssembly assembly;
  Complete(assembly, FirstUpdate(BasisOf(5)));
  SpacePart part = Update(BasisOf(6), /*whole=*/true);
  AddTile(part, 3, true);
  const SpaceUpdate update = Complete(assembly, part);
  EXPECT_EQ(update.map->StateAt(kInTile[0]), State::kUnknown);
  EXPECT_EQ(update.map->StateAt(kInTile[3]), State::kFree);
}

TEST(SpaceAssembly, AbsentPlacesAndPlacesOfTwoStatesAreNeverFree) {
  SpacePart part = FirstUpdate(BasisOf(5));
  part.mutable_tiles(0)->mutable_occupied()->at(0) = 1;
  SpaceAssembly assembly;
  const SpaceUpdate update = Complete(assembly, part);
  EXPECT_EQ(update.map->StateAt(0), State::kUnknown);
  EXPECT_EQ(update.map->StateAt(1), State::kFree);
  for (ConfigurationNumber n = kInTile[2]; n < kInTile[3]; ++n) {
    ASSERT_EQ(update.map->StateAt(n) == State::kFree, WatchedGrid().Contains(n)) << n;
  }
}

TEST(SpaceAssembly, WhatTheServerCallsUnknownIsUnknownUntilTheNextUpdate) {
  SpaceAssembly assembly;
  Complete(assembly, FirstUpdate(BasisOf(5)));
  SpacePart stale = Update(BasisOf(5));
  stale.set_unknown_reason(v1::Verdict::REASON_SCENE_STALE);
  EXPECT_EQ(Complete(assembly, stale).unknown, Reason::kSceneStale);
  SpacePart newer = Update(BasisOf(5));
  newer.set_unknown_reason(static_cast<v1::Verdict::Reason>(202));
  EXPECT_EQ(Complete(assembly, newer).unknown, Reason::kUnspecified) << "of a newer server";
  const SpaceUpdate back = Complete(assembly, Update(BasisOf(6)));
  EXPECT_FALSE(back.unknown);
  EXPECT_EQ(back.map->StateAt(kInTile[0]), State::kFree);
  v1::Basis none = BasisOf(0);
  EXPECT_EQ(Complete(assembly, Update(none)).unknown, Reason::kNoScene);
}

TEST(SpaceAssembly, PartsThatCannotFollowOneAnotherAreRefused) {
  const SpacePart whole = FirstUpdate(BasisOf(5));
  IsRefused({Update(BasisOf(5))}, "the first update is not whole");
  SpacePart other = Update(BasisOf(6));
  other.mutable_basis()->set_database_generation(8);
  IsRefused({whole, other}, "the database changed");
  SpacePart open = whole;
  open.set_last_part(false);
  IsRefused({open, whole}, "before the previous one has ended");
  IsRefused({open, Update(BasisOf(6))}, "before the previous one has ended");
  SpacePart again;
  AddTile(again, 1, true);
  IsRefused({open, again}, "tile 1 comes twice");
}

TEST(SpaceAssembly, PartsThatCannotBeAreRefused) {
  const SpacePart whole = FirstUpdate(BasisOf(5));
  SpacePart part = whole;
  part.clear_basis();
  IsRefused({part}, "has no basis");
  part = whole;
  part.clear_grid();
  IsRefused({part}, "a grid belongs");
  part = Update(BasisOf(6));
  Set(WatchedGrid(), part.mutable_grid());
  IsRefused({whole, part}, "a grid belongs");
  part = whole;
  part.mutable_grid()->mutable_joints(0)->set_steps(0);
  IsRefused({part}, "joint 'a'");
  part = whole;
  AddTile(part, 4, true);
  IsRefused({part}, "tile 4 is beyond");
  part = whole;
  AddTile(part, 1, true);
  IsRefused({part}, "tile 1 comes twice");
  part = whole;
  part.mutable_tiles(1)->mutable_occupied()->pop_back();
  IsRefused({part}, "tile 1 has 511 bytes");
  part = whole;
  part.mutable_tiles(1)->mutable_free()->push_back('\0');
  IsRefused({part}, "tile 1 has 513 bytes");
  part = whole;
  part.set_unknown_reason(v1::Verdict::REASON_SCENE_STALE);
  IsRefused({part}, "has tiles");
}

TEST(SpaceAssembly, GridThatIsTooLargeIsRefused) {
  SpacePart part = Update(BasisOf(5), /*whole=*/true);
  part.mutable_grid()->mutable_joints(0)->set_steps(1'000'000);
  part.mutable_grid()->mutable_joints(1)->set_steps(1'000'000);
  SpaceAssembly assembly;
  EXPECT_EQ(assembly.Add(part).status().code(), absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace silhouette::client
