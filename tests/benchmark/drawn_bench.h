// SPDX-License-Identifier: Apache-2.0
// A robot of six joints that is drawn, scenes about it, and questions.
//
// The RX130, four views of 64 x 64 pixels 4.2 m away that show its whole reach. Scenes: a person's
// cylinder, or a box of a hand's size, within reach. The planes are all that these touch.
#pragma once

#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/robot/drawing/drawn_checker.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/robot_model.h"
#include "db/mask/mask.h"

namespace silhouette::benchmarks {

inline constexpr int kDrawnScenes = 8;  // of a kind
inline constexpr double kDrawnVoxel = 0.02;

enum class Thing { kPerson, kHand };
inline constexpr Thing kThings[] = {Thing::kPerson, Thing::kHand};
// "person", "hand".
std::string NameOf(Thing thing);

// A cylinder or box, upright.
struct Obstacle {
  Thing thing = Thing::kPerson;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  Eigen::Vector3d half = Eigen::Vector3d::Zero();  // x and y: the cylinder's radius

  Eigen::Matrix3Xd Points() const;
  // Whether it meets a voxel about `point`, or nearly.
  bool Meets(const Eigen::Vector3d& point) const;
};

struct DrawnBench {
  RobotModel model;
  std::shared_ptr<const DrawnRobot> robot;  // of its moving links
  std::shared_ptr<const DrawnRobot> whole;  // with its base
  std::vector<Obstacle> obstacles[2];       // by Thing, as are both:
  std::vector<DrawnChecker> checkers[2];
  std::vector<std::vector<std::optional<Mask>>> planes[2];
  std::vector<std::vector<double>> questions;  // joint values
};
const DrawnBench& TheDrawnBench();

// Of the processor, in this thread.
double ThreadSeconds();

// Counter mean_ns: of one of `count` calls of ask(i), time of the processor; per_second: of them.
template <typename Ask>
void MeasureMean(benchmark::State& state, size_t count, Ask ask) {
  double least = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    const double begin = ThreadSeconds();
    for (size_t i = 0; i < count; ++i) ask(i);
    const double time = ThreadSeconds() - begin;
    least = std::min(least, time);
    state.SetIterationTime(time);
  }
  state.counters["mean_ns"] = least * 1e9 / static_cast<double>(count);
  state.counters["per_second"] = static_cast<double>(count) / least;
}

}  // namespace silhouette::benchmarks
