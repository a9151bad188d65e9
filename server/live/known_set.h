// Which set of robot images shows the robot, as far as somebody told.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace silhouette {

// A value. Only what was told last counts: with every change the scenes of before are withdrawn
// (SceneStore::Withdraw), so that no image of before is ever taken for one of a known set. Times
// are those of a clock that never steps back (Moment::running).
class KnownSet {
 public:
  // Nobody has told. Known all the same while the database has one set only.
  KnownSet() = default;
  // The robot has the set in all images, until something else is told.
  explicit KnownSet(std::string set);

  // Told at `now`: the robot has the set, in images taken from now on. Whether that is new.
  bool Tell(const std::string& set, absl::Duration now);
  // Told: it is being changed, and looks like no set. Whether that is new.
  bool TellChanging();
  // The database is another, which has `sets`. A set that it lacks is unknown from now on, until it
  // is told anew.
  void NoteSets(const std::vector<std::string>& sets);

  bool changing() const { return state_ == State::kChanging; }

  // The set that shows the robot in images of which the oldest was taken at `oldest`, by a camera's
  // clock that may be ahead by kClockTolerance. `sets`: those of the database, one at least.
  // FailedPrecondition: it is not known; one sentence that says why, and the mend.
  absl::StatusOr<std::string> Of(absl::Duration oldest, const std::vector<std::string>& sets) const;
  // The same for images that are yet to come.
  absl::StatusOr<std::string> OfLaterImages(const std::vector<std::string>& sets) const {
    return Of(absl::InfiniteDuration(), sets);
  }

 private:
  enum class State { kNotTold, kChanging, kTold, kLost };

  State state_ = State::kNotTold;
  std::string set_;       // kTold, kLost
  absl::Duration since_;  // kTold
};

}  // namespace silhouette
