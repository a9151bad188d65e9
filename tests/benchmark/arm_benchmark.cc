// SPDX-License-Identifier: Apache-2.0
// Nodes of an arm: the map of the RX130's first three joints (`arm_joints: 3`, max_move 5 cm), and
// checks of all six behind it.
//
// Drawing all nodes takes half an hour. Each kArmStride'th tile is drawn and indexed, in memory;
// figures are those of one node, and checks are of joint values whose nearest node is among them.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <bit>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "calib/robot/drawing/drawn_kind.h"
#include "calib/robot/reach.h"
#include "server/collision/collision_checker.h"
#include "server/collision/robot_image_table.h"
#include "server/collision/space_checker.h"
#include "tests/benchmark/drawn_bench.h"
#include "tests/benchmark/indexed_cell.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

constexpr uint64_t kArmStride = 32;
constexpr int kArmJoints = 3;
constexpr double kArmMove = 0.05;  // metres

ConfigurationGrid ArmGrid(const RobotModel& model) {
  std::vector<std::string> names;
  for (const RobotJoint& joint : model.joints()) names.push_back(joint.name);
  std::vector<GridJoint> joints;
  for (const RobotJoint& joint : model.joints()) {
    GridJoint range{.name = joint.name, .lower = joint.lower, .upper = joint.upper};
    const bool of_arm = joints.size() < kArmJoints;
    joints.push_back(
        of_arm ? MaxMoveJoint(range, Reach(model, joint.name, names, {}, 0).value(), kArmMove)
               : range);
  }
  return ConfigurationGrid(std::move(joints));
}

IndexedCell IndexOf(const RobotImageTable& table, DrawnKind kind) {
  const uint64_t tiles = (table.grid().tiles() + kArmStride - 1) / kArmStride;
  return IndexedCell(table.mask_sizes(), tiles, [&](size_t i, TileIndexBuilder& builder) {
    std::vector<uint64_t> words(table.words());
    uint64_t nodes = 0;
    for (uint64_t place = 0; place < kTileSize; ++place) {
      const ConfigurationNumber number = i * kArmStride * kTileSize + place;
      if (!table.grid().Contains(number)) continue;
      table.DrawNode(kind, number, words);
      std::vector<MaskWords> images;
      for (const MaskSize size : table.mask_sizes()) {
        images.emplace_back(words.data() + images.size() * size.words(), size.words());
      }
      builder.Add(place, images);
      ++nodes;
    }
    return nodes;
  });
}

// A scene, and the arm's map in it.
struct ArmScene {
  ObstacleImages images;
  std::optional<DrawnChecker> checker;
  std::vector<TileVerdicts> map;  // of every kArmStride'th tile
};

const Policy kArmPolicy{.min_views = 3};

struct ArmBench {
  ArmBench();

  std::vector<TileVerdicts> MapOf(const ObstacleImages& images) const {
    const CollisionChecker test(table, images, kArmPolicy);
    const SpaceChecker by_index(test, own.trees());
    std::vector<TileVerdicts> map;
    for (size_t i = 0; i < own.tiles().size(); ++i) {
      map.push_back(by_index.CheckNodes(own.tiles()[i], reach.tiles()[i]));
    }
    return map;
  }

  const DrawnBench& drawn = TheDrawnBench();
  RobotImageTable table = RobotImageTable::Drawn(ArmGrid(drawn.model), drawn.whole);
  IndexedCell own = IndexOf(table, DrawnKind::kOwn);
  IndexedCell reach = IndexOf(table, DrawnKind::kReach);
  std::vector<ArmScene> scenes[2];       // by Thing
  std::vector<Configuration> questions;  // whose nodes are in the map
};

ArmBench::ArmBench() {
  // It stands upright, and hides what is behind it.
  const std::vector<Mask> now =
      drawn.whole->Touched(std::vector<double>(drawn.model.joints().size()));
  for (const Thing thing : kThings) {
    const auto kind = static_cast<size_t>(thing);
    for (size_t i = 0; i < drawn.planes[kind].size(); ++i) {
      ArmScene& scene = scenes[kind].emplace_back();
      std::vector<std::optional<Mask>> planes;
      for (size_t view = 0; view < now.size(); ++view) {
        scene.images.push_back(
            ObstacleImage::FromScene(*drawn.planes[kind][i][view] | now[view], now[view]));
        planes.emplace_back(scene.images.back()->obstacle());
      }
      scene.checker.emplace(drawn.whole, std::move(planes));
      scene.map = MapOf(scene.images);
    }
  }
  std::mt19937_64 random;
  while (questions.size() < 4000) {
    Configuration q;
    for (const RobotJoint& joint : drawn.model.joints()) {
      q.push_back(std::uniform_real_distribution<double>(joint.lower, joint.upper)(random));
    }
    const auto node = table.grid().Nearest(q);
    if (node && *node / kTileSize % kArmStride == 0) questions.push_back(std::move(q));
  }
}

