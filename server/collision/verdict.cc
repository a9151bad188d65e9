// SPDX-License-Identifier: Apache-2.0
#include "server/collision/verdict.h"

#include <stdexcept>

namespace silhouette {

std::string NameOf(Reason reason) {
  switch (reason) {
    case Reason::kNone:
      return "none";
    case Reason::kNoScene:
      return "no scene";
    case Reason::kSceneStale:
      return "scene stale";
    case Reason::kSceneSkewed:
      return "scene skewed";
    case Reason::kViewMissing:
      return "view missing";
    case Reason::kRobotPositionUnknown:
      return "robot position unknown";
    case Reason::kFixedJointMoved:
      return "fixed joint moved";
    case Reason::kRobotImageOfSceneMissing:
      return "robot image of scene missing";
    case Reason::kErrorArea:
      return "error area";
    case Reason::kOutsideGrid:
      return "outside grid";
    case Reason::kRobotImageMissing:
      return "robot image missing";
    case Reason::kExcluded:
      return "excluded";
    case Reason::kRobotImageCorrupt:
      return "robot image corrupt";
    case Reason::kGenerationMismatch:
      return "generation mismatch";
    case Reason::kInternal:
      return "internal";
    case Reason::kMarginUnknown:
      return "margin unknown";
    case Reason::kRegionEnded:
      return "region ended";
    case Reason::kCalibrationDoubtful:
      return "calibration doubtful";
    case Reason::kVariantUnknown:
      return "variant unknown";
  }
  return "internal";
}

std::string NameOf(State state) {
  switch (state) {
    case State::kUnknown:
      return "unknown";
    case State::kFree:
      return "free";
    case State::kOccupied:
      return "occupied";
  }
  return "unknown";
}

Verdict Verdict::Free(bool hidden_possible) {
  Verdict verdict;
  verdict.state_ = State::kFree;
  verdict.reason_ = Reason::kNone;
  verdict.hidden_possible_ = hidden_possible;
  return verdict;
}

Verdict Verdict::Occupied(bool hidden_possible) {
  Verdict verdict;
  verdict.state_ = State::kOccupied;
  verdict.reason_ = Reason::kNone;
  verdict.hidden_possible_ = hidden_possible;
  return verdict;
}

Verdict Verdict::Unknown(Reason reason, bool hidden_possible) {
  if (reason == Reason::kNone) throw std::invalid_argument("an unknown verdict has a reason");
  Verdict verdict;
  verdict.reason_ = reason;
  verdict.hidden_possible_ = hidden_possible;
  return verdict;
}

}  // namespace silhouette
