// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "db/store/store.h"
#include "tests/db/store/test_cell.h"

namespace silhouette {
namespace {

using storage::v1::CellDescription;
using testing::ElementsAre;
using testing::IsEmpty;

std::vector<std::string> DifferencesAfter(const std::function<void(CellDescription&)>& change) {
  const CellDescription a = TestCell();
  CellDescription b = TestCell();
  change(b);
  return Differences(a, "the cell file", b, "the database");
}

TEST(Differences, AreNoneBetweenEqualCells) {
  EXPECT_THAT(DifferencesAfter([](CellDescription&) {}), IsEmpty());
}

TEST(Differences, DoNotCountWhatOneSideLeavesOpen) {
  EXPECT_THAT(DifferencesAfter([](CellDescription& cell) {
                const ConfigurationGrid grid = *GridOf(cell);
                for (int edge : grid.tile_edges()) cell.add_tile_edges(edge);
                cell.clear_segmentation();
                cell.mutable_views(0)->clear_image_width();
                cell.mutable_views(0)->clear_image_height();
                cell.mutable_grid_joints(0)->set_upper(1.5 + 1e-12);
              }),
              IsEmpty());
}

TEST(Differences, AreOneSentenceEach) {
  const auto expect = [](const std::function<void(CellDescription&)>& change,
                         const std::string& sentence) {
    EXPECT_THAT(DifferencesAfter(change), ElementsAre(sentence));
  };
  expect([](auto& cell) { cell.set_name("other"); },
         "cell: name is 'test cell' in the cell file, 'other' in the database");
  expect([](auto& cell) { cell.mutable_grid_joints(0)->set_steps(21); },
         "joint 'axis_1': steps is 20 in the cell file, 21 in the database");
  expect([](auto& cell) { cell.mutable_grid_joints(1)->set_upper(1.5000001); },
         "joint 'axis_2': upper is 1.5 in the cell file, 1.5000001 in the database");
  expect([](auto& cell) { cell.mutable_grid_joints(1)->set_lower(-2); },
         "joint 'axis_2': lower is -1 in the cell file, -2 in the database");
  expect([](auto& cell) { cell.mutable_grid_joints(1)->set_name("elbow"); },
         "grid joint 2: name is 'axis_2' in the cell file, 'elbow' in the database");
  expect([](auto& cell) { cell.mutable_grid_joints()->RemoveLast(); },
         "grid joint 2: name is 'axis_2' in the cell file, missing in the database");
  expect([](auto& cell) { cell.mutable_fixed_joints(0)->set_position(0.5); },
         "fixed joint 'axis_3': position is 0.25 in the cell file, 0.5 in the database");
  expect([](auto& cell) { cell.clear_fixed_joints(); },
         "fixed joint 'axis_3': position is 0.25 in the cell file, missing in the database");
  expect([](auto& cell) { cell.mutable_views(1)->set_mask_height(64); },
         "view 'top': mask size is 33x20 in the cell file, 33x64 in the database");
  expect([](auto& cell) { cell.mutable_views(0)->set_image_width(320); },
         "view 'left': image size is 640x480 in the cell file, 320x480 in the database");
  expect([](auto& cell) { cell.add_views()->set_name("right"); },
         "view 3: name is missing in the cell file, 'right' in the database");
  expect([](auto& cell) { cell.set_segmentation("min_blob_pixels: 12\nnoise_factor: 8\n"); },
         "segmentation: noise_factor is 6 in the cell file, 8 in the database");
  expect([](auto& cell) { cell.set_segmentation(cell.segmentation() + "faint_difference: 3\n"); },
         "segmentation: faint_difference is off in the cell file, 3 in the database");
}

TEST(Differences, TellTileEdgesAndTheOrderOfFixedJoints) {
  CellDescription a = TestCell();
  CellDescription b = TestCell();
  for (int edge : {64, 64}) a.add_tile_edges(edge);
  for (int edge : {32, 128}) b.add_tile_edges(edge);
  for (CellDescription* cell : {&a, &b}) cell->add_fixed_joints()->set_name("axis_4");
  b.mutable_fixed_joints()->SwapElements(0, 1);
  EXPECT_THAT(
      Differences(a, "A", b, "B"),
      ElementsAre("joint 'axis_1': tile edge is 64 in A, 32 in B",
                  "joint 'axis_2': tile edge is 64 in A, 128 in B",
                  "fixed joints: order is 'axis_3', 'axis_4' in A, 'axis_4', 'axis_3' in B"));
}

TEST(GridOf, TellsWhyADescriptionHasNoGrid) {
  CellDescription cell = TestCell();
  cell.clear_grid_joints();
  EXPECT_EQ(GridOf(cell).status(), absl::InvalidArgumentError("a grid has 1 to 7 joints, not 0"));
}

}  // namespace
}  // namespace silhouette
