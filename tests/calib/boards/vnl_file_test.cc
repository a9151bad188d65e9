// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/vnl_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace silhouette {
namespace {

using testing::HasSubstr;

Board VnlBoard() {
  return Board(
      {.name = "hand", .kind = BoardKind::kCircles, .rows = 2, .columns = 3, .square = 0.025});
}

std::string VnlMessageFor(const std::string& text) {
  return std::string(SightingsFromVnl(text, "corners.vnl", VnlBoard()).status().message());
}

TEST(VnlFile, GivesBackTheCornersOfEachImage) {
  std::vector<TagSighting> sightings;
  for (const int tag : {0, 2, 5}) {
    sightings.push_back({.frame = "1",
                         .view = "left",
                         .family = VnlBoard().family(),
                         .tag = tag,
                         .corners = {Eigen::Vector2d(10.25 + tag, 20)},
                         .sigma = tag == 5 ? 0.8 : 0.01});
  }
  const auto text = VnlFileText(sightings, VnlBoard(), [](const TagSighting& sighting) {
    return sighting.view + "/" + sighting.frame + ".png";
  });
  ASSERT_TRUE(text.ok()) << text.status();
  EXPECT_THAT(*text, HasSubstr("left/1.png 10.25 20 0\nleft/1.png - - -\nleft/1.png 12.25 20 0\n"));
  EXPECT_THAT(*text, HasSubstr("left/1.png 15.25 20 2\n"));
  const auto read = SightingsFromVnl(*text, "corners.vnl", VnlBoard());
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), 1u);
  const std::vector<TagSighting>& of_image = read->at("left/1.png");
  ASSERT_EQ(of_image.size(), 3u);
  EXPECT_EQ(of_image[2].tag, 5);
  EXPECT_EQ(of_image[2].corners, sightings[2].corners);
  EXPECT_DOUBLE_EQ(of_image[2].sigma, 0.8);
  EXPECT_DOUBLE_EQ(of_image[0].sigma, kVnlSigma);
}

TEST(VnlFile, AnImageWithoutCornersIsSkipped) {
  const auto read = SightingsFromVnl(
      "## made elsewhere\n# filename x y level\na.png - - -\n"
      "b.png 1 2 0\nb.png 2 2 0\nb.png 3 2 -\nb.png 1 3 1\nb.png 2 3 0\nb.png 3 3 0\n",
      "corners.vnl", VnlBoard());
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), 1u);
  EXPECT_EQ(read->at("b.png").size(), 5u);
}

TEST(VnlFile, TagsNeedAllTheirCorners) {
  const Board tag({.name = "tag", .tag_size = 0.1});
  const auto read = SightingsFromVnl(
      "# filename x y\na 1 1\na 2 1\na 1 2\na 2 2\nb 1 1\nb - -\nb 1 "
      "2\nb 2 2\n",
      "corners.vnl", tag);
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->at("a").size(), 1u);
  EXPECT_EQ(read->at("a").front().corners[0], Eigen::Vector2d(1, 2));  // bottom left
  EXPECT_TRUE(read->at("b").empty());
}

TEST(VnlFile, MistakesAreNamed) {
  EXPECT_THAT(VnlMessageFor("# filename x y level\na 1 2 0\na 1 2 0\n"),
              HasSubstr("'a' has 2 lines, but board 'hand' has 3x2 corners"));
  EXPECT_THAT(VnlMessageFor("# filename x y level\na 1 2 0\na 1 two 0\n"),
              HasSubstr("corners.vnl:3: x, y"));
  EXPECT_THAT(VnlMessageFor("# filename x y level\n"), HasSubstr("there is no corner"));
  EXPECT_THAT(VnlMessageFor("a\n"), HasSubstr("a line is filename, x, y"));
}

}  // namespace
}  // namespace silhouette
