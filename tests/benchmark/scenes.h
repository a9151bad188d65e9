// SPDX-License-Identifier: Apache-2.0
// Obstacles that come into a synthesised cell.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/benchmark/synthetic_cell.h"

namespace silhouette::benchmarks {

enum class SceneKind {
  kPerson,   // a person of 1.75 m who stands 0.8 to 1.5 m from the robot's axis and reaches for it
  kHand,     // a hand of the size of a fist with a piece of forearm, within reach
  kClutter,  // 24 balls and bars of 4 to 12 cm radius all over the cell
};
inline constexpr SceneKind kSceneKinds[] = {SceneKind::kPerson, SceneKind::kHand,
                                            SceneKind::kClutter};
// "person", "hand", "clutter".
std::string NameOf(SceneKind kind);

struct BenchmarkScene {
  std::vector<Capsule> obstacles;
  Configuration robot;  // where the robot stands
  ObstacleImages images;
};

// The scene of this kind and seed; another seed is another scene.
BenchmarkScene MakeScene(const SyntheticCell& cell, SceneKind kind, uint64_t seed);

// `count` scenes of seeds 1, 2, ...
std::vector<BenchmarkScene> MakeScenes(const SyntheticCell& cell, SceneKind kind, int count);

}  // namespace silhouette::benchmarks
