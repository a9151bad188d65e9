// SPDX-License-Identifier: Apache-2.0
// The scripts of people, and the robot's motion.
#include "tools/silhouette-experiments/people/person.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tools/silhouette-experiments/people/motion.h"

namespace silhouette::people_experiment {
namespace {

constexpr double kTick = 0.05;

TEST(PeopleScripts, SomebodyIsInsideAboutHalfOfTheTime) {
  Chance chance(1);
  constexpr int kScripts = 300;
  constexpr double kFence = 1.9;
  int inside = 0;
  int all = 0;
  for (int i = 0; i < kScripts; ++i) {
    const std::vector<Person> people = RandomPeople(chance, {.seconds = 60, .fence = kFence});
    ASSERT_GE(people.size(), 1u);
    ASSERT_LE(people.size(), 3u);
    for (double time = 0; time < 60; time += 0.5, ++all) {
      if (AnyInside(people, std::vector(people.size(), time), kFence)) ++inside;
    }
  }
  EXPECT_GT(inside, 0.35 * all);
  EXPECT_LT(inside, 0.65 * all);
}

TEST(PeopleScripts, NobodyMovesFasterThanPeopleDo) {
  Chance chance(2);
  for (int i = 0; i < 30; ++i) {
    for (const Person& person : RandomPeople(chance, {})) {
      for (double time = 0; time < 60; time += kTick) {
        const PersonKey now = person.At(time);
        const PersonKey next = person.At(time + kTick);
        ASSERT_LE((next.position - now.position).norm(), 1.6001 * kTick);
        const Eigen::Isometry3d before = person.PartsAt(time)[kArm].world_from_shape;
        const Eigen::Isometry3d after = person.PartsAt(time + kTick)[kArm].world_from_shape;
        const Eigen::Vector3d hand(0, 0, -0.3);
        ASSERT_LE((after * hand - before * hand).norm(), 2.5 * kTick);
      }
    }
  }
}

TEST(PathFollower, KeepsItsAccelerationAndStandsAtTheEnd) {
  const auto movement = [](std::span<const double> a, std::span<const double> b) {
    return std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]);
  };
  Chance chance(3);
  constexpr double kAcceleration = 4;
  for (int run = 0; run < 50; ++run) {
    PathFollower robot({0, 0}, movement, kAcceleration);
    const std::vector<Configuration> way = {
        {0, 0}, {chance.Uniform(-2, 2), 1}, {chance.Uniform(-2, 2), chance.Uniform(-2, 2)}};
    robot.Follow(way);
    for (int tick = 0; tick < 1000 && robot.left() > 0; ++tick) {
      const double before = robot.speed();
      const Configuration at = robot.at();
      const double allowed = chance.Uniform() < 0.2 ? 0 : chance.Uniform(0.1, 1.5);
      robot.Advance(kTick, allowed);
      if (robot.left() > 0) {
        ASSERT_LE(std::abs(robot.speed() - before), kAcceleration * kTick + 1e-9);
      }
      ASSERT_LE(movement(at, robot.at()), 1.5 * kTick + 1e-9);
    }
    ASSERT_TRUE(robot.stands());
    ASSERT_EQ(robot.at(), way.back());
  }
}

TEST(PathFollower, StopsWithinItsStoppingDistance) {
  const auto movement = [](std::span<const double> a, std::span<const double> b) {
    return std::abs(a[0] - b[0]);
  };
  PathFollower robot({0}, movement, 4);
  robot.Follow({{0}, {10}});
  for (int tick = 0; tick < 20; ++tick) robot.Advance(kTick, 1.2);
  const double from = robot.at()[0];
  const double stopping = robot.StoppingDistance();
  EXPECT_NEAR(stopping, 0.18, 1e-9);
  while (!robot.stands()) robot.Advance(kTick, 0);
  EXPECT_NEAR(robot.at()[0] - from, stopping, 0.01);
}

}  // namespace
}  // namespace silhouette::people_experiment
