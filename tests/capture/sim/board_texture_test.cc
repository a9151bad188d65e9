// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/simulated_board.h"

#include <gtest/gtest.h>

#include "calib/boards/tag_family.h"
#include "capture/sim/chance.h"
#include "tests/random.h"

namespace silhouette {
namespace {

Board TwoByThree() {
  return Board({.name = "board", .rows = 2, .columns = 3, .tag_size = 0.05, .gap = 0.05});
}

TEST(BoardTexture, PaperReachesAroundThePrintsAndTheirMargin) {
  // tagStandard41h12: nine modules, five of them between the corners.
  const BoardTexture texture(TwoByThree(), 0.01);
  EXPECT_TRUE(texture.extent().min().isApprox(Eigen::Vector2d(-0.03, -0.03)));
  EXPECT_TRUE(texture.extent().max().isApprox(Eigen::Vector2d(0.28, 0.18)));
}

TEST(BoardTexture, ModulesLieWhereTheFamilySaysIt) {
  const BoardTexture texture(TwoByThree(), 0);
  const TagFamily family("tagStandard41h12");
  for (int tag = 0; tag < 6; ++tag) {
    const Eigen::Vector2d corner(tag % 3 * 0.1 - 0.02, tag / 3 * 0.1 - 0.02);
    for (int y = 0; y < 9; ++y) {
      for (int x = 0; x < 9; ++x) {
        const Eigen::Vector2d middle = corner + 0.01 * Eigen::Vector2d(x + 0.5, y + 0.5);
        EXPECT_EQ(texture.IsBlack(middle), !family.Modules(tag).White(x, y));
      }
    }
  }
  EXPECT_FALSE(texture.IsBlack({0.075, 0.02}));  // between two prints
}

TEST(BoardTexture, BlackShareIsTheShareOfPointsThatAreBlack) {
  Chance chance{Random()()};
  const BoardTexture texture(TwoByThree(), 0.01);
  for (int round = 0; round < 40; ++round) {
    const double size = chance.Uniform(0.001, 0.08);
    const Eigen::Vector2d middle(chance.Uniform(0, 0.25), chance.Uniform(0, 0.15));
    const Eigen::Rotation2Dd turn(chance.Uniform(0, 6));
    const Eigen::Vector2d along = turn * Eigen::Vector2d(size, 0.1 * size);
    const Eigen::Vector2d down = turn * Eigen::Vector2d(-0.2 * size, 0.8 * size);
    constexpr int kSteps = 200;
    int black = 0;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const double u = (i % kSteps + 0.5) / kSteps - 0.5;
      const double v = (i / kSteps + 0.5) / kSteps - 0.5;
      black += texture.IsBlack(middle + u * along + v * down) ? 1 : 0;
    }
    const double share =
        texture.BlackShare({middle - 0.5 * along - 0.5 * down, middle + 0.5 * along - 0.5 * down,
                            middle + 0.5 * along + 0.5 * down, middle - 0.5 * along + 0.5 * down});
    EXPECT_NEAR(share, black / static_cast<double>(kSteps * kSteps), 0.01);
  }
}

TEST(BoardTexture, BoardsThatCannotBePrintedAreMistakes) {
  EXPECT_THROW(BoardTexture(Board({.name = "b", .family = "tag99", .tag_size = 0.1}), 0),
               std::invalid_argument);
  EXPECT_THROW(BoardTexture(Board({.name = "b", .tag_size = 0.1, .first_id = 1 << 20}), 0),
               std::invalid_argument);
  EXPECT_THROW(
      BoardTexture(Board({.name = "b", .rows = 2, .columns = 2, .tag_size = 0.1, .gap = 0.05}), 0),
      std::invalid_argument);
  EXPECT_THROW(BoardTexture(TwoByThree(), -1), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
