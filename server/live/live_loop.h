// SPDX-License-Identifier: Apache-2.0
// The server's own acquisition: images of all cameras, joined to the robot's joints, become scenes.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "server/live/acquisition.h"
#include "server/live/joint_history.h"
#include "server/live/live_record.h"

namespace silhouette {

using OpenCamerasFunction = std::function<absl::StatusOr<std::unique_ptr<CameraRig>>()>;

// Opens the devices; called again when they have failed for long.
struct LiveDevices {
  OpenCamerasFunction open_cameras;
  OpenRobotFunction open_robot;
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

  const LiveConfig config_;
  const std::shared_ptr<LiveRecord> record_;
  const storage::v1::CellDescription cell_;
  OpenCamerasFunction open_cameras_;
  std::unique_ptr<CameraRig> cameras_;  // null: to be opened
  std::vector<size_t> places_;          // in the rig, by view of the cell
  std::optional<JointPoller> joints_;
  Acquisition acquisition_;  // uses joints_
  std::jthread thread_;      // last: it uses the others
};

}  // namespace silhouette
