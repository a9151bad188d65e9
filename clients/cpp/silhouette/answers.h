// SPDX-License-Identifier: Apache-2.0
// The server's answers, each with the scene and the database that it used.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/mask.h"
#include "silhouette/running_clock.h"
#include "silhouette/separation.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// Why no verdict from a scene is free: one sentence that names the thing and the mend.
struct Defect {
  Reason reason = Reason::kUnspecified;
  std::string message;
};

// The scene and the generation of the database behind an answer.
struct Basis {
  uint64_t database_generation = 0;
  // 0: there was no scene, and every verdict is unknown.
  uint64_t scene_id = 0;
  // Capture time of the scene's oldest image, by the clock of its source.
  absl::Time scene_time = absl::InfinitePast();
  // Age of that image when the answer was made.
  absl::Duration scene_age = absl::InfiniteDuration();
  // Names of the allowed regions that may have changed verdicts from the scene.
  std::vector<std::string> regions = {};
  // The variant that configurations were checked with, and the scene's variant, empty if unknown.
  // Both empty: the server knows no variants.
  std::string variant = {};
  std::string scene_variant = {};
  // Why no verdict from the scene is free, or why there is no scene; if the server acquires images
  // itself, what its devices do.
  std::vector<Defect> defects = {};
  // Robot images are drawn from a model that was not verified with captured ones.
  bool unverified_model = false;
  // The earliest time at which the server can have made the answer: when the question was sent, or
  // later, if a round trip was needed to know that.
  RunningClock::time_point asked = {};
  // No verdict may be used from then on, if nothing new comes: then the scene is too old, or an
  // allowed region or the check of the calibration ends.
  RunningClock::time_point valid_until = {};

  // Age of the oldest image now; never too small, because the time of the question counts, too.
  // Infinite without a scene.
  absl::Duration Age() const;
};

struct ConfigurationChecks {
  Basis basis;
  // One for each requested configuration, in the order of the request.
  std::vector<Verdict> verdicts;

  // False for an empty request.
  bool AllFree() const;
};

// A place on a path: waypoint number, counted from 0, and fraction of the way to the next one.
struct PathPlace {
  int segment = 0;
  double fraction = 0;
  Configuration configuration;
};

// Verdicts for grid configurations that were requested by number.
struct NumberChecks {
  Basis basis;
  // Why those that are unknown are. The server states it only where no verdict can rest on the
  // scene, else kUnspecified; of a map kNotInMap where it has no state.
  Reason unknown_reason = Reason::kUnspecified;
  // Number of requested configurations.
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

// What a free path is known to be free by.
enum class PathProof {
  kNone = 0,    // the path is not free, or the server does not say
  kGrid,        // every grid cell on it is free
  kContinuous,  // the robot is free at all places of it
  kSampled,     // the same, but for parts that are free at places PathCheck::sampled_step apart
};

struct PathCheck {
  Basis basis;
  // Free if the whole path is free. Otherwise the verdict at the first place that is not. Its
  // clearance, if requested, is the smallest along the path.
  Verdict verdict;
  // That place: waypoint number, counted from 0, and fraction of the way to the next one. Without a
  // configuration: all is unknown.
  int segment = 0;
  double fraction = 0;
  Configuration configuration;
  // Number of places checked, up to there.
  int64_t checked = 0;
  // The first place with the smallest clearance; only if requested and the path is free.
  std::optional<PathPlace> narrowest = std::nullopt;
  PathProof proof = PathProof::kNone;
  // With kSampled: how far any point of the robot moves at most between two places, metres.
  double sampled_step = 0;
  // If requested. It says nothing of the verdict, nor that of it.
  std::optional<Separation> separation = std::nullopt;
};

// PNG images, one pixel per mask pixel.
struct ViewPictures {
  std::string view;
  std::string scene_png;
  std::string obstacle_png;
  std::string intersection_png;
  std::string collision_png;
  // The tested robot; nothing: there is no image of it.
  std::optional<Mask> robot = std::nullopt;
};

struct Explanation {
  Basis basis;
  Verdict verdict;
  // In the order of the database's views; empty without a scene.
  std::vector<ViewPictures> views;
};

}  // namespace silhouette::client
