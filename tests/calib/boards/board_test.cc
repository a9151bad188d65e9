// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/boards/board.h"
#include "calib/boards/tag_family.h"

namespace silhouette {
namespace {

BoardDescription TwoByThree() {
  return {.name = "wall", .rows = 2, .columns = 3, .tag_size = 0.04, .gap = 0.01, .first_id = 10};
}

TEST(Board, TagsGoRowByRowFromTheTopLeft) {
  const Board board(TwoByThree());
  EXPECT_EQ(board.tags(), 6);
  const MarkCorners last = board.CornersOf(15);
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

TEST(Board, CornersAreOnTheCoarsestLattice) {
  BoardDescription description = TwoByThree();
  description.gap = description.tag_size;
  EXPECT_EQ(Board(description).lattice(), (Lattice{.width = 6, .height = 4, .spacing = 0.04}));
  description.gap = 0.3 * description.tag_size;  // as Kalibr's
  const Lattice kalibr = Board(description).lattice().value();
  EXPECT_EQ(kalibr.width, 37);
  EXPECT_EQ(kalibr.height, 24);
  EXPECT_NEAR(kalibr.spacing, 0.004, 1e-12);
  EXPECT_TRUE(kalibr.exact);
}

TEST(Board, AnyGapHasALatticeNearItsCorners) {
  for (const int side : {2, 6, 9}) {
    for (int gap = 200; gap <= 600; ++gap) {
      const Board board({.name = "kalibr",
                         .rows = side,
                         .columns = side,
                         .tag_size = 0.03,
                         .gap = 0.03e-3 * gap});
      const Lattice lattice = board.lattice().value();
      EXPECT_LE(lattice.width * lattice.height, 6400);
      const double tag = lattice.spacing * board.LatticePlaceOf(0, 1).column;
      EXPECT_NEAR(tag / 0.03, 1, lattice.exact ? 1e-4 : 0.05) << gap << ", side " << side;
    }
  }
}

TEST(Board, TooManyTagsForTheirGapHaveNoLattice) {
  BoardDescription description = TwoByThree();
  description.rows = 40;
  description.columns = 30;
  description.gap = 0.3 * description.tag_size;
  EXPECT_EQ(Board(description).lattice(), std::nullopt);
}

TEST(Board, CornersLieAtTheirPlacesOnTheLattice) {
  BoardDescription tags = TwoByThree();
  tags.gap = 0.3 * tags.tag_size;
  tags.from_bottom = true;
  for (const Board& board : {Board(tags),
                             Board({.name = "hand",
                             .kind = BoardKind::kChessboard,
                             .rows = 6,
                             .columns = 9,
                             .square = 0.025}),
                             Board({.name = "dots",
                             .kind = BoardKind::kCircles,
                             .rows = 11,
                             .columns = 4,
                             .square = 0.02,
                             .asymmetric = true})}) {
    const Lattice lattice = board.lattice().value();
    for (int id = board.first_mark(); board.HasTag(id); ++id) {
      for (int corner = 0; corner < board.corners_per_mark(); ++corner) {
        const GridPlace place = board.LatticePlaceOf(id, corner);
        const Eigen::Vector3d at = lattice.spacing * Eigen::Vector3d(place.column, place.row, 0);
        EXPECT_TRUE(board.CornersOf(id)[corner].isApprox(at, 1e-12)) << id;
        EXPECT_LT(place.column, lattice.width);
        EXPECT_LT(place.row, lattice.height);
      }
    }
  }
}

TEST(Board, AChessboardThatLooksTheSameTurnedByHalfIsAmbiguous) {
  const auto is_ambiguous = [](int columns, int rows) {
    return Board({.name = "hand",
                  .kind = BoardKind::kChessboard,
                  .rows = rows,
                  .columns = columns,
                  .square = 0.025})
        .IsAmbiguous();
  };
  EXPECT_FALSE(is_ambiguous(9, 6));
  EXPECT_FALSE(is_ambiguous(6, 9));
  EXPECT_TRUE(is_ambiguous(8, 6));
  EXPECT_TRUE(is_ambiguous(7, 7));
  EXPECT_FALSE(Board(TwoByThree()).IsAmbiguous());
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

TEST(BoardFile, GivesChessboardsAndCharucoBoards) {
  const std::vector<Board> boards = {Board({.name = "hand",
                                            .kind = BoardKind::kChessboard,
                                            .rows = 6,
                                            .columns = 9,
                                            .square = 0.025}),
                                     Board({.name = "plate",
                                            .kind = BoardKind::kCharuco,
                                            .dictionary = "DICT_6X6_250",
                                            .rows = 6,
                                            .columns = 5,
                                            .tag_size = 0.03,
                                            .square = 0.04,
                                            .first_id = 20,
                                            .legacy = true})};
  const auto read = BoardsFromText(BoardFileText(boards), "boards.yaml");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ((*read)[0].family(), "chessboard-9x6");
  EXPECT_EQ((*read)[0].tags(), 54);
  EXPECT_EQ((*read)[0].extent(), Eigen::Vector2d(8 * 0.025, 5 * 0.025));
  EXPECT_EQ((*read)[1].family(), boards[1].family());
  EXPECT_EQ((*read)[1].tags(), 4 * 5);
  EXPECT_EQ((*read)[1].description().tag_size, 0.03);
  EXPECT_TRUE((*read)[1].description().legacy);
}

TEST(BoardFile, GivesKalibrsAprilGridWithTheFirstRowAtTheBottom) {
  const auto read = BoardsFromText(
      "target_type: 'aprilgrid' #gridtype\n"
      "tagCols: 6               #number of apriltags\n"
      "tagRows: 6\ntagSize: 0.088\ntagSpacing: 0.3\ncodeOffset: 40\n",
      "april_6x6.yaml");
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), 1u);
  const Board& board = read->front();
  EXPECT_EQ(board.description().name, "april_6x6");
  EXPECT_EQ(board.tags(), 36);
  EXPECT_NEAR(board.description().gap, 0.0264, 1e-12);
  const double pitch = 0.088 * 1.3;
  EXPECT_TRUE(board.CornersOf(40)[0].isApprox(Eigen::Vector3d(0, 5 * pitch + 0.088, 0)));
  EXPECT_TRUE(board.CornersOf(47)[3].isApprox(Eigen::Vector3d(pitch, 4 * pitch, 0)));
  const auto again = BoardsFromText(BoardFileText(*read), "boards.yaml");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->front().CornersOf(40)[0], board.CornersOf(40)[0]);
}

// As OpenCV's samples and Kalibr have them.
TEST(BoardFile, GivesCirclesAndKalibrsCirclegrid) {
  const auto read = BoardsFromText(
      "- {name: dots, circles: 4x11, spacing: 0.02, asymmetric: true}\n"
      "- {name: even, circles: 7x5, spacing: 0.03}\n",
      "boards.yaml");
  ASSERT_TRUE(read.ok()) << read.status();
  const Board& dots = read->front();
  EXPECT_EQ(dots.family(), "asymmetric-circles-4x11");
  EXPECT_EQ(dots.tags(), 44);
  EXPECT_TRUE(dots.CornersOf(5)[0].isApprox(Eigen::Vector3d(0.06, 0.02, 0)));
  EXPECT_TRUE(dots.extent().isApprox(Eigen::Vector2d(0.14, 0.2)));
  EXPECT_FALSE(dots.IsAmbiguous());
  EXPECT_TRUE((*read)[1].IsAmbiguous());
  EXPECT_TRUE((*read)[1].extent().isApprox(Eigen::Vector2d(0.18, 0.12)));
  const auto again = BoardsFromText(BoardFileText(*read), "boards.yaml");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->front().CornersOf(5)[0], dots.CornersOf(5)[0]);
  const auto kalibr = BoardsFromText(
      "target_type: 'circlegrid'\ntargetCols: 4\ntargetRows: 11\nspacingMeters: 0.02\n"
      "asymmetricGrid: True\n",
      "circles.yaml");
  ASSERT_TRUE(kalibr.ok()) << kalibr.status();
  EXPECT_EQ(kalibr->front().CornersOf(5)[0], dots.CornersOf(5)[0]);
}

