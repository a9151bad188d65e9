// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate board, as its users meet it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "calib/boards/board.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class BoardProgram : public testing::Test {
 protected:
  // Of silhouette-calibrate board --out wall; its output is then in out_ and err_.
  int Run(const std::string& arguments) {
    const Ended ended =
        shell_.Run(ProgramFolder() + "/silhouette-calibrate board --out wall " + arguments);
    out_ = ended.out;
    err_ = ended.err;
    return ended.exit_code;
  }

  const Shell shell_;
  const fs::path folder_ = shell_.folder();
  std::string out_;
  std::string err_;
};

TEST_F(BoardProgram, WritesPdfPngAndDescription) {
  ASSERT_EQ(Run("--rows 2 --columns 3 --tag-size 30 --gap 25.51 --first-id 5 --format json"), 0)
      << err_;
  EXPECT_TRUE(ContentOf(folder_ / "wall.pdf").starts_with("%PDF-"));
  EXPECT_TRUE(ContentOf(folder_ / "wall.png").starts_with("\x89PNG"));
  const auto boards = BoardsFromText(ContentOf(folder_ / "wall.yaml"), "wall.yaml");
  ASSERT_TRUE(boards.ok()) << boards.status();
  const BoardDescription& d = boards->front().description();
  EXPECT_EQ(d.name, "wall");
  EXPECT_EQ(d.rows, 2);
  EXPECT_EQ(d.columns, 3);
  EXPECT_EQ(d.tag_size, 0.03);
  EXPECT_EQ(d.gap, 0.02551);
  EXPECT_EQ(d.first_id, 5);
  const auto json = nlohmann::json::parse(out_);
  EXPECT_EQ(json["paper"], "A4");
  EXPECT_EQ(json["lattice"], false);
}

TEST_F(BoardProgram, PrintsChessboardsCharucoCirclesAndBoardsOfAFile) {
  const auto read = [&] {
    return BoardsFromText(ContentOf(folder_ / "wall.yaml"), "wall.yaml").value().front();
  };
  ASSERT_EQ(Run("--chessboard 9x6 --square 22mm --dpi 30 --format json"), 0) << err_;
  EXPECT_EQ(nlohmann::json::parse(out_)["family"], "chessboard-9x6");
  EXPECT_EQ(read().description().square, 0.022);
  ASSERT_EQ(Run("--charuco 5x7 --square 30 --dictionary DICT_5X5_100 --dpi 30 --overwrite"), 0)
      << err_;
  EXPECT_EQ(read().family(), "charuco-DICT_5X5_100-0-5x7");
  EXPECT_EQ(read().description().tag_size, 0.0225);
  ASSERT_EQ(Run("--circles 4x11 --asymmetric --spacing 15 --dpi 30 --format json --overwrite"), 0)
      << err_;
  EXPECT_EQ(nlohmann::json::parse(out_)["spacing"], 0.015);
  EXPECT_EQ(read().family(), "asymmetric-circles-4x11");
  WriteFile(folder_ / "grid.yaml",
            "target_type: 'aprilgrid'\ntagCols: 3\ntagRows: 2\ntagSize: 0.04\ntagSpacing: 0.3\n");
  ASSERT_EQ(Run("--from grid.yaml --dpi 30 --overwrite"), 0) << err_;
  EXPECT_DOUBLE_EQ(read().CornersOf(0)[3].y(), 0.052);
  EXPECT_EQ(Run("--chessboard 9by6 --overwrite"), 2);
  EXPECT_THAT(err_, HasSubstr("columns x rows"));
  EXPECT_EQ(Run("--chessboard 9x6 --rows 4 --overwrite"), 2);
  EXPECT_EQ(Run("--chessboard 12x8 --overwrite --paper A4"), 2);
  EXPECT_THAT(err_, HasSubstr("--square"));
}

TEST_F(BoardProgram, FloorTagsAreBoardsOfTheirOwn) {
  ASSERT_EQ(Run("--floor 3 --first-id 200 --dpi 60"), 0) << err_;
  const auto boards = BoardsFromText(ContentOf(folder_ / "wall.yaml"), "wall.yaml");
  ASSERT_TRUE(boards.ok()) << boards.status();
  ASSERT_EQ(boards->size(), 3u);
  EXPECT_EQ(boards->back().description().name, "wall-202");
  EXPECT_TRUE(boards->back().HasTag(202));
  EXPECT_TRUE(fs::exists(folder_ / "wall-3.png"));
}

TEST_F(BoardProgram, MistakesAreOneSentenceAndWriteNothing) {
  EXPECT_EQ(Run("--family tag36h12"), 2);
  EXPECT_THAT(err_, HasSubstr("did you mean 'tag36h11'?"));
  EXPECT_EQ(Run("--first-id 2110"), 2);
  EXPECT_THAT(err_, HasSubstr("0 to 2114"));
  EXPECT_EQ(Run("--paper A5"), 2);
  EXPECT_THAT(err_, HasSubstr("--paper 'A3 landscape'"));
  EXPECT_EQ(Run("--flange --rows 2"), 2);
  EXPECT_EQ(Run("--tag-size -4"), 2);
  EXPECT_EQ(Run("--tag-size 30deg"), 2);
  EXPECT_THAT(err_, HasSubstr("--tag-size: '30deg' is not a length; write millimetres"));
  EXPECT_EQ(Run("--chessboard 9x6 --square 0.025"), 2);
  EXPECT_THAT(err_, HasSubstr("--square: 0.025 mm is too small to print"));
  EXPECT_THAT(err_, HasSubstr("write 0.025m"));
  EXPECT_FALSE(fs::exists(folder_ / "wall.yaml"));
}

TEST_F(BoardProgram, MeasuredLengthsAreNotOverwritten) {
  ASSERT_EQ(Run("--dpi 0"), 0) << err_;
  EXPECT_FALSE(fs::exists(folder_ / "wall.png"));
  EXPECT_EQ(Run("--dpi 0 --tag-size 25"), 2);
  EXPECT_THAT(err_, HasSubstr("--overwrite"));
  EXPECT_THAT(ContentOf(folder_ / "wall.yaml"), HasSubstr("tag_size: 0.03"));
  EXPECT_EQ(Run("--dpi 0 --tag-size 25 --overwrite"), 0);
  EXPECT_THAT(ContentOf(folder_ / "wall.yaml"), HasSubstr("tag_size: 0.025"));
}

}  // namespace
}  // namespace silhouette
