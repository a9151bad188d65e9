// SPDX-License-Identifier: Apache-2.0
// Motions of drawn robots, compared with densely sampled ones.
#include "calib/robot/drawing/motion_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "calib/robot/drawing/drawn_checker.h"
#include "tests/calib/robot/drawing/random_robots.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/random.h"

namespace silhouette {
namespace {

struct MotionCell {
  explicit MotionCell(RobotModel of = Rx130()) : model(std::move(of)) {
    std::vector<PartDrawer> views;
    for (int view = 0; view < 4; ++view) views.emplace_back(CameraAbout(random), MaskSize{64, 64});
    robot = std::make_shared<const DrawnRobot>(Drawn(model, std::move(views)));
  }

  DrawnChecker RandomScene() {
    std::vector<std::optional<Mask>> planes;
    for (const PartDrawer& view : robot->views()) {
      const double x = Uniform(random, 0, 64);
      const double y = Uniform(random, 0, 64);
      const double radius = Uniform(random, 2, 20);
      planes.emplace_back(Mask::FromPredicate(
          view.size(), [&](int u, int v) { return std::hypot(u - x, v - y) < radius; }));
    }
    return {robot, std::move(planes)};
  }

  // From anywhere, about as far as `metres` for the point that moves farthest.
  std::pair<std::vector<double>, std::vector<double>> RandomMotion(double metres) {
    const std::vector<double> from = RandomPositions(random, model);
    const std::vector<double> towards = RandomPositions(random, model);
    const double share = metres / GreatestDisplacement(*robot, from, towards);
    std::vector<double> to;
    for (size_t j = 0; j < from.size(); ++j) to.push_back(std::lerp(from[j], towards[j], share));
    return {from, to};
  }

