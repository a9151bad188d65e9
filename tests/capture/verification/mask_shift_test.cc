// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/mask_shift.h"

#include <gtest/gtest.h>

#include <cmath>

namespace silhouette {
namespace {

constexpr MaskSize kShiftSize{64, 48};

// A disc and a bar, grown by `more`.
Mask ThingAt(double x, double y, double more) {
  return Mask::FromPredicate(kShiftSize, [&](int u, int v) {
    return std::hypot(u - x, v - y) < 8 + more ||
           (std::abs(u - x - 6) < 12 + more && std::abs(v - y) < 3 + more);
  });
}

TEST(MaskShift, IsFoundToAFractionOfAPixel) {
  for (const double dx : {-4.3, -1.0, 0.0, 0.4, 2.7}) {
    for (const double dy : {-2.2, 0.0, 0.5, 5.1}) {
      const Eigen::Vector2d shift = ShiftOf(ThingAt(28 + dx, 22 + dy, 0), ThingAt(28, 22, 0));
      EXPECT_NEAR(shift.x(), dx, 0.35) << dx << ", " << dy;
      EXPECT_NEAR(shift.y(), dy, 0.35) << dx << ", " << dy;
    }
  }
}

TEST(MaskShift, OfAThingThatIsThickerAllAroundIsNone) {
  EXPECT_LT(ShiftOf(ThingAt(28, 22, 0), ThingAt(28, 22, 1)).norm(), 0.15);
}

TEST(MaskShift, OfNothingIsNone) {
  EXPECT_TRUE(ShiftOf(Mask(kShiftSize), ThingAt(28, 22, 0)).isZero());
}

}  // namespace
}  // namespace silhouette
