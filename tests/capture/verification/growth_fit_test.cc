// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/growth_fit.h"

#include <gtest/gtest.h>

namespace silhouette {
namespace {

using Steps = std::vector<int>;

// Two links, up to four steps; the second adds ten times as many pixels.
GrowthFit TwoLinks() { return GrowthFit(4, {{0, 1, 2, 3, 4}, {0, 10, 20, 30, 40}}); }

TEST(GrowthFit, NothingIsNeededForNoPixel) {
  EXPECT_EQ(TwoLinks().Steps({0, 0}), Steps({0, 0}));
  EXPECT_EQ(TwoLinks().Steps({1, 2}), Steps({1, 2})) << "never less than before";
}

TEST(GrowthFit, EveryPixelIsReachedByTheLinkThatAddsLeast) {
  GrowthFit fit = TwoLinks();
  fit.Add({3, 1});
  fit.Add({2, 4});
  EXPECT_EQ(fit.Steps({0, 0}), Steps({3, 0}));
  fit.Add({5, 2});  // out of the first link's reach
  EXPECT_EQ(fit.Steps({0, 0}), Steps({2, 2})) << "the second has the first pixel now";
}

TEST(GrowthFit, APixelThatNoLinkReachesIsKnown) {
  EXPECT_TRUE(TwoLinks().Reached({5, 4}));
  EXPECT_FALSE(TwoLinks().Reached({5, 5}));
}

}  // namespace
}  // namespace silhouette
