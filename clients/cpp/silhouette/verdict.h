// SPDX-License-Identifier: Apache-2.0
// The verdict on a configuration, as a client reads it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace silhouette::client {

enum class State : uint8_t {
  kUnknown = 0,  // whatever is not free or occupied; treat it as occupied
  kFree,
  kOccupied,
};

// Why a verdict is unknown. Below 200 same values as silhouette.v1.Verdict.Reason; the others are
// this library's own, of maps that it answers from by itself.
enum class Reason : uint8_t {
  kUnspecified = 0,  // the verdict is free or occupied, or the server gave a reason not known here
  kNoScene = 1,
  kSceneStale = 2,
  kSceneSkewed = 3,
  kViewMissing = 4,
  kRobotPositionUnknown = 5,
  kFixedJointMoved = 6,
  kRobotImageOfSceneMissing = 7,
  kErrorArea = 8,
  kOutsideGrid = 9,
  kRobotImageMissing = 10,
  kExcluded = 11,
  kRobotImageCorrupt = 12,
  kGenerationMismatch = 13,
  kInternal = 14,
  kMarginUnknown = 15,
  kRegionEnded = 16,
  kCalibrationDoubtful = 17,
  kVariantUnknown = 18,
  kNotInMap = 200,
  kBetweenGridPoints = 201,
  kNoUpdate = 203,
  kConnectionLost = 204,
  kUpdateTooOld = 205,
  kUpdateExpired = 206,
  kUpdateMalformed = 207,
  kAgeUnknown = 208,
};

// "free", "occupied", "unknown".
std::string NameOf(State state);
// "scene stale" and the like.
std::string NameOf(Reason reason);
// What the reason says, in words that follow "unknown: ", with the mend.
std::string Describe(Reason reason);

// What one view says about one configuration: its pixels inside the robot image there.
struct ViewEvidence {
  std::string view;
  uint32_t obstacle_pixels = 0;
  uint32_t unknown_pixels = 0;
  uint32_t error_pixels = 0;
  bool missing = false;  // the scene lacks this view: it counts as showing an obstacle
  // Pixels between the robot image and the nearest pixel that shows an obstacle, infinite where
  // there is none; only with Verdict::clearance.
  std::optional<double> distance = std::nullopt;
};

// Nothing but an explicit FREE of the server is free: a verdict that nobody gave, and one whose
// state is not known here, are unknown.
struct Verdict {
  State state = State::kUnknown;
  Reason reason = Reason::kUnspecified;
  // In the order of the database's views; empty if it was not asked for.
  std::vector<ViewEvidence> views = {};
  // An obstacle may hide: in every view some pixel inside the robot image is unknown or error, and
  // none is obstacle. Set for free verdicts too.
  bool hidden_possible = false;
  // Names of the allowed regions without which the verdict might be another.
  std::vector<std::string> regions = {};
  // By how many pixels of the masks the robot images could grow, in all views at once, before it
  // were occupied; under the sound presets at least. 0 if it is occupied, infinite if no growth
  // makes it so. Nothing if it is unknown, or if it was not asked for.
  std::optional<double> clearance = std::nullopt;

  bool free() const { return state == State::kFree; }
};

}  // namespace silhouette::client
