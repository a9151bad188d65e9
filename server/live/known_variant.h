// SPDX-License-Identifier: Apache-2.0
// Which variant shows the robot, as far as it is known.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace silhouette {

// A value. Only the last report counts: with every change the earlier scenes are withdrawn
// (SceneStore::Withdraw), so that no earlier image is ever taken for one of a known variant.
// Times are those of a clock that never steps back (Moment::running).
class KnownVariant {
 public:
  // Nothing was reported. Known all the same while the database has one variant only.
  KnownVariant() = default;
  // The robot has the variant in all images, until another report.
  explicit KnownVariant(std::string variant);

  // The robot has the variant in images taken from `now` on. Returns whether that is new.
  bool Tell(const std::string& variant, absl::Duration now);
  // The variant is being changed: the robot looks like none. Returns whether that is new.
  bool TellChanging();
  // The database is another, which has `variants`. A variant that it lacks is unknown from now on,
  // until it is reported again.
  void NoteVariants(const std::vector<std::string>& variants);

  bool changing() const { return state_ == State::kChanging; }

  // The variant that shows the robot in images of which the oldest was taken at `oldest`, by a
  // camera's clock that may be ahead by kClockTolerance. `variants`: those of the database, one at
  // least. FailedPrecondition: it is not known; one sentence that says why, and the mend.
  absl::StatusOr<std::string> Of(absl::Duration oldest,
                                 const std::vector<std::string>& variants) const;
  // The same for images that are yet to come.
  absl::StatusOr<std::string> OfLaterImages(const std::vector<std::string>& variants) const {
    return Of(absl::InfiniteDuration(), variants);
  }

 private:
  enum class State { kNotTold, kChanging, kTold, kLost };

  State state_ = State::kNotTold;
  std::string variant_;   // kTold, kLost
  absl::Duration since_;  // kTold
};

}  // namespace silhouette
