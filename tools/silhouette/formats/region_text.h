// Allowed regions as people write them.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "silhouette/region.h"

namespace silhouette {

// "VIEW:x,y;x,y;x,y": a polygon in pixels of the mask. InvalidArgument, naming the text, if it is
// none.
absl::StatusOr<client::RegionPixels> ParseRegionPolygon(const std::string& text);

// "VIEW=FILE": an image file of the mask, white where the region lies. Errors name the text or the
// file.
absl::StatusOr<client::RegionPixels> ReadRegionMask(const std::string& text);

// "30s", "1m30s", "500ms". InvalidArgument, naming the text, if it is none.
absl::StatusOr<absl::Duration> ParseDuration(const std::string& text);

}  // namespace silhouette
