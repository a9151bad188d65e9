// SPDX-License-Identifier: Apache-2.0
#include "server/service/regions.h"

#include <spdlog/spdlog.h>

#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "server/service/messages.h"

namespace silhouette {
namespace {

// "12 pixels in 'left', 9 in 'top'"
std::string PixelCounts(const AllowedRegion& region, const ServedDatabase& database) {
  std::string counts;
  for (size_t view = 0; view < region.pixels.size(); ++view) {
    if (!region.pixels[view]) continue;
    absl::StrAppend(&counts, counts.empty() ? "" : ", ", region.pixels[view]->Count(),
                    counts.empty() ? " pixels in '" : " in '",
                    database.view_name(static_cast<int>(view)), "'");
  }
  return counts;
}

}  // namespace

absl::Status Answer(Serving& serving, const std::string& who, const v1::AllowRegionRequest& request,
                    const Moment& arrived, v1::AllowRegionResponse* response) {
  const std::shared_ptr<const ServedDatabase> database = serving.scenes.database();
  ASSIGN_OR_RETURN(auto pixels, RegionPixelsFrom(request, *database));
  ASSIGN_OR_RETURN(const AllowedRegion region,
                   serving.scenes.Allow(request.name(), std::move(pixels),
                                        DurationFrom(request.duration()), arrived, database));
  const std::string what =
      absl::StrCat("'", region.name, "' for ", SpokenTime(region.end - arrived.running), ": ",
                   PixelCounts(region, *database));
  spdlog::info("{} allows region {}", who, what);
  serving.Audit(who, "region.allow", what);
  ToMessage(region, *database, serving.settings.clock(), response->mutable_region());
  return absl::OkStatus();
}

absl::Status Answer(Serving& serving, const std::string& who,
                    const v1::RevokeRegionRequest& request, v1::RevokeRegionResponse* response) {
  const bool was_in_force = serving.scenes.Revoke(request.name(), serving.settings.clock());
  if (was_in_force) {
    spdlog::info("{} revokes region '{}'", who, request.name());
    serving.Audit(who, "region.revoke", "'" + request.name() + "'");
  }
  response->set_was_in_force(was_in_force);
  return absl::OkStatus();
}

}  // namespace silhouette
