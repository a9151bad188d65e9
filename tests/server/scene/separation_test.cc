// SPDX-License-Identifier: Apache-2.0
// Distances to what may hold somebody: never more than the true ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "db/mask/interpolation.h"
#include "server/collision/separation.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/server/scene/drawn_scene.h"

namespace silhouette {
namespace {

struct SeparationTest : DrawnSceneTest {
  // Of the robot's body, at least: its distances end so much below the range.
  static constexpr double kLargestBall = 0.4;

  SeparationTest() { Serve(Seen()); }

  // What the cameras see nearly all of.
  static SeparationCell Seen() {
    return {
        .settings = {},
        .zone = Eigen::AlignedBox3d(Eigen::Vector3d(-1.3, -1.3, 0), Eigen::Vector3d(1.3, 1.3, 2)),
        .voxel_edge = 0.05,
        .unseen_is_empty = true};
  }

  void Serve(SeparationCell with, double ceiling = 1.8) {
    sound =
        SoundCell{.settings = {.least_obstacle = 0.2, .voxel_edge = 0.04, .model_tolerance = 0.005},
                  .workspace = Eigen::AlignedBox3d(Eigen::Vector3d(-1.1, -1.1, 0),
                                                   Eigen::Vector3d(1.1, 1.1, ceiling)),
                  .payload_radius = 0,
                  .robot = model};
    with.settings.levels = {{"slow", 0.25, 0.1, 0.02}, {"fast", 1, 0.3, 0.2}};
    sound->separation = with;
    auto loaded = Load({.calibration = calibration, .drawn = cell});
    ASSERT_TRUE(loaded.ok()) << loaded.status();
    database = *loaded;
  }

  // From the links that joints of the grid move to the nearest ball.
  double TrueDistance(const Configuration& q, const std::vector<DrawnCellBall>& balls) const {
    double least = std::numeric_limits<double>::infinity();
    const std::vector<Eigen::Isometry3d> poses =
        model->LinkPoses(std::vector<double>{q[0], q[1], 0.1});
    for (size_t link = 1; link < poses.size(); ++link) {
      const LinkGeometry& geometry = model->links()[link].visual[0];
      const Eigen::Vector3d half = std::get<BoxShape>(geometry.shape).size / 2;
      for (const DrawnCellBall& ball : balls) {
        const Eigen::Vector3d at = (poses[link] * geometry.link_from_shape).inverse() * ball.centre;
        least =
            std::min(least, Eigen::AlignedBox3d(-half, half).exteriorDistance(at) - ball.radius);
      }
    }
    return std::max(0.0, least);
  }

  // Of the boxes of those links.
  std::vector<Eigen::Vector3d> Corners(const Configuration& q) const {
    std::vector<Eigen::Vector3d> corners;
    const std::vector<Eigen::Isometry3d> poses =
        model->LinkPoses(std::vector<double>{q[0], q[1], 0.1});
    for (size_t link = 1; link < poses.size(); ++link) {
      const LinkGeometry& geometry = model->links()[link].visual[0];
      const Eigen::Vector3d half = std::get<BoxShape>(geometry.shape).size / 2;
      for (int corner = 0; corner < 8; ++corner) {
        const Eigen::Vector3d signs((corner & 1) * 2 - 1, (corner & 2) - 1, (corner & 4) / 2 - 1);
        corners.push_back(poses[link] * geometry.link_from_shape * half.cwiseProduct(signs));
      }
    }
    return corners;
  }

  std::vector<DrawnCellBall> SomebodyNear(const Configuration& now) {
    while (true) {
      std::uniform_real_distribution<double> place(-1.2, 1.2);
      const std::vector<DrawnCellBall> balls = {
          {{place(random), place(random), 0.2 + std::abs(place(random))}, 0.15}};
      if (!Touches(now, balls)) return balls;
    }
  }

