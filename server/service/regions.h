// SPDX-License-Identifier: Apache-2.0
// Allows and revokes regions, for clients of the API and for the page. Each change is written to
// the log and, if changes are recorded, to the audit log.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "server/scene/clock.h"
#include "server/service/serving.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {

// `who` asks, printable. The region is in force from `arrived` on. Errors: those of
// RegionPixelsFrom and SceneStore::Allow.
absl::Status Answer(Serving& serving, const std::string& who, const v1::AllowRegionRequest& request,
                    const Moment& arrived, v1::AllowRegionResponse* response);

absl::Status Answer(Serving& serving, const std::string& who,
                    const v1::RevokeRegionRequest& request, v1::RevokeRegionResponse* response);

}  // namespace silhouette
