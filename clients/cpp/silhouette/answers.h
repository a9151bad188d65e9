// SPDX-License-Identifier: Apache-2.0
// What the server answers, and on which state of the world an answer rests.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// The scene and the generation of the database behind an answer.
struct Basis {
  uint64_t database_generation = 0;
  // 0: there was no scene, and every verdict is unknown.
  uint64_t scene_id = 0;
  // When the oldest image of the scene was taken, by the clock of whoever took it.
  absl::Time scene_time = absl::InfinitePast();
  // Age of that image when the answer was made.
  absl::Duration scene_age = absl::InfiniteDuration();
  // Names of the allowed regions without which verdicts from the scene might be others.
  std::vector<std::string> regions = {};
  // The variant that configurations were tested with, and that of the scene, empty
  // while it is not known; both empty: the server knows no variants.
  std::string variant = {};
  std::string scene_variant = {};
  // When the question was sent; of what a stream brings unasked, the earliest time at which it can
  // have been made.
  std::chrono::steady_clock::time_point asked = {};

  // Age of the oldest image now: never less than it really is, for the way of the question counts
  // too. Infinite without a scene.
  absl::Duration Age() const;
};

struct ConfigurationChecks {
  Basis basis;
  // One for each configuration asked for, in that order.
  std::vector<Verdict> verdicts;

  // False if nothing was asked.
  bool AllFree() const;
};

// A place on a path: waypoint number, counted from 0, and fraction of the way to the next one.
struct PathPlace {
  int segment = 0;
  double fraction = 0;
  Configuration configuration;
};

// The verdicts on configurations of the grid that were asked for by their numbers.
struct NumberChecks {
  Basis basis;
  // Why all are unknown, if the scene as a whole cannot be rested on.
  Reason unknown_reason = Reason::kUnspecified;
  // How many were asked for.
  size_t size = 0;
  // Bit i % 64 of word i / 64 for the i-th of them; never both. Neither: unknown.
  std::vector<uint64_t> free;
  std::vector<uint64_t> occupied;

  // Unknown also for i beyond the last one.
  State StateOf(size_t i) const {
    if (i >= size) return State::kUnknown;
    if ((free[i / 64] >> (i % 64) & 1) != 0) return State::kFree;
    return (occupied[i / 64] >> (i % 64) & 1) != 0 ? State::kOccupied : State::kUnknown;
  }
};

struct PathCheck {
  Basis basis;
  // Free if the whole path is. Else the verdict at the first place that is not. Its clearance, if
  // it was asked for, is the smallest along the path.
  Verdict verdict;
  // That place: waypoint number, counted from 0, and fraction of the way to the next one.
  int segment = 0;
  double fraction = 0;
  Configuration configuration;
  // How many places were tested, up to there.
  int64_t checked = 0;
  // Where the clearance is smallest first; if it was asked for and the path is free.
  std::optional<PathPlace> narrowest = std::nullopt;
};

// PNG images, one pixel per mask pixel.
struct ViewPictures {
  std::string view;
  std::string scene_png;
  std::string obstacle_png;
  std::string intersection_png;
  std::string collision_png;
};

struct Explanation {
  Basis basis;
  Verdict verdict;
  // In the order of the database's views; empty where there is no scene.
  std::vector<ViewPictures> views;
};

}  // namespace silhouette::client
