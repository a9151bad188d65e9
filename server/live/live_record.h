// SPDX-License-Identifier: Apache-2.0
// How the server's own acquisition goes: counts, ages, faults and latencies; and the
// variant of the robot that it was given.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "server/live/fault_log.h"
#include "server/live/known_variant.h"
#include "server/scene/clock.h"

namespace silhouette {

// How long something took, again and again.
struct LatencyFigures {
  // Of all.
  uint64_t count = 0;
  absl::Duration sum;
  // Per bound of LatencyRecord::kBounds: how many were not longer.
  std::vector<uint64_t> within;
  // Of the newest LatencyRecord::kNewest; zero if there is none.
  absl::Duration median;
  absl::Duration p99;
  absl::Duration longest;
};

// Not thread-safe.
class LatencyRecord {
 public:
  static constexpr size_t kNewest = 4096;
  // Seconds, ascending.
  static constexpr std::array<double, 12> kBounds = {0.001, 0.002, 0.003, 0.005, 0.0075, 0.01,
                                                     0.015, 0.02,  0.03,  0.05,  0.1,    0.5};

  void Add(absl::Duration latency);
  LatencyFigures Figures() const;

 private:
  uint64_t count_ = 0;
  absl::Duration sum_;
  std::array<uint64_t, kBounds.size()> within_{};
  std::vector<absl::Duration> newest_;  // a ring
};

// Of a camera, or of the robot.
struct DeviceStatus {
  // The view; empty: the robot.
  std::string name;
  // Whether what it gave last is no older than max_age.
  bool serving = false;
  // How often it gave something that could be used, and how often not.
  uint64_t good = 0;
  uint64_t errors = 0;
  // When what it gave last was taken, and how long ago that is; nothing: it gave nothing yet.
  std::optional<absl::Time> last;
  std::optional<absl::Duration> age;
  // Why it gave nothing that could be used when it was asked last; empty if it did.
  std::string fault;
  // Of its newest error, gone or not; empty: there was none.
  std::string last_error;
  absl::Time last_error_time;
};

struct LiveStatus {
  // Whether all cameras and the robot are.
  bool serving = false;
  absl::Time started;
  uint64_t scenes = 0;
  // Sets of images of which no scene was made.
  uint64_t lost_sets = 0;
  // Why the newest set is no scene; empty if it is.
  std::string fault;
  std::vector<DeviceStatus> cameras;  // by view
  DeviceStatus robot;
  // From the last pixel of a set: until its images are differenced, its scene is published, and its
  // map is worked out, where the map was worked out without being asked for (map_time).
  LatencyFigures to_masks;
  LatencyFigures to_scene;
  LatencyFigures to_map;
};

// The camera images that a scene was made of.
struct LiveImages {
  uint64_t scene = 0;                              // its id
  std::vector<std::optional<CameraImage>> images;  // by view; nothing where there was none
};

// A JPEG file of the image for people to look at: made smaller if it is wider than `widest` pixels.
std::string JpegOf(const CameraImage& image, int widest);

// One line for the log.
std::string Spoken(const LiveStatus& status);

// What the devices that do not serve do, or else why there is no scene: half a sentence.
std::string FaultsOf(const LiveStatus& status);

// Thread-safe. Writes a line to the log when a device or the acquisition as a whole fails in
// another way than before, and when it has recovered.
class LiveRecord {
 public:
  // `views`: their names. `max_age`: of SceneSettings. `known_variant`: what is known at the start.
  LiveRecord(const std::vector<std::string>& views, absl::Duration max_age, Clock clock,
             KnownVariant known_variant = {});

  // What a view gave: an image taken at `taken` that arrived at `arrived`, or an error.
  void NoteImage(size_t view, const Moment& taken, const Moment& arrived);
  void NoteImageError(size_t view, const absl::Status& error);
  // The same of the robot's joints.
  void NoteJoints(const Moment& answered);
  void NoteJointsError(const absl::Status& error);
  // Why the newest scene is without joints; OK if it is not.
  void NoteJoined(const absl::Status& status);

  // A set of images that arrived at `arrived` is differenced now; is a scene now; or is none.
  void NoteMasks(const Moment& arrived);
  void NoteScene(const Moment& arrived);
  void NoteLostSet(const absl::Status& error);
  // From now on the images of the newest scene are kept, for people who look at them.
  void KeepImages();
  // Those of the newest scene; kept only after KeepImages().
  void NoteImages(LiveImages images);
  // Null: none are kept.
  std::shared_ptr<const LiveImages> images() const;

  // The map of the scene that arrived at `arrived` is worked out now.
  void NoteMap(const Moment& arrived);

  // As KnownVariant's functions of these names. Scenes that were made of what known_variant()
  // returned before must then be withdrawn by the caller.
  bool TellVariant(const std::string& variant, absl::Duration now);
  bool TellVariantChanging();
  void NoteVariants(const std::vector<std::string>& variants);
  KnownVariant known_variant() const;

  LiveStatus Status() const;
  // The same without latencies, which take longer to work out.
  LiveStatus StatusOfDevices() const;

 private:
  using StatusLog = FaultLog<absl::StatusCode>;

  struct Device {
    DeviceStatus status;        // but for `serving` and `age`, which time alone changes
    absl::Duration taken = {};  // of the last: running clock
    StatusLog log = {};
  };

  // With the mutex held.
  void NoteGood(Device& device, const Moment& taken, const Moment& arrived);
  void NoteError(Device& device, const absl::Status& error);
  static void Say(StatusLog& log, const std::string& what, const absl::Status& status,
                  const Moment& now);
  DeviceStatus StatusOf(const Device& device, const Moment& now) const;
  LiveStatus WithoutLatencies() const;

  const absl::Duration max_age_;
  const Clock clock_;
  mutable std::mutex mutex_;
  KnownVariant known_variant_;
  std::vector<Device> cameras_;
  Device robot_;
  std::string without_joints_;  // why the newest scene is
  StatusLog join_log_;
  LiveStatus status_;  // but for devices and latencies
  StatusLog set_log_;
  LatencyRecord to_masks_;
  LatencyRecord to_scene_;
  LatencyRecord to_map_;
  bool keeps_images_ = false;
  std::shared_ptr<const LiveImages> images_;
};

}  // namespace silhouette