  Random random;
  RobotModel model;
  std::shared_ptr<const DrawnRobot> robot;
};

std::vector<double> At(const std::vector<double>& from, const std::vector<double>& to,
                       double place) {
  std::vector<double> q;
  for (size_t j = 0; j < from.size(); ++j) q.push_back(std::lerp(from[j], to[j], place));
  return q;
}

class MotionOf : public ::testing::TestWithParam<bool> {
 protected:
  // Or one with joints that slide, and links that mimic.
  MotionCell cell = GetParam() ? MotionCell(Rx130()) : MotionCell(Gripper());
};

INSTANTIATE_TEST_SUITE_P(Robots, MotionOf, ::testing::Bool());

TEST_P(MotionOf, ProvenMotionMeetsNoObstacleWhereverItIsSampled) {
  DrawnCheckScratch scratch;
  int proven = 0;
  int sampled = 0;
  int met = 0;
  for (int trial = 0; trial < 150; ++trial) {
    const DrawnChecker scene = cell.RandomScene();
    const auto [from, to] = cell.RandomMotion(Uniform(cell.random, 0.05, 1.2));
    const int views = 1 + trial % 4;
    const auto is_free = [&](const MotionPlace& place) {
      return scene.Showing(place.q, place.growth, views, scratch) < views;
    };
    const double resolution = trial % 3 == 0 ? 0.6 : 0.02;
    const MotionCheck check = CheckMotion(*cell.robot, from, to, resolution, is_free);
    const auto is_free_at = [&](double place) {
      return is_free({.q = At(from, to, place), .growth = {}});
    };
    const double moved = GreatestDisplacement(*cell.robot, from, to);
    if (!check.free) {
      ++met;
      EXPECT_FALSE(is_free_at(check.fraction)) << "trial " << trial;
      // Nothing of what stands before it was found not free.
      const int steps = static_cast<int>(check.fraction * moved / resolution);
      if (check.sampled_step == 0) continue;
      int blocked = 0;
      for (int i = 0; i < steps; ++i) {
        if (!is_free_at(check.fraction * i / steps)) ++blocked;
      }
      EXPECT_LE(blocked, 1) << "trial " << trial;
      continue;
    }
    if (check.sampled_step > 0) {
      ++sampled;
      EXPECT_LE(check.sampled_step, resolution / 2) << "trial " << trial;
      continue;
    }
    ++proven;
    for (int i = 0; i <= 200; ++i) {
      ASSERT_TRUE(is_free_at(i / 200.0)) << "trial " << trial << ", place " << i / 200.0;
    }
  }
  EXPECT_GT(proven, 30);
  EXPECT_GT(sampled, 0);
  EXPECT_GT(met, 30);
}

TEST(MotionCheck, PlaceThatIsFoundIsTheFirst) {
  MotionCell cell;
  DrawnCheckScratch scratch;
  for (int trial = 0; trial < 60; ++trial) {
    const auto [from, to] = cell.RandomMotion(0.4);
    // Not free from a place on, and again free beyond another: the first is reported.
    const double first = Uniform(cell.random, 0, 0.9);
    const double length = Uniform(cell.random, 0.06, 0.2);
    double asked = 0;
    const MotionCheck check =
        CheckMotion(*cell.robot, from, to, 0.005, [&](const MotionPlace& place) {
          if (!place.growth.empty()) return false;  // nothing is proven
          EXPECT_GE(place.fraction, asked) << "along the motion";
          asked = place.fraction;
          const bool here = asked >= first && asked <= first + length;
          return !here && asked < 0.97;
        });
    EXPECT_FALSE(check.free);
    EXPECT_GE(check.fraction, first);
    EXPECT_LE(check.fraction, first + 0.005 / 0.4) << "trial " << trial;
  }
}

TEST(MotionCheck, StepThatIsReportedIsHowItWasSampled) {
  MotionCell cell;
  const auto [from, to] = cell.RandomMotion(0.3);
  for (const double resolution : {0.1, 0.01, 0.005}) {
    std::vector<double> places;
    const MotionCheck check =
        CheckMotion(*cell.robot, from, to, resolution, [&](const MotionPlace& place) {
          if (!place.growth.empty()) return false;
          places.push_back(place.fraction);
          return true;
        });
    EXPECT_TRUE(check.free);
    EXPECT_LE(check.sampled_step, resolution / 2);
    EXPECT_GT(check.sampled_step, resolution / 4.1);
    ASSERT_GT(places.size(), 2u);
    EXPECT_EQ(places.front(), 0);
    EXPECT_EQ(places.back(), 1);
    for (size_t i = 1; i < places.size(); ++i) {
      EXPECT_GT(places[i], places[i - 1]) << "no place is asked twice";
      EXPECT_LE((places[i] - places[i - 1]) * GreatestDisplacement(*cell.robot, from, to),
                check.sampled_step * (1 + 1e-6));
    }
  }
}

TEST(MotionCheck, OneLookProvesAMotionFarFromObstacles) {
  MotionCell cell;
  const auto [from, to] = cell.RandomMotion(0.3);
  std::vector<double> grown;
  const MotionCheck check =
      CheckMotion(*cell.robot, from, to, 0.005, [&](const MotionPlace& place) {
        grown.assign(place.growth.begin(), place.growth.end());
        return true;
      });
  EXPECT_TRUE(check.free);
  EXPECT_EQ(check.sampled_step, 0);
  EXPECT_EQ(check.checks, 1);
  // No farther from the middle than the levers say.
  ASSERT_EQ(grown.size(), cell.robot->parts().size());
  for (size_t part = 0; part < grown.size(); ++part) {
    double half = 0;
    for (size_t j = 0; j < from.size(); ++j) {
      half += std::abs(to[j] - from[j]) / 2 * cell.robot->Lever(part, j);
    }
    EXPECT_NEAR(grown[part], half, 1e-8);
    EXPECT_GE(grown[part], half);
  }
}

// The growth at the middle is as far as any point moves, and little more is claimed.
TEST_P(MotionOf, GrownPartsHoldWhereTheyAreAllAlong) {
  Random random;
  const size_t joints = cell.model.joints().size();
  std::vector<double> closest(joints);  // by the joint that moves alone
  for (int trial = 0; trial < 600; ++trial) {
    auto [from, to] = cell.RandomMotion(Uniform(random, 0.05, 2));
    const size_t alone = random() % joints;
    if (trial % 3 != 0) {
      for (size_t j = 0; j < joints; ++j) to[j] = j == alone ? to[j] : from[j];
    }
    std::vector<Eigen::Isometry3d> middle;
    std::vector<Eigen::Isometry3d> there;
    cell.robot->chain().Pose(At(from, to, 0.5), middle);
    cell.robot->chain().Pose(At(from, to, trial % 2 == 0 ? 1 : Uniform(random, 0, 1)), there);
    for (size_t i = 0; i < cell.robot->parts().size(); ++i) {
      const RobotPart& part = cell.robot->parts()[i];
      double half = 0;
      for (size_t j = 0; j < from.size(); ++j) {
        half += std::abs(to[j] - from[j]) / 2 * cell.robot->Lever(i, j);
      }
      const Eigen::Matrix3Xd apart =
          there[part.moves_with] * part.points - middle[part.moves_with] * part.points;
      EXPECT_LE(apart.colwise().norm().maxCoeff(), half + 1e-12);
      if (trial % 3 == 0 || half < 1e-6) continue;
      closest[alone] = std::max(closest[alone], apart.colwise().norm().maxCoeff() / half);
    }
  }
  for (size_t j = 0; j < joints; ++j) EXPECT_GT(closest[j], 0.2) << "joint " << j;
}

TEST(MotionCheck, PlacesKnowWhereTheyAreAndWhatStretchTheyStandFor) {
  MotionCell cell;
  const auto [from, to] = cell.RandomMotion(0.3);
  int grown = 0;
  int sampled = 0;
  CheckMotion(*cell.robot, from, to, 0.005, [&, &from = from, &to = to](const MotionPlace& place) {
    const std::vector<double> q = At(from, to, place.fraction);
    EXPECT_TRUE(std::ranges::equal(q, place.q));
    if (place.growth.empty()) {
      ++sampled;
      return place.fraction == place.first || place.fraction == place.last ||
             place.fraction == std::midpoint(place.first, place.last);
    }
    ++grown;
    EXPECT_DOUBLE_EQ(place.fraction, std::midpoint(place.first, place.last));
    // The part that moves farthest is grown by what it moves from the middle to either end.
    const double half =
        GreatestDisplacement(*cell.robot, At(from, to, place.first), At(from, to, place.last)) / 2;
    EXPECT_NEAR(std::ranges::max(place.growth), half, 1e-8);
    return false;
  });
  EXPECT_GT(grown, 100);
  EXPECT_GT(sampled, 100);
}

TEST(MotionCheck, RobotThatRestsIsCheckedWhereItIs) {
  MotionCell cell;
  const std::vector<double> q = RandomPositions(cell.random, cell.model);
  const auto check = [&](bool free) {
    return CheckMotion(*cell.robot, q, q, 0.005, [&](const MotionPlace& place) {
      EXPECT_TRUE(std::ranges::equal(place.q, q));
      EXPECT_TRUE(std::ranges::all_of(place.growth, [](double part) { return part == 0; }));
      return free;
    });
  };
  EXPECT_TRUE(check(true).free);
  EXPECT_EQ(check(true).sampled_step, 0);
  EXPECT_FALSE(check(false).free);
  EXPECT_EQ(check(false).fraction, 0);
}

TEST(MotionCheck, MotionsThatCannotBeAreRefused) {
  MotionCell cell;
  const auto check = [&](std::vector<double> from, std::vector<double> to, double resolution) {
    return CheckMotion(*cell.robot, from, to, resolution, [](const MotionPlace&) { return true; });
  };
  const std::vector<double> q(6);
  EXPECT_THROW(check(q, std::vector<double>(5), 0.005), std::invalid_argument);
  EXPECT_THROW(check(q, q, 0), std::invalid_argument);
  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(check(q, q, none), std::invalid_argument);
  EXPECT_THROW(check(q, {0, 0, none, 0, 0, 0}, 0.005), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