TEST(BoardFile, GivesKalibrsCheckerboard) {
  const auto read = BoardsFromText(
      "target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\n"
      "rowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n",
      "checker.yaml");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->front().family(), "chessboard-6x7");
}

TEST(BoardFile, AChessboardThatDetectCannotFindIsRefused) {
  for (const char* size : {"9x2", "2x9"}) {
    EXPECT_THAT(
        BoardFileMessageFor(absl::StrCat("- {name: a, chessboard: ", size, ", square: 0.025}\n")),
        HasSubstr("at least 3x3 inner corners"));
  }
  EXPECT_EQ(BoardFileMessageFor("- {name: a, chessboard: 4x3, square: 0.025}\n"), "");
}

TEST(BoardFile, MistakesInOtherBoardsAreToldWithTheMend) {
  EXPECT_THAT(BoardFileMessageFor("target_type: concentric\n"), HasSubstr("or circlegrid"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, circles: 4x11, spacing: 20}\n"),
              HasSubstr("spacing 20 is in metres"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, circles: 4x1, spacing: 0.02}\n"),
              HasSubstr("at least 2x2"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, circles: 4x11, spacing: 0.02}\n"
                                  "- {name: b, circles: 11x4, spacing: 0.03}\n"),
              HasSubstr("circles of one size"));
  EXPECT_EQ(BoardFileMessageFor("- {name: a, circles: 4x11, spacing: 0.02}\n"
                                "- {name: b, circles: 4x11, spacing: 0.02, asymmetric: true}\n"),
            "");
  EXPECT_THAT(BoardFileMessageFor("- {name: a, chessboard: 9, square: 0.025}\n"),
              HasSubstr("such as 9x6"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, chessboard: 9x6, square: 25}\n"),
              HasSubstr("divided by 1000"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, chessboard: 9x6, square: 0.1, tag_size: 1}\n"),
              HasSubstr("tag_size"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, charuco: 7x5, square: 0.04, marker: 0.05}\n"),
              HasSubstr("smaller than square"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, charuco: 7x5, square: 0.04, marker: 0.03, "
                                  "dictionary: DICT_4X4_51}\n"),
              HasSubstr("did you mean 'DICT_4X4_50'"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, charuco: 12x9, square: 0.04, marker: 0.03}\n"),
              HasSubstr("has only 0 to 49"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, chessboard: 9x6, square: 0.025}\n"
                                  "- {name: b, chessboard: 6x9, square: 0.030}\n"),
              HasSubstr("no image tells them apart"));
  EXPECT_THAT(BoardFileMessageFor("- {name: a, charuco: 5x5, square: 0.04, marker: 0.03}\n"
                                  "- {name: b, charuco: 4x4, square: 0.04, marker: 0.03}\n"),
              HasSubstr("both have marker 0 of DICT_4X4_50"));
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

