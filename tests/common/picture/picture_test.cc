// SPDX-License-Identifier: Apache-2.0
#include "common/picture/picture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "common/picture/chart.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"

namespace silhouette {
namespace {

Colour At(const Picture& picture, int x, int y) {
  const cv::Vec3b pixel = picture.at<cv::Vec3b>(y, x);
  return {pixel[2], pixel[1], pixel[0]};
}

int PixelsOf(const Picture& picture, Colour colour) {
  int count = 0;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) count += At(picture, x, y) == colour ? 1 : 0;
  }
  return count;
}

Mask OnePixel(MaskSize size, int px, int py) {
  return Mask::FromPredicate(size, [=](int x, int y) { return x == px && y == py; });
}

TEST(Picture, OfPlanesHasTheColourOfEachPlane) {
  const MaskSize size{4, 3};
  const Picture picture =
      PictureOfPlanes(OnePixel(size, 0, 0), OnePixel(size, 1, 2), OnePixel(size, 3, 1));
  EXPECT_EQ(At(picture, 0, 0), palette::kObstacle);
  EXPECT_EQ(At(picture, 1, 2), palette::kUnknown);
  EXPECT_EQ(At(picture, 3, 1), palette::kError);
  EXPECT_EQ(PixelsOf(picture, palette::kBackground), 9);
  EXPECT_THROW(PictureOfPlanes(Mask({4, 3}), Mask({4, 3}), Mask({3, 4})), std::invalid_argument);
}

TEST(Text, IsDrawnInItsLineAndMeasured) {
  Picture picture = BlankPicture(400, 60);
  DrawText(picture, "Joint 30° gy", {10, 30}, {.height = 20});
  cv::Mat grey;
  cv::extractChannel(picture, grey, 0);
  const cv::Rect ink = cv::boundingRect(255 - grey);
  EXPECT_GE(ink.y, 20);
  EXPECT_LE(ink.y + ink.height, 40);
  EXPECT_GE(ink.x, 10);
  EXPECT_LE(ink.x + ink.width, 10 + TextWidth("Joint 30° gy", 20));
  EXPECT_GE(ink.width, TextWidth("Joint 30° gy", 20) - 6);
}

TEST(Text, IsShortenedByWholeCharacters) {
  const std::string text = "°°°°°°°°°°°°";
  EXPECT_EQ(Shortened(text, TextWidth(text, 14), 14), text);
  EXPECT_EQ(Shortened(text, TextWidth("°°°...", 14), 14), "°°°...");
  EXPECT_EQ(Shortened(text, 0, 14), "...");
}

TEST(Picture, EnlargedRepeatsPixels) {
  const Mask mask = OnePixel({3, 2}, 2, 1);
  const Picture large = Enlarged(PictureOf(mask), 5);
  ASSERT_EQ(large.cols, 15);
  ASSERT_EQ(large.rows, 10);
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 15; ++x) {
      EXPECT_EQ(At(large, x, y), mask.at(x / 5, y / 5) ? palette::kInk : palette::kBackground);
    }
  }
}

TEST(Picture, FittedIntoKeepsItsShape) {
  const Picture fitted = FittedInto(BlankPicture(40, 10, palette::kRobot), 20, 20);
  EXPECT_EQ(fitted.cols, 20);
  EXPECT_EQ(fitted.rows, 20);
  EXPECT_EQ(PixelsOf(fitted, palette::kRobot), 20 * 5);
}

TEST(Picture, OfPixelsTakesGreyAndColourAndRefusesOtherCounts) {
  const std::vector<uint8_t> grey = {0, 100, 200, 255};
  EXPECT_EQ(At(PictureOfPixels(2, 2, 1, grey), 1, 0), (Colour{100, 100, 100}));
  const std::vector<uint8_t> bgr = {1, 2, 3};
  EXPECT_EQ(At(PictureOfPixels(1, 1, 3, bgr), 0, 0), (Colour{3, 2, 1}));
  EXPECT_THROW(PictureOfPixels(2, 1, 3, bgr), std::invalid_argument);
}

