// SPDX-License-Identifier: Apache-2.0
#include "server/collision/verdict.h"

#include <iterator>
#include <stdexcept>

namespace silhouette {

std::string NameOf(Reason reason) {
  // By their numbers.
  constexpr const char* kNames[] = {"none",
                                    "no scene",
                                    "scene stale",
                                    "scene skewed",
                                    "view missing",
                                    "robot position unknown",
                                    "fixed joint moved",
                                    "robot image of scene missing",
                                    "error area",
                                    "outside grid",
                                    "robot image missing",
                                    "excluded",
                                    "robot image corrupt",
                                    "generation mismatch",
                                    "internal",
                                    "margin unknown",
                                    "region ended",
                                    "calibration doubtful",
                                    "variant unknown",
                                    "database damaged",
                                    "light changed",
                                    "view covered",
                                    "views swapped",
                                    "camera moved",
                                    "robot elsewhere",
                                    "motion not proven",
                                    "depends on wrist",
                                    "outside workspace",
                                    "robot image suspect"};
  static_assert(std::size(kNames) == static_cast<size_t>(Reason::kRobotImageSuspect) + 1);
  const auto number = static_cast<size_t>(reason);
  return number < std::size(kNames) ? kNames[number] : NameOf(Reason::kInternal);
}

std::string NameOf(State state) {
  return state == State::kFree ? "free" : state == State::kOccupied ? "occupied" : "unknown";
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
