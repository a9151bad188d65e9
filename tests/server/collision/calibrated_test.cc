// SPDX-License-Identifier: Apache-2.0
// The calibrated test (paper §3.3): Table 3 row by row, and against a plain per-pixel reference.
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "server/collision/collision_checker.h"
#include "tests/random.h"
#include "tests/server/collision/random_cell.h"
#include "tests/server/collision/random_geometry.h"

namespace silhouette {
namespace {

// Views of one column; a pixel's line in another view is the pixel of the same row.
EpipolarBands RowsMeetRows(int views, int height) {
  Calibration calibration;
  for (int a = 0; a < views; ++a) {
    for (int b = a + 1; b < views; ++b) {
      Eigen::Matrix3d f = Eigen::Matrix3d::Zero();
      f(1, 2) = 1;
      f(2, 1) = -1;
      calibration.fundamental_matrices.push_back({a, b, f});
    }
  }
  return {calibration, std::vector<MaskSize>(static_cast<size_t>(views), MaskSize{1, height})};
}

// One column of B, O, U and E, as an obstacle image.
ObstacleImage Column(const std::string& pixels) {
  const MaskSize size{1, static_cast<int>(pixels.size())};
  const auto is = [&](const std::string& letters) {
    return Mask::FromPredicate(size, [&, letters](int, int y) {
      return letters.find(pixels[static_cast<size_t>(y)]) != std::string::npos;
    });
  };
  return ObstacleImage::FromScene(is("OU"), is("UE"));
}

std::string ObstaclePixels(const Mask& mask) {
  std::string pixels;
  for (int y = 0; y < mask.height(); ++y) pixels += mask.at(0, y) ? 'O' : 'B';
  return pixels;
}

// What a pixel of the first of three views becomes, by what its lines show in the others.
// `by_table`: as Table 3 has it; else as the prose, in intersection images of a robot everywhere.
char Resolved(char pixel, char second, char third, bool by_table) {
  const EpipolarBands bands = RowsMeetRows(3, 1);
  ObstacleImages images;
  IntersectionImages intersections;
  for (const char value : {pixel, second, third}) {
    images.push_back(Column(std::string(1, value)));
    intersections.emplace_back(IntersectionImage(*images.back(), ~Mask({1, 1})));
  }
  const CollisionImages collision = by_table ? ResolvedObstacleImages(images, bands)
                                             : CalibratedCollisionImages(intersections, bands);
  return ObstaclePixels(*collision[0])[0];
}

TEST(Table3, SomeLineAllBackgroundMakesBackground) {
  for (char pixel : {'U', 'E'}) {
    for (char other : {'B', 'O', 'U', 'E'}) {
      for (bool by_table : {false, true}) {
        EXPECT_EQ(Resolved(pixel, 'B', other, by_table), 'B') << pixel << other;
        EXPECT_EQ(Resolved(pixel, other, 'B', by_table), 'B') << pixel << other;
      }
    }
  }
}

TEST(Table3, ElseSomeLineWithAnObstacleMakesAnObstacle) {
  for (char pixel : {'U', 'E'}) {
    for (char other : {'O', 'U', 'E'}) {
      for (bool by_table : {false, true}) {
        EXPECT_EQ(Resolved(pixel, 'O', other, by_table), 'O') << pixel << other;
        EXPECT_EQ(Resolved(pixel, other, 'O', by_table), 'O') << pixel << other;
      }
    }
  }
}

TEST(Table3, OnlyUnknownPixelsOnTheLinesMakeBackground) {
  for (bool by_table : {false, true}) {
    EXPECT_EQ(Resolved('U', 'U', 'U', by_table), 'B');
    EXPECT_EQ(Resolved('E', 'U', 'U', by_table), 'B');
  }
}

TEST(Table3, ErrorPixelsOnALineConvictInTheTablesReadingNotInTheProse) {
  for (const char* lines : {"EU", "UE", "EE"}) {
    EXPECT_EQ(Resolved('U', lines[0], lines[1], false), 'B') << lines;
    EXPECT_EQ(Resolved('U', lines[0], lines[1], true), 'O') << lines;
  }
}

TEST(Table3, ObstacleAndBackgroundPixelsStayWhatTheyAre) {
  for (char other : {'B', 'O', 'U', 'E'}) {
    EXPECT_EQ(Resolved('O', other, 'B', true), 'O') << other;
    EXPECT_EQ(Resolved('B', other, 'O', true), 'B') << other;
  }
}

TEST(Table3, SingleViewResolvesNothing) {
  const CollisionImages images = ResolvedObstacleImages({Column("UEOB")}, RowsMeetRows(1, 4));
  EXPECT_EQ(ObstaclePixels(*images[0]), "BBOB");
}

TEST(Table3, EveryPixelHasItsOwnLines) {
  const CollisionImages images =
      ResolvedObstacleImages({Column("UUEO"), Column("OBOU")}, RowsMeetRows(2, 4));
  EXPECT_EQ(ObstaclePixels(*images[0]), "OBOO");
  EXPECT_EQ(ObstaclePixels(*images[1]), "OBOO");
}

// A line that only passes the test robot image: all background in the intersection image, an
// obstacle in the obstacle image.
TEST(CalibratedPresets, LinesInTheIntersectionImagesAcquitWhatLinesInTheObstacleImagesConvict) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 0, .steps = 1}});
  const std::vector<MaskSize> sizes(2, MaskSize{1, 3});
  const auto rows = [](const std::string& pixels) {
    return Mask::FromPredicate({1, 3}, [=](int, int y) { return pixels[y] == 'R'; });
  };
  RobotImageTable::Builder builder(grid, sizes);
  builder.Add(0, std::vector<Mask>{rows("RBB"), rows("BRB")});
  const RobotImageTable table = std::move(builder).Build();
  const ObstacleImages images = {Column("UBB"), Column("OOB")};
  const EpipolarBands bands = RowsMeetRows(2, 3);
  const auto check = [&](Preset preset) {
    return CollisionChecker(table, images, {.preset = preset}, {.bands = &bands})
        .Check(ConfigurationNumber{0});
  };
  EXPECT_TRUE(check(Preset::kCalibrated).free());
  EXPECT_EQ(check(Preset::kPaperCalibrated).state(), State::kOccupied);
}

