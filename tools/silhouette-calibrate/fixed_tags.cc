#include "tools/silhouette-calibrate/fixed_tags.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

constexpr double kStill = 1;  // pixels

}  // namespace

absl::StatusOr<std::map<SeenTag, TagSighting>> MeanSightings(
    std::span<const TagSighting> sightings) {
  std::map<SeenTag, std::vector<const TagSighting*>> by_tag;
  for (const TagSighting& sighting : sightings) {
    by_tag[{sighting.view, sighting.family, sighting.tag}].push_back(&sighting);
  }
  std::map<SeenTag, TagSighting> means;
  for (const auto& [key, seen] : by_tag) {
    TagSighting mean = *seen.front();
    mean.frame.clear();
    mean.sigma = 0;
    for (Eigen::Vector2d& corner : mean.corners) corner.setZero();
    const auto count = static_cast<double>(seen.size());
    for (const TagSighting* sighting : seen) {
      for (size_t i = 0; i < mean.corners.size(); ++i) {
        if ((sighting->corners[i] - seen.front()->corners[i]).norm() > kStill) {
          return absl::InvalidArgumentError(
              absl::StrCat("view '", mean.view, "': tag ", mean.tag, " of ", mean.family,
                           " is not where it was between frames '", seen.front()->frame, "' and '",
                           sighting->frame,
                           "'; give frames of tags that stay in the cell, and of one camera "
                           "position only"));
        }
        mean.corners[i] += sighting->corners[i] / count;
      }
      mean.sigma = std::max(mean.sigma, sighting->sigma);
    }
    mean.sigma /= std::sqrt(count);
    means.emplace(key, mean);
  }
  return means;
}

}  // namespace silhouette
