// SPDX-License-Identifier: Apache-2.0
// The server's own acquisition: images of all cameras, joined to the robot's joints, become scenes.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "capture/segmentation/settings.h"
#include "capture/segmentation/slow_light.h"
#include "server/live/helpers.h"
#include "server/live/image_judge.h"
#include "server/live/joint_history.h"
#include "server/live/live_record.h"
#include "server/live/live_settings.h"
#include "server/live/proof_of_life.h"
#include "server/scene/make_scene.h"
#include "server/scene/scene.h"
#include "server/scene/served_database.h"

namespace silhouette {

using OpenCamerasFunction = std::function<absl::StatusOr<std::unique_ptr<CameraRig>>()>;

// Opens the devices; called again when they have failed for long.
struct LiveDevices {
  OpenCamerasFunction open_cameras;
  OpenRobotFunction open_robot;
};

// Where scenes go: the functions of SceneStore that the loop calls.
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

// One thread takes images, another asks the robot. Nothing that a device does ends them: what is
// wrong is recorded, and scenes lack what did not come and are never free, or none is made and the
// newest becomes too old.
class LiveLoop {
 public:
  // Opens the devices and starts. Devices that cannot be reached (Unavailable, DeadlineExceeded)
  // are tried again later. Any other error of theirs is returned; InvalidArgument, if devices and
  // cell do not fit, or the database lacks the variant of config.live; FailedPrecondition, if it
  // has no reference images. `record`: also has the variant that shows the robot;
  // config.live.variant does not.
  static absl::StatusOr<std::unique_ptr<LiveLoop>> Start(const LiveConfig& config,
                                                         LiveDevices devices, LiveScenes scenes,
                                                         std::shared_ptr<LiveRecord> record);

  // Stops: waits for what the devices are doing, and writes to the log how it went.
  ~LiveLoop();

 private:
  LiveLoop(const LiveConfig& config, LiveScenes scenes, std::shared_ptr<LiveRecord> record,
           const storage::v1::CellDescription& cell);

  void Run(const std::stop_token& stop);
  // One set of images; an error if none of its images can be had.
  absl::Status TakeSet();
  absl::Status OpenCameras();
  struct LiveImage {
    CameraImage image;
    Moment taken;  // as ImageJudge::Judge
  };
  // The images of the views that can be used, by view of the cell; nothing for the others, which
  // `input` says the reasons of.
  std::vector<std::optional<LiveImage>> UsableImages(
      std::vector<absl::StatusOr<CameraImage>> grabbed, const Moment& asked, const Moment& arrived,
      const ServedDatabase& database, SceneInput& input);
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
  const std::shared_ptr<LiveRecord> record_;
  const storage::v1::CellDescription cell_;
  OpenCamerasFunction open_cameras_;
  std::unique_ptr<CameraRig> cameras_;  // null: to be opened
  std::vector<size_t> places_;          // in the rig, by view of the cell
  ImageJudge judge_;
  ProofOfLife life_;
  // What the light has slowly become, by view, since the references of this database were made;
  // begun again with another database.
  std::shared_ptr<const ServedDatabase> light_of_;
  std::vector<SlowLight> lights_;
  std::vector<absl::Duration> since_learnt_;
  absl::Duration lights_learnt_;  // running clock of the newest image set
  Helpers helpers_;
  std::optional<JointPoller> joints_;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace silhouette