struct CalibratedTest : ::testing::Test {
  Random random;
};

std::vector<Policy> CalibratedPolicies(int views) {
  std::vector<Policy> policies;
  for (Preset preset : {Preset::kCalibrated, Preset::kPaperCalibrated}) {
    policies.push_back({.preset = preset});
    for (int min_views = 1; min_views <= views; ++min_views) {
      policies.push_back({.preset = preset, .min_views = min_views});
    }
  }
  return policies;
}

char PixelOf(const ObstacleImage& image, int x, int y) {
  if (image.obstacle().at(x, y)) return 'O';
  if (image.unknown().at(x, y)) return 'U';
  return image.error().at(x, y) ? 'E' : 'B';
}

// Table 3 for one pixel, looking at every pixel of every other view. `seen(j, x, y)`: what counts.
template <typename Seen>
bool IsObstacle(const ObstacleImages& images, const EpipolarBands& bands, int view, int x, int y,
                bool errors_convict, const Seen& seen) {
  bool convicted = false;
  for (int other = 0; other < bands.views(); ++other) {
    if (other == view) continue;
    if (!images[other]) {
      convicted = true;
      continue;
    }
    bool something = false;
    const MaskSize size = images[other]->size();
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        const int p = y * images[view]->size().width + x;
        if (!bands.Meet(view, p, other, v * size.width + u)) continue;
        const char pixel = seen(other, u, v);
        something = something || pixel != 'B';
        convicted = convicted || pixel == 'O' || (pixel == 'E' && errors_convict);
      }
    }
    if (!something) return false;
  }
  return convicted;
}

State CalibratedReference(const ObstacleImages& images, const std::vector<Mask>& test_robot,
                          const EpipolarBands& bands, const Policy& policy) {
  const bool paper = policy.preset == Preset::kPaperCalibrated;
  const auto seen = [&](int view, int x, int y) {
    return !paper && !test_robot[view].at(x, y) ? 'B' : PixelOf(*images[view], x, y);
  };
  int showing = 0;
  bool missing = false;
  for (int view = 0; view < bands.views(); ++view) {
    bool shows = !images[view];
    missing = missing || !images[view];
    for (int y = 0; images[view] && y < images[view]->size().height; ++y) {
      for (int x = 0; x < images[view]->size().width; ++x) {
        if (!test_robot[view].at(x, y)) continue;
        const char pixel = PixelOf(*images[view], x, y);
        shows = shows || pixel == 'O' ||
                (pixel != 'B' && IsObstacle(images, bands, view, x, y, paper, seen));
      }
    }
    if (shows) ++showing;
  }
  if (showing >= MinViews(policy, bands.views())) return State::kOccupied;
  return missing ? State::kUnknown : State::kFree;
}

