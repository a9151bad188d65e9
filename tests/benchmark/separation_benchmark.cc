// SPDX-License-Identifier: Apache-2.0
// Speed and separation: distances from somebody in a zone of 4 x 4 x 2.2 m in voxels of 4 cm, and
// of the RX130 to them.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "calib/robot/drawing/motion_check.h"
#include "calib/robot/drawn_cell.h"
#include "calib/robot/robot_model.h"
#include "server/collision/separation.h"
#include "tests/folders.h"

namespace silhouette::benchmarks {
namespace {

using Eigen::Vector3d;

constexpr double kZoneEdge = 0.04;
constexpr double kZoneRange = 2;  // metres

const VoxelGrid& Zone() {
  static const VoxelGrid grid({Vector3d(-2, -2, 0), Vector3d(2, 2, 2.2)}, kZoneEdge);
  return grid;
}

// A cylinder of a person's size.
VoxelSet Somebody() {
  VoxelSet set(Zone());
  for (int z = 0; z < Zone().size(2); ++z) {
    for (int y = 0; y < Zone().size(1); ++y) {
      for (int x = 0; x < Zone().size(0); ++x) {
        const Vector3d at = Zone().Box(x, y, z).center();
        if (at.z() < 1.75 && (at - Vector3d(1.2, 0.6, 0)).head<2>().norm() < 0.25) {
          set.Insert(x, y, z);
        }
      }
    }
  }
  return set;
}

// What the cameras see of it does not matter.
std::shared_ptr<const DrawnRobot> Rx130() {
  const auto model = std::make_shared<const RobotModel>(
      RobotModel::FromUrdf(SourceFolder() + "/capture/sim/robots/rx130.urdf").value());
  std::vector<std::string> moving;
  for (const RobotJoint& joint : model->joints()) moving.push_back(joint.name);
  Calibration calibration;
  calibration.cameras.emplace_back(
      CameraIntrinsics{.width = 64, .height = 64, .fx = 78, .fy = 78, .cx = 31.5, .cy = 31.5},
      Eigen::Isometry3d(Eigen::Translation3d(0, 0, 5)));
  return std::make_shared<const DrawnRobot>(DrawnRobotOf({.robot = model, .parts = {}}, moving, {},
                                                         calibration,
                                                         std::vector<MaskSize>{{64, 64}}, 0)
                                                .value());
}

void BM_SeparationScene(benchmark::State& state) {
  const VoxelSet somebody = Somebody();
  for (auto _ : state) {
    benchmark::DoNotOptimize(SpaceDistances({{somebody, Zone()}}, kZoneRange));
  }
  state.counters["voxels"] = static_cast<double>(Zone().voxels());
}

std::vector<Configuration> RandomPlaces(const DrawnRobot& robot) {
  std::mt19937_64 random(1);
  std::vector<Configuration> places(64);
  for (Configuration& q : places) {
    for (const ChainJoint& joint : robot.chain().joints()) {
      q.push_back(std::uniform_real_distribution<double>(joint.lower, joint.upper)(random));
    }
  }
  return places;
}

// A single configuration, of which nothing is known before.
void BM_SeparationConfiguration(benchmark::State& state) {
  const std::shared_ptr<const DrawnRobot> robot = Rx130();
  const VoxelSet somebody = Somebody();
  const SpaceDistances space({{somebody, Zone()}}, kZoneRange);
  SeparationMeter meter(*robot, space);
  const std::vector<Configuration> places = RandomPlaces(*robot);
  size_t next = 0;
  for (auto _ : state) {
    const Configuration& q = places[next++ % places.size()];
    benchmark::DoNotOptimize(meter.Along(std::span(&q, 1), {}));
  }
  state.counters["parts"] = static_cast<double>(robot->parts().size());
}

// A place of a straight motion of all joints, on which the robot touches nothing.
void BM_SeparationPlace(benchmark::State& state) {
  const std::shared_ptr<const DrawnRobot> robot = Rx130();
  const VoxelSet somebody = Somebody();
  const SpaceDistances space({{somebody, Zone()}}, kZoneRange);
  SeparationMeter meter(*robot, space);
  struct Motion {
    std::array<Configuration, 2> ends;
    benchmark::IterationCount places = 0;
  };
  std::vector<Motion> motions;
  const std::vector<Configuration> places = RandomPlaces(*robot);
  for (size_t i = 0; i + 1 < places.size(); ++i) {
    const Motion motion{
        .ends = {places[i], places[i + 1]},
        .places = static_cast<benchmark::IterationCount>(
            GreatestDisplacement(*robot, places[i], places[i + 1]) / SeparationMeter::kStep)};
    if (meter.Along(motion.ends, {})->distance > 0) motions.push_back(motion);
  }
  if (motions.empty()) return state.SkipWithError("no motion is clear");
  size_t next = 0;
  while (state.KeepRunningBatch(motions[next].places)) {
    benchmark::DoNotOptimize(meter.Along(motions[next].ends, {}));
    next = (next + 1) % motions.size();
  }
  state.counters["motions"] = static_cast<double>(motions.size());
}

BENCHMARK(BM_SeparationScene)->Name("separation_scene")->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_SeparationConfiguration)
    ->Name("separation_configuration")
    ->Unit(benchmark::kNanosecond);
BENCHMARK(BM_SeparationPlace)->Name("separation_place")->Unit(benchmark::kNanosecond);

}  // namespace
}  // namespace silhouette::benchmarks
