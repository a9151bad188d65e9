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

// Why a verdict is unknown. Values below 200 are those of silhouette.v1.Verdict.Reason; the others
// are found by this library.
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
  kDatabaseDamaged = 19,
  kLightChanged = 20,
  kViewCovered = 21,
  kViewsSwapped = 22,
  kCameraMoved = 23,
  kRobotElsewhere = 24,
  kMotionNotProven = 25,
  kDependsOnWrist = 26,
  kOutsideWorkspace = 27,
  kRobotImageSuspect = 28,
  kNotInMap = 200,
  kBetweenGridPoints = 201,
  kNoUpdate = 203,
  kConnectionLost = 204,
  kUpdateTooOld = 205,
  kUpdateExpired = 206,
  kUpdateMalformed = 207,
  kAgeUnknown = 208,
  kNotCheckedHere = 209,
  kRefused = 210,
  kAnswerLate = 211,
};

// "free", "occupied", "unknown".
std::string NameOf(State state);
// "scene stale" and the like.
std::string NameOf(Reason reason);
// What the reason means, as a sentence that follows "unknown: ". Basis.defects names the thing and
// the mend.
std::string Describe(Reason reason);

// Evidence of one view about one configuration: the pixels inside the robot image.
struct ViewEvidence {
  std::string view;
  uint32_t obstacle_pixels = 0;
  uint32_t unknown_pixels = 0;
  uint32_t error_pixels = 0;
  bool missing = false;  // the scene lacks this view: it counts as showing an obstacle
  // Distance in pixels from the robot image to the nearest obstacle pixel, infinite without one;
  // only with Verdict::clearance.
  std::optional<double> distance = std::nullopt;
};

// Only an explicit FREE of the server is free. A missing verdict, and an unknown enum value, are
// unknown.
struct Verdict {
  State state = State::kUnknown;
  Reason reason = Reason::kUnspecified;
  // In the order of the database's views; empty if not requested.
  std::vector<ViewEvidence> views = {};
  // An obstacle may be occluded: in every view some pixel inside the robot image is unknown or
  // error, and none is obstacle. Set for free verdicts, too.
  bool hidden_possible = false;
  // Names of the allowed regions that may have changed the verdict.
  std::vector<std::string> regions = {};
  // By how many mask pixels the robot images could grow, in all views at once, before the
  // configuration were occupied; under the sound presets a lower bound, which leaves out space that
  // the robot covers in all views whatever it does. 0 if occupied, infinite if no growth makes it
  // occupied. Nothing if unknown or not requested.
  std::optional<double> clearance = std::nullopt;

  bool free() const { return state == State::kFree; }
};

}  // namespace silhouette::client
