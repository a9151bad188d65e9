// SPDX-License-Identifier: Apache-2.0
#include "server/collision/robot_image_table.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/random.h"
#include "tests/server/collision/random_cell.h"

namespace silhouette {
namespace {

const std::vector<MaskSize> kSizes = {{9, 8}, {5, 7}};

ConfigurationGrid Grid() {
  return ConfigurationGrid({{.name = "a", .lower = 0, .upper = 1, .steps = 5},
                            {.name = "b", .lower = 0, .upper = 2, .steps = 3}});
}

ConfigurationNumber At(const ConfigurationGrid& grid, int a, int b) {
  return grid.NumberOf({a, b});
}

TEST(RobotImageTable, TellsPresentExcludedCorruptAndMissingApart) {
  const ConfigurationGrid grid = Grid();
  RobotImageTable::Builder builder(grid, kSizes);
  builder.Add(At(grid, 0, 0), std::vector<Mask>{Mask(kSizes[0]), Mask(kSizes[1])});
  builder.AddWithout(At(grid, 0, 1), RobotImageState::kExcluded);
  builder.AddWithout(At(grid, 0, 2), RobotImageState::kCorrupt);
  const RobotImageTable table = std::move(builder).Build();
  EXPECT_EQ(table.state(At(grid, 0, 0)), RobotImageState::kPresent);
  EXPECT_EQ(table.state(At(grid, 0, 1)), RobotImageState::kExcluded);
  EXPECT_EQ(table.state(At(grid, 0, 2)), RobotImageState::kCorrupt);
  EXPECT_EQ(table.state(At(grid, 1, 0)), RobotImageState::kMissing);
  EXPECT_EQ(table.state(grid.number_limit()), RobotImageState::kMissing);
  EXPECT_EQ(table.state(~ConfigurationNumber{0}), RobotImageState::kMissing);
  EXPECT_EQ(table.Count(RobotImageState::kPresent), 1u);
  EXPECT_EQ(table.Count(RobotImageState::kExcluded), 1u);
  EXPECT_EQ(table.Count(RobotImageState::kCorrupt), 1u);
  EXPECT_EQ(table.Count(RobotImageState::kMissing), 12u);
}

TEST(RobotImageTable, GivesBackTheMasksInWhateverOrderTheyWereAdded) {
  Random random;
  const ConfigurationGrid grid = Grid();
  std::vector<ConfigurationNumber> numbers;
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 3; ++b) numbers.push_back(At(grid, a, b));
  }
  std::shuffle(numbers.begin(), numbers.end(), random);
  RobotImageTable::Builder builder(grid, kSizes);
  std::vector<std::vector<Mask>> added;
  for (ConfigurationNumber number : numbers) {
    added.push_back({RandomMask(kSizes[0], 0.5, random), RandomMask(kSizes[1], 0.5, random)});
    builder.Add(number, added.back());
  }
  const RobotImageTable table = std::move(builder).Build();
  for (size_t i = 0; i < numbers.size(); ++i) EXPECT_EQ(table.Images(numbers[i]), added[i]);
}

TEST(RobotImageTable, PermanentPixelsAreThoseOfAllImages) {
  const ConfigurationGrid grid = Grid();
  const auto column = [&](int from, int to) {
    return Mask::FromPredicate(kSizes[0], [=](int x, int) { return from <= x && x <= to; });
  };
  RobotImageTable::Builder builder(grid, {kSizes[0]});
  builder.Add(At(grid, 0, 0), std::vector<Mask>{column(0, 5)});
  builder.Add(At(grid, 1, 0), std::vector<Mask>{column(3, 8)});
  builder.Add(At(grid, 2, 0), std::vector<Mask>{column(2, 4)});
  builder.AddWithout(At(grid, 3, 0), RobotImageState::kExcluded);
  EXPECT_EQ(std::move(builder).Build().permanent(0), column(3, 4));
}

TEST(RobotImageTable, WithoutImagesNoPixelIsPermanent) {
  EXPECT_TRUE(RobotImageTable::Builder(Grid(), kSizes).Build().permanent(1).Empty());
}

TEST(RobotImageTable, ViewThatIsEmptyOrAlwaysTheSameShowsNoMotion) {
  const Mask some = Mask::FromPredicate(kSizes[0], [](int x, int) { return x == 1; });
  const Mask more = Mask::FromPredicate(kSizes[0], [](int x, int) { return x <= 1; });
  const Mask none(kSizes[0]);
  EXPECT_NE(WhyNoMotionShows("left", none, none, 1), "");
  EXPECT_NE(WhyNoMotionShows("left", some, some, 10), "");
  EXPECT_EQ(WhyNoMotionShows("left", some, some, 9), "") << "they may be neighbours";
  EXPECT_EQ(WhyNoMotionShows("left", more, some, 10), "");
  EXPECT_EQ(WhyNoMotionShows("left", none, none, 0), "") << "nothing is captured";
}

TEST(RobotImageTable, WrongMasksAreRefused) {
  const ConfigurationGrid grid = Grid();
  RobotImageTable::Builder builder(grid, kSizes);
  const Mask first(kSizes[0]);
  const Mask second(kSizes[1]);
  EXPECT_THROW(builder.Add(0, std::vector<Mask>{first}), std::invalid_argument);
  EXPECT_THROW(builder.Add(0, std::vector<Mask>{second, first}), std::invalid_argument);
  EXPECT_THROW(builder.Add(grid.number_limit(), std::vector<Mask>{first, second}),
               std::invalid_argument);
  builder.AddWithout(0, RobotImageState::kExcluded);
  EXPECT_THROW(builder.Add(0, std::vector<Mask>{first, second}), std::invalid_argument);
  EXPECT_THROW(builder.AddWithout(0, RobotImageState::kCorrupt), std::invalid_argument);
  EXPECT_THROW(RobotImageTable::Builder(grid, {}), std::invalid_argument);
}

TEST(RobotImageTable, GridTooLargeForMemoryIsRefused) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 1 << 17},
                                {.name = "b", .lower = 0, .upper = 1, .steps = 1 << 17}});
  EXPECT_THROW(RobotImageTable::Builder(grid, kSizes), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