  static constexpr Policy kSound{.preset = Preset::kSound};
};

TEST_F(SeparationTest, NoTrueDistanceOnAPathIsLess) {
  double told = 0;
  double in_truth = 0;
  for (int scene = 0; scene < SampleCount(10); ++scene) {
    const Configuration now = Any();
    const std::vector<DrawnCellBall> balls = SomebodyNear(now);
    const Checker checker = CheckerOf(InputOf(now, balls), kSound);
    for (int i = 0; i < 20; ++i) {
      const std::vector<Configuration> path = {Any(), Any()};
      const std::optional<PathDistance> distance = checker.Distance(path, {});
      ASSERT_TRUE(distance);
      double least = std::numeric_limits<double>::infinity();
      for (int step = 0; step <= 100; ++step) {
        Configuration q = path[0];
        for (size_t j = 0; j < 2; ++j) q[j] += step / 100.0 * (path[1][j] - path[0][j]);
        least = std::min(least, TrueDistance(q, balls));
      }
      ASSERT_LE(distance->distance, least) << "scene " << scene;
      told += distance->distance;
      in_truth += std::min(least, database->separation()->range());
    }
  }
  RecordProperty("share_of_true_distance_in_percent", static_cast<int>(100 * told / in_truth));
  EXPECT_GT(told, 0.7 * in_truth);
}

// As it tells the distance at single places, a millimetre apart.
TEST_F(SeparationTest, DistanceOnAPathIsNoMoreThanAtAnyPlaceAndACentimetreLessAtMost) {
  constexpr double kHalfStep = SeparationMeter::kStep / 2;
  int nearest_between = 0;
  int less_subtracted = 0;
  for (int scene = 0; scene < SampleCount(20); ++scene) {
    const Configuration now = Any();
    const Checker checker = CheckerOf(InputOf(now, SomebodyNear(now)), kSound);
    for (int i = 0; i < 10; ++i) {
      const std::vector<Configuration> path = {Any(), Any()};
      const double told = checker.Distance(path, {}).value().distance;
      double least = std::numeric_limits<double>::infinity();
      double at_an_end = 0;
      constexpr int kPlaces = 2000;
      for (int place = 0; place <= kPlaces; ++place) {
        const std::vector<Configuration> at = {
            Interpolated(path[0], path[1], place / double{kPlaces})};
        const double distance = checker.Distance(at, {}).value().distance;
        least = std::min(least, distance);
        if (place == 0) at_an_end = distance;
        if (place == kPlaces) at_an_end = std::min(at_an_end, distance);
      }
      EXPECT_LE(told, least + 1e-9) << "scene " << scene;
      EXPECT_GE(told, std::max(0.0, least - kHalfStep) - 1e-9) << "scene " << scene;
      if (least == 0 || least >= database->separation()->range()) continue;
      if (least < at_an_end) ++nearest_between;
      if (told > at_an_end - kHalfStep / 2) ++less_subtracted;
    }
  }
  if (SampleCount(20) < 20) return;  // by chance few paths tell nothing
  EXPECT_GT(nearest_between, 0) << "no path tells";
  EXPECT_GT(less_subtracted, 0) << "of paths that are nearest at an end";
}

TEST_F(SeparationTest, WhoeverAsksFirstDecidesNoDistanceOfAnother) {
  const Policy all_views{.max_occluded_views = 0};
  const Policy few_views{.max_occluded_views = 3};
  int differ = 0;
  for (int scene = 0; scene < 20; ++scene) {
    const Configuration now = Any();
    const SceneInput input = InputOf(now, {{SomebodyNear(now)[0].centre, 0.04}});
    const auto distance = [&](const Served& served, const Policy& policy) {
      return Checker(served, policy, settings, kDrawnNow)
          .Distance(std::vector<Configuration>{now}, {})
          .value()
          .distance;
    };
    const Served shared = ServedScene(input);
    const double first = distance(shared, all_views);
    EXPECT_EQ(distance(shared, few_views), distance(ServedScene(input), few_views));
    EXPECT_EQ(distance(shared, all_views), first);
    differ += first > distance(shared, few_views) ? 1 : 0;
  }
  EXPECT_GT(differ, 0) << "no scene tells";
}

TEST_F(SeparationTest, AnEmptyCellThatIsSeenKeepsEveryDistance) {
  int kept = 0;
  for (int scene = 0; scene < 10; ++scene) {
    const Configuration now = Any();
    const auto distance =
        CheckerOf(InputOf(now, {}), kSound).Distance(std::vector<Configuration>{now}, {});
    ASSERT_TRUE(distance);
    kept += distance->distance > database->separation()->range() - kLargestBall ? 1 : 0;
  }
  EXPECT_GE(kept, 9);
}

TEST_F(SeparationTest, WhatNoViewSeesMayHoldSomebody) {
  const Configuration now = {0, 0};
  SeparationCell farther = Seen();
  farther.zone->extend(Eigen::Vector3d(-3.5, 0, 0));
  farther.unseen_is_empty = false;
  Serve(farther);
  EXPECT_GT(database->separation()->unseen_share(), 0.01);
  const auto possible =
      CheckerOf(InputOf(now, {}), kSound).Distance(std::vector<Configuration>{now}, {});
  ASSERT_TRUE(possible);
  EXPECT_LT(possible->distance, database->separation()->range() - kLargestBall);
}

TEST_F(SeparationTest, UnseenSpaceThatIsStatedEmptyIsEmptyInTheWorkspaceToo) {
  const Configuration now = {0, 0};
  const auto at_start = [&](bool unseen_is_empty) {
    SeparationCell with = Seen();
    with.unseen_is_empty = unseen_is_empty;
    Serve(with, 2.8);
    const auto path =
        CheckerOf(InputOf(now, {}), kSound).Distance(std::vector<Configuration>{now}, {});
    return path ? path->at_start : -1;
  };
  EXPECT_LT(at_start(false), database->separation()->range() - kLargestBall);
  EXPECT_GT(at_start(true), database->separation()->range() - kLargestBall);
}

TEST_F(SeparationTest, APersonAtTheRimOfTheOnlyImageCountsThoughUnseenSpaceIsStatedEmpty) {
  const Configuration now = {0, 0};
  SeparationCell wide = Seen();
  wide.zone->extend(Eigen::Vector3d(-2, -2, 0)).extend(Eigen::Vector3d(2, 2, 2.4));
  Serve(wide);
  const std::vector<Mask> robot = truth->Touched(now);
  constexpr double kRadius = 0.2;
  std::uniform_real_distribution<double> place(-1.7, 1.7);
  int scenes = 0;
  for (int tries = 0; tries < 20000 && scenes < SampleCount(20); ++tries) {
    const Eigen::Vector3d at(place(random), place(random), 1.1 + place(random) / 2);
    const SceneInput input = InputOf(now, {{at, kRadius}});
    std::vector<size_t> shown;
    for (size_t view = 0; view < input.views.size(); ++view) {
      const Mask& mask = std::get<SceneMask>(input.views[view].image).mask;
      const size_t pixels = (mask & ~robot[view]).Count();
      if (pixels > 0) shown.push_back(pixels);
    }
    if (shown.size() != 1 || shown.front() > 40) continue;
    ++scenes;
    const Served served = ServedScene(input);
    const Checker checker(served, kSound, settings, kDrawnNow);
    ASSERT_TRUE(checker.Distance(std::vector<Configuration>{now}, {}));
    const SpaceDistances& space = served.scene->separation.Get(
        {database->separation(), MaxOccludedViews(kSound, database->views())},
        []() -> SpaceDistances { throw std::logic_error("it is there"); });
    PlacedHull middle(Eigen::Matrix3Xd(Eigen::Vector3d::Zero()), 0);
    middle.Place(Eigen::Isometry3d(Eigen::Translation3d(at)));
    EXPECT_LE(space.Distance(middle, 1), kRadius) << shown.front() << " pixels";
  }
  EXPECT_EQ(scenes, SampleCount(20));
}

TEST_F(SeparationTest, OnlyTheHorizonCounts) {
  const Configuration now = {0, 0};
  const std::vector<DrawnCellBall> balls = {{{-0.9, 0, 0.8}, 0.12}};
  const Checker checker = CheckerOf(InputOf(now, balls), kSound);
  const std::vector<Configuration> towards = {{0.5, 0}, {3, 0}};
  const auto whole = checker.Distance(towards, {});
  const auto beginning = checker.Distance(towards, 0.3);
  ASSERT_TRUE(whole && beginning);
  EXPECT_LT(whole->distance, 0.2);
  EXPECT_GT(whole->fraction, 0.8);
  EXPECT_GT(beginning->distance, whole->distance + 0.2);
  EXPECT_EQ(beginning->at_start, whole->at_start);
}

TEST_F(SeparationTest, TheHorizonCountsWhatTheFastestPointReallyMoves) {
  constexpr double kHorizon = 0.4;
  int least_at_the_end = 0;
  for (int scene = 0; scene < SampleCount(20); ++scene) {
    const Configuration now = Any();
    const std::vector<DrawnCellBall> balls = SomebodyNear(now);
    const Checker checker = CheckerOf(InputOf(now, balls), kSound);
    const std::vector<Configuration> path = {now, Any()};
    const auto told = checker.Distance(path, kHorizon);
    ASSERT_TRUE(told);
    double least = std::numeric_limits<double>::infinity();
    double moved = 0;
    std::vector<Eigen::Vector3d> before;
    for (int step = 0; step <= 500 && moved < kHorizon; ++step) {
      Configuration q = path[0];
      for (size_t j = 0; j < 2; ++j) q[j] += step / 500.0 * (path[1][j] - path[0][j]);
      const std::vector<Eigen::Vector3d> corners = Corners(q);
      double farthest = 0;
      for (size_t i = 0; i < before.size(); ++i) {
        farthest = std::max(farthest, (corners[i] - before[i]).norm());
      }
      moved += farthest;
      before = corners;
      const double distance = TrueDistance(q, balls);
      if (distance < least && moved > 0.9 * kHorizon) ++least_at_the_end;
      least = std::min(least, distance);
    }
    EXPECT_LE(told->distance, least) << "scene " << scene;
  }
  EXPECT_GT(least_at_the_end, 0) << "no scene tells";
}

TEST_F(SeparationTest, WithoutASceneNothingIsKnown) {
  const Checker checker({database, nullptr, Reason::kNoScene}, kSound, settings, kDrawnNow);
  EXPECT_FALSE(checker.Distance(std::vector<Configuration>{{0, 0}}, {}));
}

// A round forearm, and a cable along it, which the images have and the model has not.
TEST(SeparationMeter, WhatARoundPartWasGrownByGoesRoundWithIt) {
  const auto robot = RobotModel::FromUrdf(WriteFile(FreshFolder() / "robot.urdf", R"(
      <robot name="r"><link name="base"/><link name="elbow"/>
      <link name="forearm"><visual><origin xyz="0 0 0.3"/>
        <geometry><cylinder radius="0.065" length="0.4"/></geometry></visual></link>
      <joint name="bend" type="revolute"><parent link="base"/><child link="elbow"/>
        <axis xyz="0 1 0"/><limit lower="-2" upper="2"/></joint>
      <joint name="roll" type="revolute"><parent link="elbow"/><child link="forearm"/>
        <axis xyz="0 0 1"/><limit lower="-3" upper="3"/></joint></robot>)"));
  ASSERT_TRUE(robot.ok()) << robot.status();
  const DrawnCell cell{.robot = std::make_shared<const RobotModel>(*robot), .parts = {}};
  const auto drawn = DrawnRobotOf(cell, std::vector<std::string>{"bend", "roll"}, {}, Calibration{},
                                  {}, 0, std::vector<double>{0, 0, 0.08});
  ASSERT_TRUE(drawn.ok()) << drawn.status();
  const VoxelGrid grid(Eigen::AlignedBox3d(Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1)),
                       0.02);
  VoxelSet hand(grid);
  hand.Insert(60, 50, 65);  // 20 cm from the axis
  const SpaceDistances space({{hand, grid}}, 2);
  SeparationMeter meter(*drawn, space);
  const auto distance = [&](const std::vector<Configuration>& way) {
    return meter.Along(way, std::nullopt).value().distance;
  };
  EXPECT_LT(distance({{0, 0}}), 0.06);
  EXPECT_LT(distance({{0, 0}, {0, 1.5}}), 0.06);
}

}  // namespace
}  // namespace silhouette
