// SPDX-License-Identifier: Apache-2.0
// The scenes that are served, and the database they were made with. Used by any number of threads.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/scene/scene.h"
#include "server/scene/served_database.h"

namespace silhouette {

// Whether the calibration still holds, by the newest check of the cell (silhouette-calibrate
// check).
struct CalibrationTrust {
  bool holds = false;
  // The calibration that was checked (FingerprintOf in calib/files/calibration_message.h). It tells
  // nothing of another.
  std::string fingerprint;
  // The moment of the running clock (clock.h) from which on the check is older than `max_age`.
  absl::Duration until = absl::InfiniteDuration();
  absl::Duration max_age = absl::InfiniteDuration();
  // Each view that was checked, and how far it may have moved, in mask pixels.
  std::vector<std::string> views = {};
  double limit = 0;
  // What was found, or why it is not known.
  std::string message;
};

// What a request rests on, taken in one step: the newest scene and its database stay as they are as
// long as the request holds them.
struct Served {
  // With the robot images of one of its variants: the default one, or what WithVariant chose.
  std::shared_ptr<const ServedDatabase> database;
  // Null: there is none. Where allowed regions are in force, the scene as they leave it.
  SharedScene scene;
  // Why there is none: kNoScene, or kGenerationMismatch after a change of the database; else kNone.
  Reason without_scene = Reason::kNoScene;
  // The allowed regions in force; never null.
  std::shared_ptr<const RegionSet> regions = std::make_shared<const RegionSet>();
  // Null: the calibration is not checked, and is taken to hold.
  std::shared_ptr<const CalibrationTrust> trust = nullptr;
  // The database with all of its variants; null: it is `database`.
  std::shared_ptr<const ServedDatabase> whole = nullptr;
};

// The same with the robot images of the variant `name`; empty: of that which the scene names, as
// far as the database has it (a scene that names another has a defect). InvalidArgument: the
// database has no variant of this name.
absl::StatusOr<Served> WithVariant(Served served, const std::string& name);

class SceneStore {
 public:
  static constexpr uint64_t kKept = 16;

  // `kept`: how many scenes, the newest included, can be asked for by id.
  explicit SceneStore(std::shared_ptr<const ServedDatabase> database, size_t kept = kKept);

  // Gives the scene its id and makes it the newest. `database`: what it was made with.
  // FailedPrecondition if its newest image is older than that of the newest scene, by more than
  // kClockJitter, or is that image and its oldest is older than that scene's. Aborted if the
  // database has been replaced since the scene was made.
  absl::StatusOr<SharedScene> Publish(Scene scene,
                                      const std::shared_ptr<const ServedDatabase>& database);

  // From now on nothing rests on a scene that arrived at the moment `now` or before, published
  // already or not, for the robot looks other than in it: it has the defect kVariantUnknown with
  // the message `why`, no variant and no obstacle images. The newest scene is published again as
  // such.
  void Withdraw(const std::string& why, const Moment& now);
  // The id of the scene that was the newest after that; 0: there was none, or none is withdrawn.
  uint64_t last_withdrawn() const;
  // Whether the scene is withdrawn by now.
  bool Withdrawn(const Scene& scene) const;

  // Serves another generation. All scenes are dropped: they were made with the old robot images. So
  // are all allowed regions.
  void ReplaceDatabase(std::shared_ptr<const ServedDatabase> database);

  // What is known from now on of whether the calibration holds; null: it is not checked.
  void SetTrust(std::shared_ptr<const CalibrationTrust> trust);
  std::shared_ptr<const CalibrationTrust> trust() const;

  // What is served now.
  std::shared_ptr<const ServedDatabase> database() const;

  // Allowed regions that end at the moment `now`, or ended before, are no longer in force.
  Served Newest(const Moment& now);

  // As AllowedRegions' functions of these names; TakeEnded also has those that ended with their
  // database. Aborted if `database`, to whose views `pixels`
  // belong, has been replaced.
  absl::StatusOr<AllowedRegion> Allow(const std::string& name,
                                      std::vector<std::optional<Mask>> pixels,
                                      absl::Duration duration, const Moment& now,
                                      const std::shared_ptr<const ServedDatabase>& database);
  bool Revoke(const std::string& name, const Moment& now);
  std::vector<AllowedRegion> TakeEnded(const Moment& now);

  // Waits until what is served has been changed by one of the functions above since the call that
  // returned `seen` (0: whatever was changed), at most so long, or until it is to stop. Regions
  // that end by themselves are no such change.
  uint64_t WaitForChange(uint64_t seen, std::chrono::milliseconds longest,
                         const std::stop_token& stop);

  // Whether one of the regions is in force no more, or has other pixels now. (Whether its time is
  // over is another question: BlockedReason.)
  bool Revoked(const RegionSet& regions) const;

  // The longest that a scene was the newest, of those that are kept: between its oldest image and
  // that of the next, or their newest if that is longer. Infinite while there are fewer than two.
  absl::Duration LongestGap() const;

  // A scene as it was published, by its id, 0 for the newest; null if there is none, or no longer.
  SharedScene Find(uint64_t id) const;

 private:
  // Called with the mutex held.
  void NoteChange();
  SharedScene Add(Scene scene);
  bool IsWithdrawn(const Scene& scene) const { return scene.arrived.running <= withdrawn_until_; }
  SharedScene WithRegions(const SharedScene& scene, const RegionSet& regions);

  const size_t kept_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  uint64_t changes_ = 0;
  std::shared_ptr<const ServedDatabase> database_;
  std::deque<SharedScene> scenes_;  // oldest first
  AllowedRegions regions_;
  std::shared_ptr<const CalibrationTrust> trust_;
  // The newest scene as the regions of a revision leave it.
  SharedScene with_regions_;
  uint64_t with_regions_of_scene_ = 0;
  uint64_t with_regions_of_revision_ = 0;
  absl::Duration withdrawn_until_ = -absl::InfiniteDuration();
  std::string why_withdrawn_;
  uint64_t last_withdrawn_ = 0;
  bool database_replaced_ = false;
  uint64_t last_id_ = 0;
};

}  // namespace silhouette
