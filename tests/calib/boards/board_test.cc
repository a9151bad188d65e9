// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/board.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace silhouette {
namespace {

BoardDescription TwoByThree() {
  return {.name = "wall", .rows = 2, .columns = 3, .tag_size = 0.04, .gap = 0.01, .first_id = 10};
}

TEST(Board, TagsGoRowByRowFromTheTopLeft) {
  const Board board(TwoByThree());
  EXPECT_EQ(board.tags(), 6);
  const TagCorners last = board.CornersOf(15);
  EXPECT_TRUE(last[0].isApprox(Eigen::Vector3d(0.10, 0.09, 0)));
  EXPECT_TRUE(last[1].isApprox(Eigen::Vector3d(0.14, 0.09, 0)));
  EXPECT_TRUE(last[2].isApprox(Eigen::Vector3d(0.14, 0.05, 0)));
  EXPECT_TRUE(last[3].isApprox(Eigen::Vector3d(0.10, 0.05, 0)));
}

TEST(Board, HasNoOtherTags) {
  const Board board(TwoByThree());
  EXPECT_FALSE(board.HasTag(9));
  EXPECT_FALSE(board.HasTag(16));
  EXPECT_THROW(board.CornersOf(16), std::out_of_range);
}

TEST(Board, IsALatticeIfTheGapIsATag) {
  BoardDescription description = TwoByThree();
  EXPECT_FALSE(Board(description).IsLattice());
  description.gap = description.tag_size;
  EXPECT_TRUE(Board(description).IsLattice());
}

TEST(Board, ImpossibleOnesAreRefused) {
  const auto refused = [](auto change) {
    BoardDescription description = TwoByThree();
    change(description);
    EXPECT_THROW(Board{description}, std::invalid_argument);
  };
  refused([](auto& d) { d.name.clear(); });
  refused([](auto& d) { d.family.clear(); });
  refused([](auto& d) { d.rows = 0; });
  refused([](auto& d) { d.tag_size = 0; });
  refused([](auto& d) { d.gap = -0.01; });
  refused([](auto& d) { d.first_id = -1; });
}

}  // namespace
}  // namespace silhouette
