// SPDX-License-Identifier: Apache-2.0
// The verdict on a configuration, and why.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace silhouette {

enum class State : uint8_t {
  kUnknown = 0,  // whatever is not decided; planners treat it as occupied
  kFree,
  kOccupied,
};

// Why a verdict is unknown. Same values as silhouette.v1.Verdict.Reason.
enum class Reason : uint8_t {
  kNone = 0,  // the verdict is free or occupied
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
};

// "scene stale" and the like, for logs and messages.
std::string NameOf(Reason reason);
std::string NameOf(State state);

// What one view says about one configuration: its pixels inside the test robot image.
struct ViewEvidence {
  uint32_t obstacle_pixels = 0;
  uint32_t unknown_pixels = 0;
  uint32_t error_pixels = 0;
  bool missing = false;  // the scene lacks this view: it counts as showing an obstacle
  // Pixels of the mask between the test robot image and the nearest pixel that shows an obstacle,
  // infinite where there is none; only where clearances are measured (clearance.h).
  std::optional<double> distance = std::nullopt;

  bool operator==(const ViewEvidence&) const = default;
};

class Verdict {
 public:
  // Unknown, by a fault of our own: what a verdict is until somebody decides it.
  Verdict() = default;

  static Verdict Free(bool hidden_possible);
  static Verdict Occupied(bool hidden_possible);
  // `reason` is not kNone, else std::invalid_argument.
  static Verdict Unknown(Reason reason, bool hidden_possible = false);

  State state() const { return state_; }
  // kNone if, and only if, the state is free or occupied.
  Reason reason() const { return reason_; }
  bool free() const { return state_ == State::kFree; }
  // An obstacle may hide: inside the test robot image every view has unknown or error pixels, or is
  // missing, and none has obstacle pixels.
  bool hidden_possible() const { return hidden_possible_; }

  bool operator==(const Verdict&) const = default;

 private:
  State state_ = State::kUnknown;
  Reason reason_ = Reason::kInternal;
  bool hidden_possible_ = false;
};

}  // namespace silhouette