TEST(Picture, WithVeilTintsWhereTheMaskIs) {
  const Picture veiled =
      WithVeil(BlankPicture(20, 20, palette::kPaper), OnePixel({2, 2}, 1, 0), palette::kRobot, 1);
  EXPECT_EQ(PixelsOf(veiled, palette::kRobot), 100);
  EXPECT_EQ(At(veiled, 15, 5), palette::kRobot);
}

TEST(ContactSheet, HoldsEveryPicture) {
  std::vector<CaptionedPicture> pictures;
  for (int i = 0; i < 7; ++i) pictures.push_back({BlankPicture(30, 20, palette::kRobot), "view"});
  const Picture sheet = ContactSheet(pictures, {.title = "seven", .columns = 3, .legend = {}});
  EXPECT_EQ(PixelsOf(sheet, palette::kRobot), 7 * 30 * 20);
  EXPECT_FALSE(ContactSheet({}, {}).empty());
}

ConfigurationChart SmallChart() {
  ConfigurationChart chart;
  chart.x = {.label = "axis 1", .first = -90, .last = 90, .cells = 3};
  chart.y = {.label = "axis 3", .first = 0, .last = 30, .cells = 2};
  chart.classes = ConfigurationClasses();
  chart.cells = {kFreeCell, kFreeCell, kFreeCell, kFreeCell, kOccupiedCell, kUnknownCell};
  return chart;
}

TEST(ConfigurationChart, HasTheLowestCellLowerLeftAndOneLegendSwatchPerClass) {
  ConfigurationChart chart = SmallChart();
  chart.cells = {kOccupiedCell, kFreeCell, kFreeCell, kFreeCell, kFreeCell, kFreeCell};
  chart.classes[kOccupiedCell].colour = palette::kObstacle;  // no grey that text has too
  const Picture picture = Draw(chart);
  const cv::Mat occupied = [&] {
    cv::Mat found;
    const Colour colour = palette::kObstacle;
    cv::inRange(picture, cv::Scalar(colour.blue, colour.green, colour.red),
                cv::Scalar(colour.blue, colour.green, colour.red), found);
    return found;
  }();
  std::vector<cv::Point> places;
  cv::findNonZero(occupied, places);
  // One cell of 40 x 40, and the inside of a swatch of the legend below it.
  EXPECT_EQ(places.size(), 40 * 40 + 12 * 12);
  const cv::Point first = places.front();
  EXPECT_LT(first.x, picture.cols / 2);
  EXPECT_EQ(At(picture, first.x + 60, first.y + 20), palette::kFree);  // to the right
  EXPECT_EQ(At(picture, first.x + 20, first.y - 20), palette::kFree);  // above
}

TEST(ConfigurationChart, DrawsOutlineAndPathOnlyWhereAskedFor) {
  ConfigurationChart chart = SmallChart();
  const Picture plain = Draw(chart);
  EXPECT_EQ(PixelsOf(plain, palette::kTruth), 0);
  EXPECT_EQ(PixelsOf(plain, palette::kPath), 0);
  chart.outlined = {0, 0, 0, 0, 1, 1};
  chart.path = {{{-90, 0}, {0, 0}, {90, 0}}};
  chart.start = ChartPoint{-90, 0};
  chart.goal = ChartPoint{90, 0};
  const Picture full = Draw(chart);
  EXPECT_GT(PixelsOf(full, palette::kTruth), 100);
  EXPECT_GT(PixelsOf(full, palette::kPath), 100);
  EXPECT_GT(PixelsOf(full, palette::kStart), 50);
  EXPECT_GT(PixelsOf(full, palette::kGoal), 50);
}

TEST(ConfigurationChart, RefusesCellsThatDoNotFit) {
  ConfigurationChart chart = SmallChart();
  chart.cells.pop_back();
  EXPECT_THROW(Draw(chart), std::invalid_argument);
  chart = SmallChart();
  chart.cells[0] = 3;
  EXPECT_THROW(Draw(chart), std::invalid_argument);
  chart = SmallChart();
  chart.outlined = {1};
  EXPECT_THROW(Draw(chart), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
