// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/tag_drift.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

using Eigen::Vector2d;

constexpr double kStill = 1;  // pixels that a tag at rest may seem to move

struct Moved {
  Vector2d before;
  Vector2d after;
  double sigma = 0;
  int tag = 0;
};

Vector2d MedianShift(const std::vector<Moved>& corners) {
  std::vector<double> x;
  std::vector<double> y;
  for (const Moved& corner : corners) {
    x.push_back(corner.after.x() - corner.before.x());
    y.push_back(corner.after.y() - corner.before.y());
  }
  return {Median(x), Median(y)};
}

// Tags that disagree with the shift of most; none if there are fewer than three.
std::vector<int> OddTags(const std::vector<Moved>& corners) {
  const Vector2d shift = MedianShift(corners);
  std::map<int, double> off;
  for (const Moved& corner : corners) {
    off[corner.tag] = std::max(off[corner.tag], (corner.after - corner.before - shift).norm());
  }
  if (off.size() < 3) return {};
  std::vector<double> all;
  for (const auto& [tag, distance] : off) all.push_back(distance);
  const double limit = 1 + 5 * Median(all);
  std::vector<int> odd;
  for (const auto& [tag, distance] : off) {
    if (distance > limit) odd.push_back(tag);
  }
  return 2 * odd.size() < off.size() ? odd : std::vector<int>();
}

// The motion of the image's plane, x + shift + turn * (-y, x) about `middle`, by least squares.
void FitMotion(const std::vector<Moved>& corners, const Vector2d& middle, ViewDrift& drift) {
  Vector2d centre = Vector2d::Zero();
  Vector2d mean = Vector2d::Zero();
  for (const Moved& corner : corners) {
    centre += corner.before / static_cast<double>(corners.size());
    mean += (corner.after - corner.before) / static_cast<double>(corners.size());
  }
  double turning = 0;
  double arms = 0;
  double sigma = 0;
  for (const Moved& corner : corners) {
    const Vector2d arm = corner.before - centre;
    const Vector2d motion = corner.after - corner.before - mean;
    turning += arm.x() * motion.y() - arm.y() * motion.x();
    arms += arm.squaredNorm();
    sigma = std::max(sigma, corner.sigma);
  }
  const double turn = arms > 0 ? turning / arms : 0;
  const bool sure = arms > 0 && std::abs(turn) > 4 * sigma / std::sqrt(arms);
  drift.turn = sure ? turn : 0;
  const Vector2d arm = middle - centre;
  drift.shift = mean + drift.turn * Vector2d(-arm.y(), arm.x());
  double squares = 0;
  for (const Moved& corner : corners) {
    const Vector2d from = corner.before - middle;
    const Vector2d expected = drift.shift + drift.turn * Vector2d(-from.y(), from.x());
    squares += (corner.after - corner.before - expected).squaredNorm() / 2;
  }
  drift.rms_left = std::sqrt(squares / static_cast<double>(corners.size()));
}

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
      for (size_t i = 0; i < std::min(mean.corners.size(), sighting->corners.size()); ++i) {
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

ViewDrift DriftByTags(const std::string& view, const ViewSizes& sizes,
                      const std::map<SeenTag, TagSighting>& before,
                      const std::map<SeenTag, TagSighting>& after) {
  ViewDrift drift;
  drift.view = view;
  drift.method = "tags";
  std::vector<Moved> corners;
  for (const auto& [key, was] : before) {
    const auto is = after.find(key);
    if (was.view != view || is == after.end()) continue;
    if (is->second.corners.size() != was.corners.size()) continue;
    for (size_t i = 0; i < was.corners.size(); ++i) {
      corners.push_back({was.corners[i], is->second.corners[i],
                         std::hypot(was.sigma, is->second.sigma), was.tag});
    }
  }
  if (corners.empty()) {
    drift.message =
        "none of the tags that it saw when it was calibrated is seen now; clear the view to them";
    return drift;
  }
  drift.odd_tags = OddTags(corners);
  std::erase_if(corners, [&](const Moved& corner) {
    return std::ranges::find(drift.odd_tags, corner.tag) != drift.odd_tags.end();
  });
  const PixelSize image = sizes.image;
  FitMotion(corners, {0.5 * (image.width - 1), 0.5 * (image.height - 1)}, drift);
  const Vector2d to_mask(static_cast<double>(sizes.mask.width) / image.width,
                         static_cast<double>(sizes.mask.height) / image.height);
  const auto count = [&](const Vector2d& motion) {
    drift.moved = std::max(drift.moved, motion.norm());
    drift.moved_mask = std::max(drift.moved_mask, motion.cwiseProduct(to_mask).norm());
  };
  for (const double x : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5}) {
      count(drift.shift + drift.turn * Vector2d(-y * image.height, x * image.width));
    }
  }
  // Motions that are no turn: of a camera that was carried, near things move more than far ones.
  std::vector<double> lengths;
  for (const Moved& corner : corners) {
    lengths.push_back((corner.after - corner.before).norm());
    drift.before.push_back(corner.before);
    drift.after.push_back(corner.after);
  }
  const double median = Median(lengths);
  if (median > drift.moved) {
    drift.moved_mask *= drift.moved > 0 ? median / drift.moved : 0;
    drift.moved_mask = std::max(drift.moved_mask, median * to_mask.maxCoeff());
    drift.moved = median;
  }
  drift.corners = static_cast<int>(corners.size());
  drift.checked = true;
  if (!drift.odd_tags.empty()) {
    drift.message = absl::StrCat(drift.odd_tags.size(), " tags moved by themselves");
  }
  return drift;
}

}  // namespace silhouette
