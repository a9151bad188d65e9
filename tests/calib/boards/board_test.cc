// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdexcept>

#include "calib/boards/board.h"

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

using testing::HasSubstr;
using testing::StartsWith;

constexpr char kBoardFileFile[] = R"(
- name: wall
  rows: 2
  columns: 3
  tag_size: 0.04
  gap: 0.04
- name: flange
  family: tag36h11
  tag_size: 0.06
  first_id: 7
)";

std::string BoardFileMessageFor(const std::string& text) {
  return std::string(BoardsFromText(text, "boards.yaml").status().message());
}

TEST(BoardFile, GivesBoardsWithWhatIsNotSaid) {
  const auto boards = BoardsFromText(kBoardFileFile, "boards.yaml");
  ASSERT_TRUE(boards.ok()) << boards.status();
  ASSERT_EQ(boards->size(), 2u);
  const BoardDescription& wall = (*boards)[0].description();
  EXPECT_EQ(wall.family, "tagStandard41h12");
  EXPECT_EQ(wall.rows, 2);
  EXPECT_EQ(wall.columns, 3);
  EXPECT_EQ(wall.gap, 0.04);
  EXPECT_EQ(wall.first_id, 0);
  EXPECT_EQ((*boards)[1].description().family, "tag36h11");
  EXPECT_EQ((*boards)[1].tags(), 1);
  EXPECT_TRUE((*boards)[1].HasTag(7));
}

TEST(BoardFile, GivesBackWhatWasWritten) {
  const std::vector<Board> boards = {Board({.name = "a: \"b\" # c",
                                            .family = "tag36h11",
                                            .rows = 3,
                                            .columns = 5,
                                            .tag_size = 0.1 / 3,
                                            .gap = 0.08 / 3,
                                            .first_id = 17}),
                                     Board({.name = "2", .tag_size = 0.05, .first_id = 3})};
  const auto read = BoardsFromText(BoardFileText(boards), "boards.yaml");
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), boards.size());
  for (size_t i = 0; i < boards.size(); ++i) {
    const BoardDescription& a = boards[i].description();
    const BoardDescription& b = (*read)[i].description();
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.family, b.family);
    EXPECT_EQ(a.rows, b.rows);
    EXPECT_EQ(a.columns, b.columns);
    EXPECT_EQ(a.tag_size, b.tag_size);
    EXPECT_EQ(a.gap, b.gap);
    EXPECT_EQ(a.first_id, b.first_id);
  }
}

TEST(BoardFile, MistakesAreToldWithLineAndMend) {
  EXPECT_THAT(BoardFileMessageFor("- name: a\n  tagsize: 0.04\n"),
              testing::AllOf(StartsWith("boards.yaml:2:"), HasSubstr("'tag_size'")));
  EXPECT_THAT(BoardFileMessageFor("- name: a\n"), HasSubstr("'tag_size' is missing"));
  EXPECT_THAT(BoardFileMessageFor("- name: a\n  tag_size: 0.04\n  colums: 3\n"),
              HasSubstr("'columns'"));
  EXPECT_THAT(BoardFileMessageFor("- name: a\n  rows: 2\n  tag_size: 0.04\n"), HasSubstr("'gap'"));
  EXPECT_THAT(BoardFileMessageFor("- name: a\n  tag_size: -1\n"),
              HasSubstr("tag_size must be positive"));
  EXPECT_THAT(BoardFileMessageFor("- name: a\n  tag_size: 40\n"), HasSubstr("millimetres"));
  EXPECT_THAT(BoardFileMessageFor("- name: a\n  tag_size: 0.04\n  family: tag36h12\n"),
              HasSubstr("did you mean 'tag36h11'?"));
  EXPECT_THAT(
      BoardFileMessageFor("- name: a\n  tag_size: 0.04\n  family: tag16h5\n  first_id: 30\n"),
      HasSubstr("0 to 29"));
  EXPECT_THAT(
      BoardFileMessageFor("- name: a\n  rows: 90000\n  columns: 90000\n  tag_size: 1\n  gap: 1\n"),
      HasSubstr("too many"));
  EXPECT_THAT(BoardFileMessageFor("- name: a\n  rows: 2\n  tag_size: 0.05\n  gap: 0.039\n"),
              HasSubstr("at least 0.04 m"));
  EXPECT_THAT(BoardFileMessageFor("[]"), HasSubstr("no board"));
  EXPECT_THAT(BoardFileMessageFor("name: a\n"), HasSubstr("a list is expected"));
}

TEST(BoardFile, TagsOnTwoBoardsAreRefused) {
  EXPECT_THAT(BoardFileMessageFor("- {name: a, rows: 2, tag_size: 0.05, gap: 0.05}\n"
                                  "- {name: b, tag_size: 0.05, first_id: 1}\n"),
              testing::AllOf(StartsWith("boards.yaml:2:"), HasSubstr("both have tag 1")));
  EXPECT_THAT(BoardFileMessageFor(
                  "- {name: a, tag_size: 0.05}\n- {name: a, tag_size: 0.05, first_id: 1}\n"),
              HasSubstr("two boards 'a'"));
  EXPECT_EQ(BoardFileMessageFor("- {name: a, tag_size: 0.05}\n"
                                "- {name: b, tag_size: 0.05, family: tag36h11}\n"),
            "");
}

}  // namespace

}  // namespace silhouette
