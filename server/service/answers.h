// SPDX-License-Identifier: Apache-2.0
// The answers to questions about configurations and paths, whichever call they come with.
#pragma once

#include <grpcpp/support/status.h>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/collision/stop.h"
#include "server/scene/checker.h"
#include "server/service/serving.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette {

// More is INVALID_ARGUMENT.
inline constexpr int kMaxConfigurations = 10'000;
inline constexpr int kMaxNumbers = 8'000'000;
inline constexpr int kMaxWaypoints = 10'000;
// Of drawn robots: bounds of CheckPathRequest.path_resolution, metres. Finer is nothing that a mask
// shows, coarser no proof between two places.
inline constexpr double kLeastPathResolution = 0.0005;
inline constexpr double kMostPathResolution = 0.1;
// Of a drawn robot that has no index, tiles of its map that a watch may ask for: it draws them for
// each scene, and a tile takes about 10 ms, under the sound presets up to seconds.
inline constexpr int kMaxDrawnTiles = 64;

// The policy of a request. FailedPrecondition if the database cannot serve it.
absl::StatusOr<Policy> PolicyFor(const Serving& serving, const v1::Policy& message,
                                 const ServedDatabase& database);

// The world at this moment under the policy of a request and with the variant that it names
// (WithVariant).
absl::StatusOr<Checker> CheckerFor(Serving& serving, const v1::Policy& policy,
                                   const std::string& variant);

// Writes what the answer rests on, and how long it is valid. Returns why it must not say free after
// all: the scene may have become too old, or an allowed region ended or revoked, while the answer
// was made.
Reason Conclude(const Serving& serving, const Served& served, const Policy& policy,
                v1::Basis* basis);

// The verdict that is returned when the answer is ready.
Verdict Final(const Verdict& verdict, Reason blocked);

// Whether a question takes so little time that it is answered at once, in gRPC's own threads.
bool AnsweredAtOnce(const Serving& serving, const v1::CheckConfigurationsRequest& request);

// The answer of the newest scene. `cancelled`: whether the call is over, as its caller is gone, its
// deadline has passed or the server stops; then the answer is given up: Cancelled.
absl::Status Answer(Serving& serving, const v1::CheckConfigurationsRequest& request,
                    const Stop& cancelled, v1::CheckConfigurationsResponse* response);
// ResourceExhausted: it takes more checks than ServingSettings::most_path_checks has it.
absl::Status Answer(Serving& serving, const v1::CheckPathRequest& request, const Stop& cancelled,
                    v1::CheckPathResponse* response);
absl::Status Answer(Serving& serving, const v1::ExplainRequest& request,
                    v1::ExplainResponse* response);

// Adds what every view shows: scene, obstacle, intersection and collision image, as far as they are
// there. Nothing where there is no scene.
void ExplainViews(const Checker& checker, std::span<const double> q, v1::ExplainResponse* response);

}  // namespace silhouette
