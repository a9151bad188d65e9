// SPDX-License-Identifier: Apache-2.0
#include "common/picture/chart.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <stdexcept>

namespace silhouette {
namespace {

// Mean row, from above, of the pixels of a colour; -1 if there are none.
double MeanRow(const Picture& picture, Colour colour) {
  double sum = 0;
  int count = 0;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const cv::Vec3b pixel = picture.at<cv::Vec3b>(y, x);
      if (Colour{pixel[2], pixel[1], pixel[0]} != colour) continue;
      sum += y;
      ++count;
    }
  }
  return count == 0 ? -1 : sum / count;
}

LineChart Panel(double low, double high) {
  return {"title",
          "cameras",
          "percent",
          {{"low", {0, 114, 178}, {{1, low}, {2, low}}},
           {"high", {213, 94, 0}, {{1, high}, {2, high}}}}};
}

TEST(LineChart, GreaterValuesAreHigherInThePicture) {
  const Picture picture = Draw({Panel(1, 9)}, {.title = "chart"});
  const double low = MeanRow(picture, {0, 114, 178});
  const double high = MeanRow(picture, {213, 94, 0});
  ASSERT_GE(high, 0);
  ASSERT_GE(low, 0);
  EXPECT_LT(high, low);
}

TEST(LineChart, PanelsStandInRows) {
  const Picture one = Draw({Panel(1, 2)}, {.title = "chart"});
  const Picture four =
      Draw({Panel(1, 2), Panel(0, 0), Panel(3, 1), Panel(2, 2)}, {.title = "chart"});
  EXPECT_GT(four.cols, 2 * one.cols * 0.9);
  EXPECT_GT(four.rows, one.rows + 300);
}

TEST(LineChart, WhatCannotBeDrawnIsRefused) {
  EXPECT_THROW(Draw(std::vector<LineChart>{}, {}), std::invalid_argument);
  EXPECT_THROW(Draw({Panel(std::numeric_limits<double>::quiet_NaN(), 1)}, {}),
               std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
