// SPDX-License-Identifier: Apache-2.0
// Speed and separation: distances from somebody in a zone of 4 x 4 x 2.2 m in voxels of 4 cm, and
// of the RX130 to them.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "calib/robot/drawn_cell.h"
#include "calib/robot/robot_model.h"
#include "server/collision/separation.h"
#include "tests/folders.h"

namespace silhouette::benchmarks {
namespace {

using Eigen::Vector3d;

constexpr double kZoneEdge = 0.04;
constexpr double kZoneRange = 2;  // metres
// Where the robot can be.
const Eigen::AlignedBox3d kReach(Vector3d(-1, -1, 0), Vector3d(1, 1, 1.6));

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
    benchmark::DoNotOptimize(SpaceDistances({{somebody, Zone()}}, kZoneRange, {}, kReach));
  }
  state.counters["voxels"] = static_cast<double>(Zone().voxels());
}

// A place of a path on which all joints move.
void BM_SeparationPlace(benchmark::State& state) {
  const std::shared_ptr<const DrawnRobot> robot = Rx130();
  const VoxelSet somebody = Somebody();
  const SpaceDistances space({{somebody, Zone()}}, kZoneRange, {}, kReach);
  SeparationMeter meter(*robot, space);
  std::mt19937_64 random(1);
  std::vector<Configuration> places(64);
  for (Configuration& q : places) {
    for (const ChainJoint& joint : robot->chain().joints()) {
      q.push_back(std::uniform_real_distribution<double>(joint.lower, joint.upper)(random));
    }
  }
  size_t next = 0;
  for (auto _ : state) {
    const Configuration& q = places[next++ % places.size()];
    benchmark::DoNotOptimize(meter.Along(std::span(&q, 1), {}));
  }
  state.counters["balls"] = static_cast<double>(robot->balls().balls());
}

BENCHMARK(BM_SeparationScene)->Name("separation_scene")->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_SeparationPlace)->Name("separation_place")->Unit(benchmark::kNanosecond);

}  // namespace
}  // namespace silhouette::benchmarks
