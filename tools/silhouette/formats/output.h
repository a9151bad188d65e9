// SPDX-License-Identifier: Apache-2.0
// Answers in words and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/result/result.h"
#include "silhouette/answers.h"
#include "silhouette/client.h"
#include "silhouette/configuration_space.h"
#include "silhouette/v1/scene_service.pb.h"
#include "silhouette/verdict.h"

namespace silhouette {

using Json = nlohmann::ordered_json;

// "free", "occupied", "unknown: no scene has been published yet: publish one"; with a word on
// obstacles that may hide, and the clearance if it is free and has one.
std::string Spoken(const client::Verdict& verdict, const client::Basis& basis);
// Why all or some is unknown: what the basis says of the reason, or else what the reason means.
std::string Spoken(client::Reason reason, const client::Basis& basis);
// "scene 3, 120 ms old, database generation 7", "no scene".
std::string Spoken(const client::Basis& basis);

// "free: 41 places checked", "not free at 0.1,0.2, 40 % on the way from waypoint 1: occupied".
std::string Spoken(const client::PathCheck& check);

// {"state", "reason" (null if not unknown), "hidden_possible", "regions", "views": [...]}; with
// "clearance" (null if unknown) after the reason, and in each view the "distance", if it was asked
// for.
Json JsonOf(const client::Verdict& verdict, client::Clearance clearance = client::Clearance::kOmit);
// {"scene_id", "scene_time", "scene_age_s", "valid_for_s", "database_generation", "variant",
// "scene_variant", "scene_regions", "unverified_model", "defects": [{"reason", "message"}]}; null
// where there is no scene, or its variant is unknown. "valid_for_s" counts from now on.
Json JsonOf(const client::Basis& basis);

// The basis, the verdict, "checked", where it is not free, or narrowest; "proof" if it is free, and
// "sampled_step_m" where it is sampled; "separation" if it was asked for.
Json JsonOf(const client::PathCheck& check, client::Clearance clearance);

// {"variant", "changing", "unknown", "last_scene_before"}; null where the variant, or why it is
// unknown, is empty.
Json JsonOf(const v1::ChangeVariantResponse& change);
std::string TextOf(const v1::ChangeVariantResponse& change);

Json JsonOf(const v1::Scene& scene);
std::string TextOf(const v1::Scene& scene);

Json JsonOf(const v1::Acquisition& acquisition);
std::string TextOf(const v1::Acquisition& acquisition);

Json JsonOf(const v1::AllowedRegion& region);

// The answer to `silhouette path`.
std::string TextOf(const client::PathCheck& check);

// The answer to `silhouette explain`. `hint` follows the verdict.
Json JsonOf(const Configuration& configuration, const client::Explanation& explanation);
std::string TextOf(const std::string& configuration, const std::string& hint,
                   const client::Explanation& explanation);

// Writes number, joint values and state of every configuration: CSV if the name ends in .csv, else
// JSON.
absl::Status WriteSpace(const client::ConfigurationSpace& space, const std::string& path);

// "0.5,-0.52": radians, with as many digits as people read.
std::string Spoken(const Configuration& configuration);

// RFC 3339 in UTC: to the millisecond for people, and as it is for scripts and `replay --at`.
std::string Spoken(absl::Time time);
std::string Exact(absl::Time time);

}  // namespace silhouette
