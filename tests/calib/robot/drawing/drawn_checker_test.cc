// SPDX-License-Identifier: Apache-2.0
// Answers of DrawnChecker, compared with masks that are drawn whole and intersected.
#include "calib/robot/drawing/drawn_checker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/calib/robot/drawing/random_robots.h"
#include "tests/calib/robot/drawing/random_views.h"
#include "tests/random.h"

namespace silhouette {
namespace {

// A few balls, a lone pixel, noise, nothing, or all.
Mask RandomPlane(Random& random, MaskSize size) {
  switch (random() % 6) {
    case 0:
      return Mask(size);
    case 1:
      return ~Mask(size);
    case 2:
      return Mask::FromPredicate(size, [&](int, int) { return random() % 200 == 0; });
    case 3: {
      const int x = static_cast<int>(random() % static_cast<size_t>(size.width));
      const int y = static_cast<int>(random() % static_cast<size_t>(size.height));
      return Mask::FromPredicate(size, [&](int u, int v) { return u == x && v == y; });
    }
    default: {
      const double x = Uniform(random, 0, size.width);
      const double y = Uniform(random, 0, size.height);
      const double radius = Uniform(random, 1, 0.3 * size.width);
      return Mask::FromPredicate(size,
                                 [&](int u, int v) { return std::hypot(u - x, v - y) < radius; });
    }
  }
}

// By part, each its own.
std::vector<double> RandomGrowth(Random& random, const DrawnRobot& robot, double most) {
  std::vector<double> growth(robot.parts().size());
  for (double& part : growth) part = random() % 3 == 0 ? 0 : Uniform(random, 0, most);
  return growth;
}

std::shared_ptr<const DrawnRobot> RobotOf(const RobotModel& model, Random& random) {
  std::vector<PartDrawer> views;
  for (int view = 0; view < 4; ++view) {
    const double margin = view == 0 ? 0 : Uniform(random, 0, 2);
    views.emplace_back(CameraAbout(random), RandomMaskSize(random), margin);
  }
  return std::make_shared<const DrawnRobot>(Drawn(model, std::move(views)));
}

// What DrawnChecker promises, the long way.
int Reference(const DrawnRobot& robot, const std::vector<std::optional<Mask>>& planes,
              const std::vector<double>& q, Growth growth) {
  DrawingScratch scratch;
  std::vector<Eigen::Isometry3d> poses;
  robot.chain().Pose(q, poses);
  int showing = 0;
  for (size_t view = 0; view < planes.size(); ++view) {
    std::vector<uint64_t> words(robot.views()[view].size().words());
    robot.AddTouched(view, poses, growth, scratch, words);
    if (!planes[view] || Intersects(planes[view]->words(), words)) ++showing;
  }
  return showing;
}

// Of four.
int ViewsShowing(const DrawnChecker& checker, const std::vector<double>& q, Growth growth,
                 DrawnCheckScratch& scratch) {
  int views = 0;
  while (views < 4 && checker.Showing(q, growth, views + 1, scratch) > views) ++views;
  return views;
}

// Balls near the camera, beside and behind it are drawn otherwise.
TEST(DrawnChecker, AnswersAsMasksDrawnWholeDoThoughTheCameraIsCloseToTheRobot) {
  Random random;
  int close[5] = {};
  for (int trial = 0; trial < 40; ++trial) {
    const RobotModel model = Rx130();
    const std::vector<double> near = RandomPositions(random, model);
    const std::vector<Eigen::Isometry3d> poses = model.LinkPoses(near);
    std::vector<PartDrawer> views;
    for (int view = 0; view < 4; ++view) {
      // Within a hand's breadth of a link, in any direction.
      Eigen::Isometry3d pose = RandomPose(random, {0, 0, 0});
      pose.translation() = poses[random() % poses.size()].translation() +
                           Uniform(random, 0, 0.5) * RandomDirection(random);
      views.emplace_back(RandomCamera(random, pose.inverse()), MaskSize{64, 64},
                         Uniform(random, 0, 0.5));
    }
    const auto robot = std::make_shared<const DrawnRobot>(Drawn(model, std::move(views)));
    std::vector<std::optional<Mask>> planes;
    for (const PartDrawer& view : robot->views()) {
      planes.emplace_back(RandomPlane(random, view.size()));
    }
    const DrawnChecker checker(robot, planes);
    DrawnCheckScratch scratch;
    for (int i = 0; i < 40; ++i) {
      std::vector<double> q = near;
      for (double& value : q) value += Uniform(random, -0.2, 0.2);
      const int expected = Reference(*robot, planes, q, {});
      ASSERT_EQ(ViewsShowing(checker, q, {}, scratch), expected) << "trial " << trial;
      ++close[expected];
    }
  }
  for (const int count : close) EXPECT_GT(count, 10);
}

TEST(DrawnChecker, AnswersAsMasksDrawnWholeDo) {
  Random random;
  int answers[5] = {};
  for (int trial = 0; trial < 12; ++trial) {
    const RobotModel model = trial % 3 == 2 ? OfMeshes(random) : Rx130();
    const auto robot = RobotOf(model, random);
    DrawnCheckScratch scratch;
    for (int scene = 0; scene < 4; ++scene) {
      std::vector<std::optional<Mask>> planes;
      for (const PartDrawer& view : robot->views()) {
        planes.push_back(random() % 8 == 0 ? std::nullopt
                                           : std::optional(RandomPlane(random, view.size())));
      }
      const DrawnChecker checker(robot, planes);
      for (int i = 0; i < SampleCount(15); ++i) {
        const std::vector<double> q = RandomPositions(random, model);
        const std::vector<double> grown = RandomGrowth(random, *robot, 0.02);
        const Growth growth = i % 2 == 0 ? Growth(grown) : Growth();
        const int expected = Reference(*robot, planes, q, growth);
        ++answers[expected];
        for (int enough = 1; enough <= 5; ++enough) {
          const int showing = checker.Showing(q, growth, enough, scratch);
          ASSERT_EQ(showing >= enough, expected >= enough)
              << "trial " << trial << ", scene " << scene << ", question " << i;
          ASSERT_TRUE(!growth.empty() || (showing == 0) == (expected == 0));
          ASSERT_LE(showing, std::min(enough, expected));
          ASSERT_EQ(checker.ShownBy(enough, q, growth, scratch), expected >= enough);
        }
      }
    }
  }
  for (const int count : answers) EXPECT_GT(count, SampleCount(20));
}

TEST(PlaneDistances, AreOfTheNearestSquareAndNeverMore) {
  Random random;
  for (int trial = 0; trial < 40; ++trial) {
    const MaskSize size = trial == 0 ? MaskSize{1, 1} : RandomMaskSize(random);
    if (size.width > 128) continue;
    const Mask plane = RandomPlane(random, size);
    const PlaneDistances distances(plane);
    std::vector<std::pair<int, int>> set;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        if (plane.at(x, y)) set.emplace_back(x, y);
      }
    }
    if (set.size() > 300) continue;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        double nearest = PlaneDistances::kMost;
        for (const auto& [u, v] : set) {
          nearest = std::min(nearest, std::hypot(std::max(std::abs(u - x) - 0.5, 0.0),
                                                 std::max(std::abs(v - y) - 0.5, 0.0)));
        }
        const double got = distances.units()[static_cast<size_t>(y * size.width + x)] /
                           double{PlaneDistances::kUnits};
        ASSERT_LE(got, nearest) << x << ' ' << y;
        ASSERT_GE(got, nearest - 1.0 / 32 - 1e-9) << x << ' ' << y;
      }
    }
  }
}

