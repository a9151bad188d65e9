// SPDX-License-Identifier: Apache-2.0
// One request's view of the world: a database, a scene and a moment, and the verdicts that follow.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "db/mask/configuration_grid.h"
#include "server/collision/clearance.h"
#include "server/collision/collision_checker.h"
#include "server/collision/policy.h"
#include "server/collision/verdict.h"
#include "server/scene/clock.h"
#include "server/scene/configuration_space.h"
#include "server/scene/scene_settings.h"
#include "server/scene/scene_store.h"

namespace silhouette {

// Keeps database and scene alive. Its verdicts are unknown, with the reason, wherever the scene as
// a whole cannot be rested on; then CollisionChecker's. Used by any number of threads.
class Checker {
 public:
  // Whether the scene is too old counts at the moment `now`. Throws std::invalid_argument if the
  // policy cannot be, or the database cannot serve it (ServedDatabase::CanServe).
  // `map`: of the same scene under the same policy, which decides what it has already; null: none.
  Checker(Served served, const Policy& policy, const SceneSettings& settings, const Moment& now,
          std::shared_ptr<const ConfigurationSpace> map = nullptr);

  const Served& served() const { return served_; }
  const Policy& policy() const { return policy_; }
  // Why every verdict is unknown, whatever the configuration; kNone if verdicts can be made.
  Reason blocked() const { return blocked_; }

  // As CollisionChecker's functions of the same names.
  Verdict Check(std::span<const double> q, std::span<ViewEvidence> evidence = {}) const;
  // `regions`: if not null, gets the names of RegionsAt of all places that were tested.
  // `clearance`: if not null, gets the smallest clearance of all places that were tested.
  PathVerdict CheckPath(std::span<const Configuration> waypoints,
                        std::span<ViewEvidence> evidence = {},
                        std::set<std::string>* regions = nullptr,
                        std::optional<PathClearance>* clearance = nullptr,
                        const PathSettings& settings = {}) const;

  // Measures the clearances of configurations; nothing where all verdicts are unknown. Refers to
  // this, which must stay where it is.
  std::optional<ClearanceMeter> Clearances() const;

  // The least distance along a path, in space, to what may hold somebody; as
  // SeparationMeter::Along. Nothing where all verdicts are unknown, or `stop` says so, or a
  // waypoint is outside the grid or the joints' limits. The database must serve distances
  // (ServedDatabase::separation).
  std::optional<PathDistance> Distance(std::span<const Configuration> waypoints,
                                       std::optional<double> horizon,
                                       const Stop& stop = nullptr) const;

  // The test robot images of `q`, one per view; nothing if there is no scene, or a robot image that
  // they take is not there.
  std::optional<std::vector<Mask>> TestRobotImages(std::span<const double> q) const;

  // The collision images of `q`: which pixels show an obstacle under the policy; under the sound
  // presets, what may hold one, wherever in space it meets the robot image. Nothing where the
  // scene lacks the view, and everywhere if TestRobotImages gives nothing.
  CollisionImages CollisionImagesAt(std::span<const double> q) const;

  // The names of the allowed regions without which the verdict on `q` might be another: those that
  // took obstacle pixels away inside its test robot image; all that took any away, if the policy
  // looks beyond that image. `growth`: of a drawn robot.
  std::vector<std::string> RegionsAt(std::span<const double> q, Growth growth = {}) const;

 private:
  // CollisionImagesAt for the sound presets.
  CollisionImages PossibleImagesAt(std::span<const double> q) const;

  Served served_;
  Policy policy_;
  Reason blocked_ = Reason::kInternal;
  std::optional<CollisionChecker> test_;  // nothing where there is no scene
};

// Throws std::invalid_argument if the policy cannot be, or the database cannot serve it
// (ServedDatabase::CanServe).
void RequireServable(const Served& served, const Policy& policy);

// What the policy's tests of the scene rest on, kept by the scene and the database. The scene must
// be there and made with the database; the policy servable.
TestSupport SupportFor(const Served& served, const Policy& policy);

// The distances that clearances are measured with, kept by the scene. `support`: SupportFor these.
const DistanceImages& DistancesFor(const Served& served, const TestSupport& support);

// Whether verdicts under the policy rest on the calibration: all do on robot images that are drawn.
bool RestsOnCalibration(const ServedDatabase& database, const Policy& policy);

// Why the calibration, if it is checked, is not known to hold at the moment `now`: it does not, the
// check is too old or of another calibration, it does not have each view of the database once, or
// its limit exceeds the database's margin. Nothing: it holds, or is not checked.
std::optional<std::string> CalibrationDoubt(const Served& served, const Moment& now);

// kCalibrationDoubtful if there is such a doubt; kNone else.
Reason CalibrationReason(const Served& served, const Moment& now);

// Why no verdict can rest on `served` at the moment `now`, whatever the policy; kNone if some can
// be made.
Reason BlockedReason(const Served& served, const SceneSettings& settings, const Moment& now);

// The same for verdicts under `policy`: besides, CalibrationReason where they rest on the
// calibration.
Reason BlockedReason(const Served& served, const Policy& policy, const SceneSettings& settings,
                     const Moment& now);

// How long from the moment `now` on that stays so if nothing new comes: then the scene is too old,
// an allowed region ends, or the check of the calibration is too old. Zero if no verdict can rest
// on it.
absl::Duration ValidFor(const Served& served, const Policy& policy, const SceneSettings& settings,
                        const Moment& now);

// The names of the allowed regions without which verdicts under the policy might be others: those
// that took any pixel of the scene away; all in force, if the policy looks at space instead.
std::vector<std::string> RegionsIn(const Served& served, const Policy& policy);

}  // namespace silhouette
