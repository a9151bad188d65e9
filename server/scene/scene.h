// SPDX-License-Identifier: Apache-2.0
// A scene: one simultaneous set of images of the cell, one per view, with the robot's joints at
// that instant, and what it is good for.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "calib/robot/drawing/drawn_checker.h"
#include "db/mask/mask.h"
#include "db/store/schema.h"
#include "server/collision/clearance.h"
#include "server/collision/collision_checker.h"
#include "server/collision/space_distances.h"
#include "server/collision/verdict.h"
#include "server/scene/allowed_regions.h"
#include "server/scene/clock.h"
#include "server/scene/joint_position.h"
#include "server/scene/made_once.h"
#include "server/scene/separation_basis.h"
#include "server/scene/sound_basis.h"

namespace silhouette {

// Why no verdict that rests on the scene is free.
struct SceneDefect {
  Reason reason = Reason::kInternal;
  std::string message;  // one sentence that names the thing and the mend
};

// Groups what fails by the reason.
class Failing {
 public:
  void Add(const std::string& name, const std::string& why);

  struct Group {
    std::string why;
    std::vector<std::string> names;

    bool several() const { return names.size() > 1; }
    // "view 'left'", "views 'left', 'right'", of the kind "view".
    std::string Named(const std::string& kind) const;
  };
  const std::vector<Group>& groups() const { return groups_; }

 private:
  std::vector<Group> groups_;
};

// What one view saw.
struct SceneView {
  std::string name;
  absl::Time captured;  // by a wall clock
  // The foreground; from a sensor that separates obstacles by itself: its obstacle pixels.
  Mask foreground;
  // As SceneMask::strong.
  std::optional<Mask> strong;
  // The sensor separates obstacles by itself.
  bool separates_robot = false;
  // Error pixels whose neighbours are all error pixels.
  uint32_t core_error_pixels = 0;
  // Pixels that prove nothing in this view, and its safety margin in pixels.
  std::optional<Mask> ignored;
  double margin = 0;
};

// A plain value; shared as SharedScene, and then never changed.
struct Scene {
  // Counts up from 1 in the life of a server; 0 until it is published.
  uint64_t id = 0;
  // Generation of the database that it was made with.
  uint64_t generation = 0;
  std::vector<JointPosition> joints;
  // Which variant shows the robot as it is in the scene, by its name; empty: it is not
  // known, which is a defect.
  std::string variant = schema::kDefaultVariant;
  // One per view of the database; nothing where the scene lacks the view.
  std::vector<std::optional<SceneView>> views;
  // As `views`; nothing also where the robot image at the scene's robot position is not known.
  ObstacleImages obstacle_images;
  // The same without safety margins: what the views really show, and allowed regions act on.
  ObstacleImages without_margins;
  // When the oldest image was taken; never after it arrived. The scene is as old as that.
  Moment oldest;
  // When the newest image was taken, by the running clock; never after it arrived. Scenes are
  // ordered by it.
  absl::Duration newest;
  // Time from the oldest to the newest image.
  absl::Duration skew;
  // When it arrived.
  Moment arrived;
  std::vector<SceneDefect> defects;
  // Made for the first who asks (checker.cc): the obstacle images resolved along epipolar lines,
  // and the distances from the pixels that show obstacles, in the obstacle images and in those.
  MadeOnce<CollisionImages> resolved;
  MadeOnce<DistanceImages> to_obstacles;
  MadeOnce<DistanceImages> to_resolved;
  // The same: the pixels that show obstacles, for a robot that is drawn.
  MadeOnce<DrawnChecker> drawn;
  ScenePossibleSpace possible_space;
  // The distances from what may hold somebody (SeparationBasis::DistancesIn).
  // Of a variant's basis and MaxOccludedViews().
  EachMadeOnce<std::pair<std::shared_ptr<const SeparationBasis>, int>, SpaceDistances> separation;
  // What allowed regions in force did to the obstacle images; empty in a scene as it was published.
  std::vector<RegionEffect> region_effects;

  // Age of the oldest image.
  absl::Duration AgeAt(const Moment& now) const { return now.running - oldest.running; }
  // Why every verdict is unknown, whatever the configuration; kNone if verdicts can be made. A
  // missing view does not block: it counts as showing an obstacle.
  Reason Blocked() const;
};

using SharedScene = std::shared_ptr<const Scene>;

}  // namespace silhouette
