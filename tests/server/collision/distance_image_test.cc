// SPDX-License-Identifier: Apache-2.0
// Distances in images: exactly those by which masks grow.
#include "server/collision/clearance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

#include "tests/random.h"
#include "tests/server/collision/random_cell.h"

namespace silhouette {
namespace {

constexpr double kDistanceImageInfinity = std::numeric_limits<double>::infinity();

uint32_t SquaredAt(const DistanceImage& image, int x, int y) {
  const Mask pixel = Mask::FromPredicate(
      image.size(), [&](int column, int row) { return column == x && row == y; });
  return image.LeastSquared(pixel.words());
}

TEST(DistanceImage, MeasuresBetweenTheSquaresOfPixels) {
  const Mask plane = Mask::FromPredicate({9, 7}, [](int x, int y) { return x == 1 && y == 2; });
  const DistanceImage image(plane);
  EXPECT_EQ(SquaredAt(image, 1, 2), 0U);
  EXPECT_EQ(SquaredAt(image, 2, 3), 0U) << "squares that touch";
  EXPECT_EQ(SquaredAt(image, 3, 2), 1U);
  EXPECT_EQ(SquaredAt(image, 8, 2), 36U);
  EXPECT_EQ(SquaredAt(image, 5, 6), 9U + 9U);
}

TEST(DistanceImage, LeastOfSeveralPixelsIsThatOfTheNearest) {
  const DistanceImage image(Mask::FromPredicate({70, 3}, [](int x, int) { return x == 0; }));
  const Mask pixels = Mask::FromPredicate({70, 3}, [](int x, int y) { return x >= 40 + 9 * y; });
  EXPECT_EQ(image.LeastSquared(pixels.words()), 39U * 39U);
  EXPECT_EQ(image.LeastSquared(Mask({70, 3}).words()), DistanceImage::kInfinite);
}

TEST(DistanceImage, EmptyPlaneIsInfinitelyFarAway) {
  const DistanceImage image{Mask({5, 5})};
  EXPECT_EQ(SquaredAt(image, 2, 2), DistanceImage::kInfinite);
  EXPECT_EQ(PixelsOf(DistanceImage::kInfinite), kDistanceImageInfinity);
  EXPECT_TRUE(image.Within(1000).Empty());
}

TEST(DistanceImage, MaskOfNoSizeIsRefused) {
  EXPECT_THROW(DistanceImage{Mask()}, std::invalid_argument);
}

// The promise that clearances rest on, for every distance that there is in the images.
TEST(DistanceImage, GrowingByADistanceStopsShortOfItAndByAnyMoreReachesIt) {
  Random random;
  std::vector<MaskSize> sizes = {{1, 1}, {1, 40}, {90, 1}, {64, 64}, {65, 33}, {7, 130}};
  for (int i = 0; i < 20; ++i) sizes.push_back(RandomSizes(1, random)[0]);
  for (const MaskSize size : sizes) {
    const double pixels = static_cast<double>(size.pixels());
    Mask plane = RandomMask(size, std::uniform_real_distribution(0.0, 6 / pixels)(random), random);
    if (random() % 4 == 0) plane = plane | RandomBox(size, random);
    const DistanceImage image(plane);
    const uint32_t largest =
        static_cast<uint32_t>(size.width * size.width + size.height * size.height);
    std::uniform_int_distribution<uint32_t> any(0, largest);
    for (int i = 0; i < 60; ++i) {
      const uint32_t squared = i < 30 ? std::min<uint32_t>(i, largest) : any(random);
      const double distance = PixelsOf(squared);
      EXPECT_NEAR(distance, std::sqrt(squared), 1e-12);
      const Mask nearer = squared == 0 ? plane : image.Within(squared - 1);
      EXPECT_EQ(Grown(plane, distance), nearer) << squared;
      EXPECT_EQ(Grown(plane, distance + 1e-9), image.Within(squared)) << squared;
    }
  }
}

}  // namespace
}  // namespace silhouette