TEST_F(CalibratedTest, AgreesWithTheReferenceOnRandomImagesMatricesAndPolicies) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 0, .steps = 1}});
  std::array<int, 3> states{};
  int turned = 0;
  for (int round = 0; round < 250; ++round) {
    const int views = 1 + round % 4;
    const std::vector<MaskSize> sizes = RandomSizes(views, random);
    const EpipolarBands bands(RandomCalibration(views, 0.1, random), sizes, 0.3 * (round % 2));
    ObstacleImages images;
    std::vector<Mask> test_robot;
    for (MaskSize size : sizes) {
      const Mask scene =
          RandomMask(size, round % 2 == 0 ? 0.2 : 0.01, random) | RandomBox(size, random);
      images.push_back(ObstacleImage::FromScene(scene, RandomBox(size, random)));
      test_robot.push_back(round % 3 == 0 ? RandomBox(size, random)
                                          : RandomMask(size, 0.08, random));
      if (random() % 16 == 0) images.back().reset();
    }
    RobotImageTable::Builder builder(grid, sizes);
    builder.Add(0, test_robot);
    const RobotImageTable table = std::move(builder).Build();
    const Verdict uncalibrated =
        CollisionChecker(table, images, {.preset = Preset::kPaper}).Check(0);
    for (const Policy& policy : CalibratedPolicies(views)) {
      const CollisionChecker test(table, images, policy, {.bands = &bands});
      const Verdict verdict = test.Check(ConfigurationNumber{0});
      ASSERT_EQ(verdict.state(), CalibratedReference(images, test_robot, bands, policy))
          << NameOf(policy.preset) << ", round " << round;
      const TileVerdicts tile = test.CheckTile(0);
      ASSERT_EQ(tile.free[0] & 1, verdict.free() ? 1u : 0u);
      ASSERT_EQ(tile.occupied[0] & 1, verdict.state() == State::kOccupied ? 1u : 0u);
      ++states[static_cast<size_t>(verdict.state())];
      if (verdict.state() != uncalibrated.state() && !policy.min_views) ++turned;
    }
  }
  EXPECT_GT(states[0], 0);
  EXPECT_GT(states[1], 0);
  EXPECT_GT(states[2], 0);
  EXPECT_GT(turned, 0) << "no verdict depended on the lines";
}

TEST_F(CalibratedTest, VerdictsAreThoseOfTheCollisionImages) {
  for (int round = 0; round < 100; ++round) {
    const std::vector<MaskSize> sizes = RandomSizes(3, random);
    const EpipolarBands bands(RandomCalibration(3, 0, random), sizes);
    const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 0, .steps = 1}});
    const RobotImageTable table = RandomTable(grid, sizes, 0.1, random);
    const ObstacleImages images = RandomObstacleImages(sizes, 0.3, random);
    for (const Policy& policy : CalibratedPolicies(3)) {
      CollisionImages collision = ResolvedObstacleImages(images, bands);
      if (policy.preset == Preset::kCalibrated) {
        IntersectionImages intersections;
        for (int view = 0; view < 3; ++view) {
          intersections.emplace_back(IntersectionImage(*images[view], (*table.Images(0))[view]));
        }
        collision = CalibratedCollisionImages(intersections, bands);
      }
      int showing = 0;
      for (int view = 0; view < 3; ++view) {
        if (Intersects(collision[view]->words(), table.image(view, 0))) ++showing;
      }
      const CollisionChecker test(table, images, policy, {.bands = &bands});
      EXPECT_EQ(test.Check(ConfigurationNumber{0}).free(), showing < test.min_views());
    }
  }
}