const ArmBench& TheArmBench() {
  static const ArmBench bench;
  return bench;
}

double NodesOf(const ArmBench& bench, Thing thing, bool occupied) {
  double nodes = 0;
  const auto& scenes = bench.scenes[static_cast<size_t>(thing)];
  for (const ArmScene& scene : scenes) {
    for (const TileVerdicts& tile : scene.map) {
      for (const uint64_t word : occupied ? tile.occupied : tile.free) {
        nodes += std::popcount(word);
      }
    }
  }
  return nodes / static_cast<double>(scenes.size());
}

// Counters: node_ns, median over the scenes; bytes_per_node, of both indices; grid_nodes, that the
// whole grid has.
void ArmMap(benchmark::State& state, Thing thing) {
  const ArmBench& bench = TheArmBench();
  const auto& scenes = bench.scenes[static_cast<size_t>(thing)];
  MeasureScenes(state, scenes.size(), Caches::kWarm,
                [&](size_t i) { benchmark::DoNotOptimize(bench.MapOf(scenes[i].images)); });
  const auto nodes = static_cast<double>(bench.own.configurations());
  state.counters["nodes"] = nodes;
  state.counters["grid_nodes"] = static_cast<double>(bench.table.grid().size());
  state.counters["node_ns"] = state.counters["median_ns"] / nodes;
  state.counters["bytes_per_node"] =
      static_cast<double>(bench.own.bytes() + bench.reach.bytes()) / nodes;
  state.counters["free_share"] = NodesOf(bench, thing, false) / nodes;
  state.counters["occupied_share"] = NodesOf(bench, thing, true) / nodes;
}

// Checks of the collision checker, with the map or without.
void ArmCheck(benchmark::State& state, Thing thing, bool with_map) {
  const ArmBench& bench = TheArmBench();
  std::vector<CollisionChecker> drawn;
  std::vector<CollisionChecker> behind;
  size_t by_map = 0;
  for (const ArmScene& scene : bench.scenes[static_cast<size_t>(thing)]) {
    drawn.emplace_back(bench.table, scene.images, kArmPolicy,
                       TestSupport{.drawn = &*scene.checker});
    const auto node_is_free = [&scene](ConfigurationNumber node) {
      const uint64_t place = node % kTileSize;
      const TileVerdicts& tile = scene.map[node / kTileSize / kArmStride];
      return (tile.free[place / 64] >> (place % 64) & 1) != 0;
    };
    behind.emplace_back(bench.table, scene.images, kArmPolicy,
                        TestSupport{.drawn = &*scene.checker, .node_is_free = node_is_free});
    for (const Configuration& q : bench.questions) {
      if (drawn.back().Check(q).state() != behind.back().Check(q).state()) {
        state.SkipWithError("not as without the map");
        return;
      }
      by_map += node_is_free(*bench.table.grid().Nearest(q)) ? 1 : 0;
    }
  }
  const std::vector<CollisionChecker>& checkers = with_map ? behind : drawn;
  const size_t each = bench.questions.size();
  MeasureMean(state, checkers.size() * each, [&](size_t i) {
    benchmark::DoNotOptimize(checkers[i / each].Check(bench.questions[i % each]));
  });
  state.counters["by_map_share"] =
      static_cast<double>(by_map) / static_cast<double>(checkers.size() * each);
}

const bool kArmRegistered = [] {
  const auto add = [](const std::string& name, auto function, auto... arguments) {
    benchmark::RegisterBenchmark(name.c_str(), function, arguments...)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  for (const Thing thing : kThings) {
    add("arm_map/" + NameOf(thing), ArmMap, thing);
    add("arm_check/" + NameOf(thing) + "/drawn", ArmCheck, thing, false);
    add("arm_check/" + NameOf(thing) + "/behind_map", ArmCheck, thing, true);
  }
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
