// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/lens_region.h"

#include <gtest/gtest.h>

namespace silhouette {
namespace {

TEST(LensRegion, APixelIsKnownInsideOfTheContourOnly) {
  // A rectangle with a notch from above.
  const LensRegion region{
      .contour = {{0, 0}, {4, 0}, {4, 6}, {6, 6}, {6, 0}, {10, 0}, {10, 8}, {0, 8}, {0, 0}}};
  for (const Eigen::Vector2d& known :
       {Eigen::Vector2d(1, 1), {9, 1}, {5, 7}, {5, 6.1}, {9.9, 7.9}}) {
    EXPECT_TRUE(region.Contains(known)) << known.transpose();
  }
  for (const Eigen::Vector2d& unknown :
       {Eigen::Vector2d(5, 1), {5, 5.9}, {-1, 4}, {11, 4}, {5, 9}, {5, -1}}) {
    EXPECT_FALSE(region.Contains(unknown)) << unknown.transpose();
  }
}

TEST(LensRegion, NoPixelIsKnownWithoutAContour) { EXPECT_FALSE(LensRegion().Contains({0, 0})); }

}  // namespace
}  // namespace silhouette
