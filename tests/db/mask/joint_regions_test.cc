// SPDX-License-Identifier: Apache-2.0
#include "db/mask/joint_regions.h"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

namespace silhouette {
namespace {

using Values = std::vector<double>;

TEST(JointRegions, HoldWhatAMoveMayTouchWhateverTheWayOfItsJoints) {
  const JointRegions regions(
      {{{.joint = 0, .lower = 1, .upper = 2}},
       {{.joint = 0, .lower = 3, .upper = 4}, {.joint = 1, .lower = 0, .upper = 0}}});
  EXPECT_FALSE(regions.Between(Values{0, 0}, Values{0.9, 9}));
  EXPECT_EQ(regions.Between(Values{0, 0}, Values{1, 0}), 0u) << "bounds belong to it";
  EXPECT_EQ(regions.Between(Values{9, 0}, Values{0, 0}), 0u) << "backwards, too";
  EXPECT_FALSE(regions.Between(Values{3.5, 1}, Values{3.5, 2}));
  EXPECT_EQ(regions.Between(Values{3.5, 1}, Values{5, -1}), 1u);
  EXPECT_TRUE(regions.Fits(2));
  EXPECT_FALSE(regions.Fits(1));
  EXPECT_FALSE(JointRegions().Between(Values{}, Values{}));
}

TEST(JointRegions, HoldEveryTurnOfAJointWithoutEnd) {
  constexpr double kFullTurn = 2 * std::numbers::pi;
  const JointRegions regions({{{.joint = 0, .continuous = true, .lower = 1, .upper = 2}}});
  for (const int turns : {-3, 0, 1, 50}) {
    const double by = turns * kFullTurn;
    EXPECT_TRUE(regions.Between(Values{1.5 + by}, Values{1.5 + by}));
    EXPECT_FALSE(regions.Between(Values{2.1 + by}, Values{0.9 + kFullTurn + by}));
    EXPECT_TRUE(regions.Between(Values{2.1 + by}, Values{1.1 + kFullTurn + by}));
  }
}

TEST(JointRegions, ThatCannotBeAreRefused) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(JointRegions(std::vector<JointRegions::Region>(1)), std::invalid_argument);
  EXPECT_THROW(JointRegions({{{.joint = 0, .lower = 1, .upper = 0}}}), std::invalid_argument);
  EXPECT_THROW(JointRegions({{{.joint = 0, .lower = none, .upper = 0}}}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
