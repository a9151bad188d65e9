// SPDX-License-Identifier: Apache-2.0
// How a cell is served.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "absl/time/time.h"
#include "capture/segmentation/settings.h"
#include "server/audit/audit_log.h"
#include "server/collision/policy.h"
#include "server/gate/gate_settings.h"
#include "server/live/live_record.h"
#include "server/scene/client_limits.h"
#include "server/scene/clock.h"
#include "server/scene/scene_settings.h"
#include "server/scene/scene_store.h"
#include "server/scene/served_database.h"

namespace silhouette {

struct ServingSettings {
  Policy policy;  // where a request names none
  // Instead of policy.preset the best one that the database can serve.
  bool choose_preset = false;
  SceneSettings scene;
  SegmentationSettings segmentation;
  Clock clock = SystemClock;
  // How long the map of the default policy is worked out after each scene, before anybody asks for
  // it. Zero: not at all.
  absl::Duration map_time = absl::Milliseconds(20);
  IndexCheckSettings index_check;
  // A watch whose caller does not take an update for so long is ended: it keeps the update's scene
  // and database alive.
  absl::Duration longest_write = absl::Seconds(30);
  // What is known at first of whether the calibration holds; null: it is not checked.
  std::shared_ptr<const CalibrationTrust> trust;
  // Checks that one request for a path may take: a million by views alone take some seconds of a
  // worker thread. Under presets that search lines or space one takes up to a hundred times as
  // long.
  int64_t most_path_checks = 1'000'000;
  int64_t most_path_searches = 20'000;
  // Views whose camera images have no noise: the same image in a row does not mean that the camera
  // is frozen.
  std::set<std::string> without_noise;
  // Of the server's own acquisition, if it takes images itself; then PublishScene is
  // refused.
  std::shared_ptr<LiveRecord> live;
  // By the name of each joint whose kind is known: whether it slides, so that its values are
  // metres, else radians. Only clients and pages use it.
  std::map<std::string, bool> joint_slides;
  // host:port where metrics are served; empty: nowhere.
  std::string metrics;
  // Who reaches the server, and how.
  GateSettings gate;
  // Where changes are recorded; null: nowhere.
  std::shared_ptr<AuditLog> audit;
  // For checks, as many for watches and as many for scenes.
  int worker_threads = 2;
  ClientLimits limits;
};

// Whether each map of the database is drawn, and not looked up in an index.
bool DrawsMaps(const ServedDatabase& database);

// Whether the values of the joint are metres, else radians; nothing if it is not known.
std::optional<bool> Slides(const ServingSettings& settings, const GridJoint& joint);

// The policy where a request names none, for requests that rest on `database`.
Policy DefaultPolicy(const ServingSettings& settings, const ServedDatabase& database);

}  // namespace silhouette