TEST_F(CalibratedTest, ImagesResolvedBeforehandGiveTheSameVerdicts) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 200}});
  const std::vector<MaskSize> sizes = RandomSizes(3, random);
  const EpipolarBands bands(RandomCalibration(3, 0, random), sizes);
  const RobotImageTable table = RandomTable(grid, sizes, 0.05, random);
  const ObstacleImages images = RandomObstacleImages(sizes, 0.2, random);
  const Policy policy{.preset = Preset::kPaperCalibrated};
  const CollisionImages resolved = ResolvedObstacleImages(images, bands);
  const CollisionChecker own(table, images, policy, {.bands = &bands});
  const CollisionChecker given(table, images, policy, {.bands = &bands, .resolved = &resolved});
  for (uint64_t tile = 0; tile < grid.tiles(); ++tile) {
    EXPECT_EQ(own.CheckTile(tile), given.CheckTile(tile));
  }
}

TEST_F(CalibratedTest, LosingAViewNeverTurnsOccupiedIntoFree) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 40}});
  for (int round = 0; round < 30; ++round) {
    const std::vector<MaskSize> sizes = RandomSizes(3, random);
    const EpipolarBands bands(RandomCalibration(3, 0.1, random), sizes);
    const RobotImageTable table = RandomTable(grid, sizes, 0.05, random);
    const ObstacleImages images = RandomObstacleImages(sizes, 0.2, random);
    ObstacleImages fewer = images;
    fewer[random() % 3].reset();
    for (const Policy& policy : CalibratedPolicies(3)) {
      const CollisionChecker all(table, images, policy, {.bands = &bands});
      const CollisionChecker rest(table, fewer, policy, {.bands = &bands});
      for (ConfigurationNumber number = 0; number < 40; ++number) {
        const State before = all.Check(number).state();
        const Verdict after = rest.Check(number);
        EXPECT_FALSE(after.free());
        EXPECT_TRUE(before != State::kOccupied || after.state() == State::kOccupied);
      }
    }
  }
}

TEST_F(CalibratedTest, MarginNeverTurnsOccupiedIntoFree) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 1, .steps = 60}});
  int turned = 0;
  for (int round = 0; round < 25; ++round) {
    const std::vector<MaskSize> sizes = RandomSizes(3, random);
    const EpipolarBands bands(RandomCalibration(3, 0.1, random), sizes);
    const RobotImageTable table = RandomTable(grid, sizes, 0.05, random);
    const ObstacleImages images = RandomObstacleImages(sizes, 0.15, random);
    ObstacleImages grown;
    for (const auto& image : images) grown.push_back(image->WithMargin(0.2 + random() % 3));
    std::vector<Policy> policies = CalibratedPolicies(3);
    policies.push_back({});
    policies.push_back({.preset = Preset::kPaper});
    for (const Policy& policy : policies) {
      const CollisionChecker before(table, images, policy, {.bands = &bands});
      const CollisionChecker after(table, grown, policy, {.bands = &bands});
      for (ConfigurationNumber number = 0; number < 60; ++number) {
        EXPECT_LE(after.Check(number).free(), before.Check(number).free());
        if (before.Check(number).free() && !after.Check(number).free()) ++turned;
      }
    }
  }
  EXPECT_GT(turned, 0);
}

TEST(CalibratedPresets, AreRefusedWithoutWhatTheyNeed) {
  const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 0, .steps = 1}});
  const std::vector<MaskSize> sizes(2, MaskSize{1, 3});
  const RobotImageTable table = RobotImageTable::Builder(grid, sizes).Build();
  const ObstacleImages images = {Column("UBB"), Column("OOB")};
  const EpipolarBands bands = RowsMeetRows(2, 3);
  const EpipolarBands others = RowsMeetRows(2, 4);
  const CollisionImages missing(2);
  const Policy policy{.preset = Preset::kPaperCalibrated};
  EXPECT_NO_THROW(CollisionChecker(table, images, policy, {.bands = &bands}));
  EXPECT_THROW(CollisionChecker(table, images, policy), std::invalid_argument);
  EXPECT_THROW(CollisionChecker(table, images, policy, {.bands = &others}), std::invalid_argument);
  EXPECT_THROW(CollisionChecker(table, images, policy, {.bands = &bands, .resolved = &missing}),
               std::invalid_argument);
  EXPECT_THROW(ResolvedObstacleImages(images, others), std::invalid_argument);
  EXPECT_THROW(ResolvedObstacleImages({Column("UBB")}, bands), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