TEST(DrawnChecker, PartsThatAreTakenForBallsMissNoView) {
  Random random;
  int more = 0;
  int questions = 0;
  for (int trial = 0; trial < 12; ++trial) {
    const RobotModel model = trial % 3 == 2 ? OfMeshes(random) : Rx130();
    const auto robot = RobotOf(model, random);
    DrawnCheckScratch scratch;
    for (int scene = 0; scene < 6; ++scene) {
      std::vector<std::optional<Mask>> planes;
      for (const PartDrawer& view : robot->views()) {
        planes.emplace_back(RandomPlane(random, view.size()));
      }
      const DrawnChecker checker(robot, planes);
      for (int i = 0; i < 10; ++i) {
        const std::vector<double> q = RandomPositions(random, model);
        const std::vector<double> growth = RandomGrowth(random, *robot, 0.3);
        const int least = Reference(*robot, planes, q, growth);
        const int showing = ViewsShowing(checker, q, growth, scratch);
        ASSERT_GE(showing, least);
        more += showing - least;
        questions += 4;
      }
    }
  }
  EXPECT_LT(more, questions / 8);
}

TEST(DrawnChecker, GrownRobotsShowNoFewerViews) {
  Random random;
  const RobotModel model = Rx130();
  const auto robot = RobotOf(model, random);
  DrawnCheckScratch scratch;
  int more = 0;
  for (int scene = 0; scene < 12; ++scene) {
    std::vector<std::optional<Mask>> planes;
    for (const PartDrawer& view : robot->views())
      planes.push_back(RandomPlane(random, view.size()));
    const DrawnChecker checker(robot, planes);
    for (int i = 0; i < 10; ++i) {
      const std::vector<double> q = RandomPositions(random, model);
      std::vector<double> growth(robot->parts().size());
      int before = ViewsShowing(checker, q, {}, scratch);
      for (int step = 0; step < 6; ++step) {
        const int showing = ViewsShowing(checker, q, growth, scratch);
        if (step == 0) {
          EXPECT_EQ(showing, before);
        }
        EXPECT_GE(showing, before) << "scene " << scene << ", step " << step;
        more += showing - before;
        before = showing;
        for (double& part : growth) part += Uniform(random, 0, 0.05);
      }
    }
  }
  EXPECT_GT(more, 10);
}

