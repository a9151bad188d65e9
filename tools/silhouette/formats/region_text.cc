#include "tools/silhouette/formats/region_text.h"

#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/picture/mask_png.h"
#include "db/status/status_macros.h"

namespace silhouette {

absl::StatusOr<client::RegionPixels> ParseRegionPolygon(const std::string& text) {
  const absl::Status wrong = absl::InvalidArgumentError(absl::StrCat(
      "'", text,
      "' is not VIEW:x,y;x,y;x,y: a view and at least three corners in pixels of its mask; in most "
      "shells quotes belong around it"));
  // A view may have a colon in its name, corners have none.
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return wrong;
  client::Polygon polygon;
  for (const absl::string_view corner : absl::StrSplit(text.substr(colon + 1), ';')) {
    const std::vector<absl::string_view> values = absl::StrSplit(corner, ',');
    double x = 0;
    double y = 0;
    if (values.size() != 2 || !absl::SimpleAtod(values[0], &x) ||
        !absl::SimpleAtod(values[1], &y)) {
      return wrong;
    }
    polygon.corners.emplace_back(x, y);
  }
  if (polygon.corners.size() < 3) return wrong;
  return client::RegionPixels{text.substr(0, colon), std::move(polygon)};
}

absl::StatusOr<client::RegionPixels> ReadRegionMask(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) {
    return absl::InvalidArgumentError(absl::StrCat("'", text, "' is not VIEW=FILE"));
  }
  ASSIGN_OR_RETURN(Mask mask, ReadMaskPng(text.substr(equals + 1)));
  return client::RegionPixels{text.substr(0, equals), std::move(mask)};
}

absl::StatusOr<absl::Duration> ParseDuration(const std::string& text) {
  absl::Duration duration;
  if (absl::ParseDuration(text, &duration)) return duration;
  return absl::InvalidArgumentError(
      absl::StrCat("'", text, "' is not a time; write e.g. 30s, 1m30s or 500ms"));
}

}  // namespace silhouette
