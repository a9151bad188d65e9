// Tags that stay where they are in the cell: what shows whether a camera moved.
#pragma once

#include <map>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/tag_sighting.h"

namespace silhouette {

// A tag as one view sees it: view, family, id.
using SeenTag = std::tuple<std::string, std::string, int>;

// The mean of all frames' sightings of each tag, its frame empty, its sigma that of the mean.
// InvalidArgument if a tag moved between frames, by more than a pixel: it is none that stays.
absl::StatusOr<std::map<SeenTag, TagSighting>> MeanSightings(
    std::span<const TagSighting> sightings);

}  // namespace silhouette
