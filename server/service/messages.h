// SPDX-License-Identifier: Apache-2.0
// Between the API's messages and our own values.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/collision/clearance.h"
#include "server/collision/policy.h"
#include "server/collision/verdict.h"
#include "server/live/live_record.h"
#include "server/scene/make_scene.h"
#include "server/scene/scene.h"
#include "server/scene/scene_store.h"
#include "server/service/serving_settings.h"
#include "silhouette/v1/collision_service.pb.h"
#include "silhouette/v1/database_service.pb.h"
#include "silhouette/v1/drawn_robot.pb.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {

// From messages (requests.cc). InvalidArgument names the field.

// What the policy of a request leaves open is taken from `defaults`.
absl::StatusOr<Policy> PolicyFrom(const v1::Policy& message, const Policy& defaults, int views);
// One value per joint of the grid. `field` is what an error calls it.
absl::StatusOr<Configuration> ConfigurationFrom(const v1::Configuration& message,
                                                const ConfigurationGrid& grid,
                                                const std::string& field);
// `arrived`: when the message arrived; `settings`: whether it may leave out capture times.
// OutOfRange: a server_clock later than that.
absl::StatusOr<SceneInput> SceneInputFrom(const v1::PublishSceneRequest& message,
                                          const SceneSettings& settings, const Moment& arrived);
// Per view of the database: where the region lies.
absl::StatusOr<std::vector<std::optional<Mask>>> RegionPixelsFrom(
    const v1::AllowRegionRequest& message, const ServedDatabase& database);
absl::Duration DurationFrom(const google::protobuf::Duration& message);

// Into messages (messages.cc).

v1::Verdict::Reason ToMessage(Reason reason);
void ToMessage(absl::Time time, google::protobuf::Timestamp* message);
void ToMessage(absl::Duration duration, google::protobuf::Duration* message);
// `evidence`: empty, or one per view of the database. `regions`: names of allowed regions.
// `clearance`: in pixels, if it is asked for; an unknown verdict has none.
void ToMessage(const Verdict& verdict, std::span<const ViewEvidence> evidence,
               std::span<const std::string> regions, std::optional<double> clearance,
               const ServedDatabase& database, v1::Verdict* message);
void ToMessage(const PathClearance& narrowest, v1::PathPlace* message);
void ToMessage(const Policy& policy, int views, v1::Policy* message);
void ToMessage(const ConfigurationGrid& grid, const ServingSettings& settings, v1::Grid* message);
void ToMessage(const Mask& mask, v1::Mask* message);
// The robot that the database draws, which it does (RobotImageTable::drawn).
void ToMessage(const ServedDatabase& database, v1::DrawnRobot* message);
// What an answer under the policy rests on that is ready at the moment `now`.
void ToMessage(const Served& served, const Policy& policy, const Moment& now, v1::Basis* message);
void ToMessage(const AllowedRegion& region, const ServedDatabase& database, const Moment& now,
               v1::AllowedRegion* message);
void ToMessage(const SceneDefect& defect, v1::SceneDefect* message);
// `defects`: DefectsOf it.
void ToMessage(const Scene& scene, bool include_planes, std::span<const SceneDefect> defects,
               v1::Scene* message);
// All but the robot's variant.
void ToMessage(const LiveStatus& status, v1::Acquisition* message);
// `variants`: of the database.
void ToMessage(const KnownVariant& known, const std::vector<std::string>& variants,
               v1::RobotVariant* message);
void ToMessage(const ServedDatabase& database, const ServingSettings& settings,
               v1::GetDatabaseResponse* message);

}  // namespace silhouette