TEST(DrawnChecker, MissingViewShowsAnObstacle) {
  Random random;
  const auto robot = RobotOf(Rx130(), random);
  std::vector<std::optional<Mask>> planes;
  for (const PartDrawer& view : robot->views()) planes.emplace_back(Mask(view.size()));
  DrawnCheckScratch scratch;
  const std::vector<double> q(6);
  EXPECT_EQ(DrawnChecker(robot, planes).Showing(q, {}, 4, scratch), 0);
  planes[1] = std::nullopt;
  EXPECT_EQ(ViewsShowing(DrawnChecker(robot, planes), q, {}, scratch), 1);
  planes[3] = std::nullopt;
  EXPECT_EQ(ViewsShowing(DrawnChecker(robot, planes), q, {}, scratch), 2);
  EXPECT_EQ(DrawnChecker(robot, planes).Showing(q, {}, 1, scratch), 1);
}

TEST(DrawnChecker, JointValuesThatAreNoNumbersShowInAllViews) {
  Random random;
  const auto robot = RobotOf(Rx130(), random);
  std::vector<std::optional<Mask>> planes;
  for (const PartDrawer& view : robot->views()) planes.emplace_back(Mask(view.size()));
  const DrawnChecker checker(robot, planes);
  DrawnCheckScratch scratch;
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(checker.Showing(std::vector<double>{0, 0, bad, 0, 0, 0}, {}, 4, scratch), 4);
    EXPECT_EQ(checker.Showing(std::vector<double>{0, 0, 0, 0, 0, bad}, {}, 3, scratch), 3);
  }
}

TEST(DrawnChecker, RobotBeyondSinglePrecisionIsDrawnAsItIs) {
  Random random;
  const KinematicChain chain({{.name = "slide", .lower = 0, .upper = 1}},
                             {ChainLink{}, ChainLink{.parent = 0, .joint = 0, .slides = true}});
  RobotPart box{.moves_with = 1, .points = PointsOf(BoxMesh({0.2, 0.2, 0.2})), .inner = {}};
  // Its six edges do not fill two vectors.
  RobotPart tetrahedron = box;
  tetrahedron.points = 0.2 * Eigen::Matrix3Xd::Identity(3, 4);
  std::vector<PartDrawer> views;
  std::vector<std::optional<Mask>> planes;
  for (int view = 0; view < 4; ++view) {
    views.emplace_back(CameraAbout(random), MaskSize{64, 64});
    planes.emplace_back(~Mask(MaskSize{64, 64}));
  }
  const auto robot =
      std::make_shared<const DrawnRobot>(chain, std::vector<RobotPart>{box, tetrahedron}, views);
  const DrawnChecker checker(robot, planes);
  DrawnCheckScratch scratch;
  for (const double far : {1.0, 1e30, -1e30, 1e38, -1e39, 1e200, -1e300}) {
    const std::vector<double> q = {far};
    EXPECT_EQ(ViewsShowing(checker, q, {}, scratch), Reference(*robot, planes, q, {})) << far;
  }
}

TEST(DrawnChecker, QuestionsThatCannotBeAreRefused) {
  Random random;
  const auto robot = RobotOf(Rx130(), random);
  std::vector<std::optional<Mask>> planes(4);
  EXPECT_THROW(DrawnChecker(nullptr, planes), std::invalid_argument);
  EXPECT_THROW(DrawnChecker(robot, std::vector<std::optional<Mask>>(3)), std::invalid_argument);
  planes[2] = Mask({7, 7});
  EXPECT_THROW(DrawnChecker(robot, planes), std::invalid_argument);
  planes[2] = Mask(robot->views()[2].size());
  const DrawnChecker checker(robot, planes);
  DrawnCheckScratch scratch;
  const std::vector<double> q(6);
  EXPECT_THROW(checker.Showing(q, {}, 0, scratch), std::invalid_argument);
  EXPECT_THROW(checker.Showing(std::vector<double>(5), {}, 4, scratch), std::invalid_argument);
  EXPECT_THROW(checker.Showing(q, std::vector<double>(2), 4, scratch), std::invalid_argument);
  std::vector<double> shrunk(robot->parts().size());
  shrunk.back() = -0.01;
  EXPECT_THROW(checker.Showing(q, shrunk, 4, scratch), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
