#include "server/live/known_set.h"

#include <algorithm>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/scene/make_scene.h"

namespace silhouette {
namespace {

bool Has(const std::vector<std::string>& sets, const std::string& set) {
  return std::ranges::find(sets, set) != sets.end();
}

}  // namespace

KnownSet::KnownSet(std::string set)
    : state_(State::kTold), set_(std::move(set)), since_(-absl::InfiniteDuration()) {}

bool KnownSet::Tell(const std::string& set, absl::Duration now) {
  if (state_ == State::kTold && set_ == set) return false;
  state_ = State::kTold;
  set_ = set;
  since_ = now;
  return true;
}

bool KnownSet::TellChanging() {
  const bool is_new = state_ != State::kChanging;
  state_ = State::kChanging;
  return is_new;
}

void KnownSet::NoteSets(const std::vector<std::string>& sets) {
  if (state_ == State::kTold && !Has(sets, set_)) state_ = State::kLost;
}

absl::StatusOr<std::string> KnownSet::Of(absl::Duration oldest,
                                         const std::vector<std::string>& sets) const {
  switch (state_) {
    case State::kNotTold:
      if (sets.size() == 1) return sets.front();
      return absl::FailedPreconditionError(absl::StrCat(
          "nobody has told which set of robot images shows the robot: tell it with 'silhouette "
          "scene set NAME', or state 'server: {live: {set: NAME}}' in the cell file; there are ",
          absl::StrJoin(sets, ", ")));
    case State::kChanging:
      return absl::FailedPreconditionError(
          "the robot's set of robot images is being changed: tell with 'silhouette scene set NAME' "
          "which it has when that is done");
    case State::kTold:
      break;
    case State::kLost:
      return absl::FailedPreconditionError(absl::StrCat(
          "the robot had the set '", set_, "' when the database was replaced by one without it: ",
          "tell with 'silhouette scene set NAME' which it has; there are ",
          absl::StrJoin(sets, ", ")));
  }
  if (!Has(sets, set_)) {
    return absl::FailedPreconditionError(absl::StrCat("the robot has the set '", set_,
                                                      "', and the database has only ",
                                                      absl::StrJoin(sets, ", "), ": capture it"));
  }
  if (oldest - kClockTolerance < since_) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the robot has the set '", set_, "' in images taken from ",
        absl::FormatDuration(kClockTolerance), " after that was told; wait for those"));
  }
  return set_;
}

}  // namespace silhouette