TEST(BoardFile, MarkersThatLookTheSameUnderTwoNamesAreRefused) {
  const auto message_for = [](const std::string& a, const std::string& b, int first_of_b) {
    return BoardFileMessageFor("- {name: a, tag_size: 0.05, family: " + a +
                               ", first_id: 3}\n- {name: b, tag_size: 0.05, family: " + b +
                               ", first_id: " + std::to_string(first_of_b) + "}\n");
  };
  for (const auto& [a, b] : {std::pair("DICT_4X4_50", "DICT_4X4_1000"),
                             {"DICT_5X5_250", "DICT_5X5_100"},
                             {"DICT_6X6_50", "DICT_6X6_250"},
                             {"DICT_7X7_1000", "DICT_7X7_50"},
                             {"tag16h5", "DICT_APRILTAG_16h5"},
                             {"DICT_APRILTAG_25h9", "tag25h9"},
                             {"tag36h10", "DICT_APRILTAG_36h10"},
                             {"DICT_APRILTAG_36h11", "tag36h11"}}) {
    EXPECT_THAT(message_for(a, b, 3),
                HasSubstr(std::string("both have tag 3 of ") + b + ", which is the one of " + a));
    EXPECT_EQ(message_for(a, b, 4), "");
    const std::vector<bool> one = TagFamily(a).Modules(3).white;
    const std::vector<bool> other = TagFamily(b).Modules(3).white;
    const std::vector<bool> turned(other.rbegin(), other.rend());
    EXPECT_TRUE(one == other || one == turned) << a << ", " << b;
  }
  EXPECT_EQ(message_for("DICT_5X5_50", "DICT_ARUCO_ORIGINAL", 3), "");
  EXPECT_EQ(message_for("tag36h11", "tag36h11b2", 3), "") << "its border is wider";
  EXPECT_THAT(BoardFileMessageFor("- {name: a, tag_size: 0.05, family: DICT_4X4_100}\n"
                                  "- {name: b, charuco: 5x5, square: 0.04, marker: 0.03}\n"),
              HasSubstr("both have marker 0 of DICT_4X4_50, which is the one of DICT_4X4_100"));
}

// Their rims may overlap: OpenCV's GridBoards have gaps of a fraction of a marker.
TEST(BoardFile, GridsOfArucoMarkersAreTagsOfADictionary) {
  const std::string grid =
      "- {name: a, family: DICT_4X4_50, rows: 5, columns: 7, tag_size: 0.04, gap: 0.01}\n";
  EXPECT_EQ(BoardFileMessageFor(grid), "");
  EXPECT_THAT(
      BoardFileMessageFor(
          "- {name: a, family: DICT_4X4_50, rows: 8, columns: 7, tag_size: 0.04, gap: 0.01}\n"),
      HasSubstr("its ids are 0 to 55, but DICT_4X4_50 has only 0 to 49"));
  EXPECT_THAT(BoardFileMessageFor(grid + "- {name: b, charuco: 5x5, square: 0.04, marker: 0.03}\n"),
              HasSubstr("both have marker 0 of DICT_4X4_50"));
}

}  // namespace

}  // namespace silhouette
