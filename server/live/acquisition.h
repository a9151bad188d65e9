// SPDX-License-Identifier: Apache-2.0
// What the server makes of the images that its cameras gave: each is judged, its foreground found,
// the robot's joints joined to them, and a scene made.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "capture/segmentation/settings.h"
#include "capture/segmentation/slow_light.h"
#include "server/live/helpers.h"
#include "server/live/image_judge.h"
#include "server/live/live_record.h"
#include "server/live/live_settings.h"
#include "server/live/proof_of_life.h"
#include "server/scene/make_scene.h"
#include "server/scene/scene.h"
#include "server/scene/served_database.h"

namespace silhouette {

// Where scenes go: the functions of SceneStore that are called.
struct LiveScenes {
  std::function<std::shared_ptr<const ServedDatabase>()> database;
  std::function<absl::StatusOr<SharedScene>(Scene, const std::shared_ptr<const ServedDatabase>&)>
      publish;
};

struct LiveConfig {
  LiveSettings live;
  SceneSettings scene;
  SegmentationSettings segmentation;
  Clock clock = SystemClock;
  // The views whose sources have no noise.
  std::set<std::string> without_noise = {};
};

// Where the robot was from `first` to `last` (running clock), or why that is not known.
using JointsBetween = std::function<absl::StatusOr<std::vector<JointPosition>>(
    absl::Duration first, absl::Duration last)>;

// A set of images as the cameras gave it: asked for at `asked`, complete at `arrived`.
struct GrabbedImages {
  std::vector<absl::StatusOr<CameraImage>> images;  // by view of the cell
  Moment asked;
  Moment arrived;
};

// Remembers earlier images. It knows no other time than that of the sets: the same sets give the
// same scenes. Not thread-safe.
class Acquisition {
 public:
  // `record`: also has the variant that shows the robot; config.live.variant does not.
  Acquisition(const LiveConfig& config, LiveScenes scenes, JointsBetween joints,
              std::shared_ptr<LiveRecord> record, const storage::v1::CellDescription& cell);

  // Publishes the scene of the set, if there is one. What is wrong is recorded; an error if none of
  // the images can be used.
  absl::Status Take(GrabbedImages set);

 private:
  struct LiveImage {
    CameraImage image;
    Moment taken;  // as ImageJudge::Judge
  };
  // The images of the views that can be used, by view of the cell; nothing for the others, which
  // `input` says the reasons of.
  std::vector<std::optional<LiveImage>> UsableImages(GrabbedImages set,
                                                     const ServedDatabase& database,
                                                     SceneInput& input);
  // `database` has reference images.
  absl::StatusOr<SharedScene> Publish(const std::shared_ptr<const ServedDatabase>& database,
                                      const std::vector<std::optional<LiveImage>>& images,
                                      const Moment& arrived, SceneInput input);
  // Records that a view's image cannot be used.
  void NoteUnusable(size_t view, const absl::Status& why, SceneInput& input);
  // The views of which the robot's motion does not show that they are frozen; `input` has the
  // robot's place.
  std::vector<bool> MovedWithTheRobot(const ServedDatabase& database,
                                      const std::vector<std::optional<LiveImage>>& images,
                                      const std::vector<const Mask*>& masks, SceneInput& input);

  const LiveConfig config_;
  const LiveScenes scenes_;
  const JointsBetween joints_;
  const std::shared_ptr<LiveRecord> record_;
  const storage::v1::CellDescription cell_;
  ImageJudge judge_;
  ProofOfLife life_;
  // What the light has slowly become, by view, since the references of this database were made;
  // begun again with another reference.
  std::shared_ptr<const ServedDatabase> light_of_;
  std::vector<SlowLight> lights_;
  std::vector<absl::Duration> since_learnt_;
  absl::Duration lights_learnt_;  // running clock of the newest image set
  // Of a view's images; begun again with another database.
  struct Before {
    absl::Duration taken;      // the newest one's time, running clock
    std::vector<Mask> strong;  // SceneMask::strong of the newest ones, each just before the next
  };
  std::vector<Before> before_;
  Helpers helpers_;
};

}  // namespace silhouette
