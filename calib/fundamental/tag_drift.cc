// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/tag_drift.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

using Eigen::Vector2d;

constexpr double kStill = 1;           // pixels that a tag at rest may seem to move
constexpr double kStillOnMask = 0.05;  // the same on a mask, where its pixels are larger

double StillPixels(const ViewSizes& sizes) {
  if (sizes.mask.width <= 0) return kStill;
  return std::max(kStill, kStillOnMask / sizes.mask_scale());
}

struct Moved {
  Vector2d before;
  Vector2d after;
  double sigma = 0;
  SeenTag tag;
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

// Tags that disagree with the shift of most by `least` pixels and more; none if there are fewer
// than three.
std::vector<SeenTag> OddTags(const std::vector<Moved>& corners, double least) {
  const Vector2d shift = MedianShift(corners);
  std::map<SeenTag, double> off;
  for (const Moved& corner : corners) {
    off[corner.tag] = std::max(off[corner.tag], (corner.after - corner.before - shift).norm());
  }
  if (off.size() < 3) return {};
  std::vector<double> all;
  for (const auto& [tag, distance] : off) all.push_back(distance);
  const double limit = least + 5 * Median(all);
  std::vector<SeenTag> odd;
  for (const auto& [tag, distance] : off) {
    if (distance > limit) odd.push_back(tag);
  }
  return 2 * odd.size() < off.size() ? odd : std::vector<SeenTag>();
}

// "tag 7 of tagStandard41h12 moved by itself, or ...". `odd` is not empty.
std::string OddTagsText(const std::vector<SeenTag>& odd) {
  const auto name = [](std::string* out, const SeenTag& tag) {
    absl::StrAppend(out, std::get<2>(tag), " of ", std::get<1>(tag));
  };
  const bool one = odd.size() == 1;
  return absl::StrCat(one ? "tag " : "tags ", absl::StrJoin(odd, ", ", name),
                      one ? " moved by itself, or the camera was carried: put it back"
                          : " moved by themselves, or the camera was carried: put them back",
                      ", or calibrate and record the tags again");
}

// How far the images of points move that are not on the tags, against what moves of the tags'
// corners remains unexplained: the most if the camera was carried and turned back, so that the tags
// stay where they were in the image. By simulation: with 4, a seventh to a third of such motions
// beyond the limit is confirmed where tags lie on a plane that faces the camera, with 12 up to a
// tenth.
constexpr double kNearer = 12;
constexpr double kTurnSigmas = 2;
constexpr size_t kFewCorners = 12;

// What the corners say of a motion of the image's plane.
struct PlaneMotion {
  Vector2d shift;     // of `middle`
  double turn = 0;    // about it
  double scale = 0;   // from it
  double unsure = 0;  // of turn and scale: kTurnSigmas standard deviations of either
  Vector2d centre;    // of the corners, where `unsure` does not matter
  double left = 0;    // root mean square of what this does not explain, of one coordinate
  double beyond = 0;  // by which that exceeds the corners' noise

  Vector2d At(const Vector2d& from_middle) const {
    return shift + scale * from_middle + turn * Vector2d(-from_middle.y(), from_middle.x());
  }
};

// By least squares.
PlaneMotion FitMotion(const std::vector<Moved>& corners, const Vector2d& middle) {
  PlaneMotion fit{.shift = Vector2d::Zero(), .centre = Vector2d::Zero()};
  Vector2d mean = Vector2d::Zero();
  for (const Moved& corner : corners) {
    fit.centre += corner.before / static_cast<double>(corners.size());
    mean += (corner.after - corner.before) / static_cast<double>(corners.size());
  }
  double turning = 0;
  double growing = 0;
  double arms = 0;
  double sigma = 0;
  for (const Moved& corner : corners) {
    const Vector2d arm = corner.before - fit.centre;
    const Vector2d motion = corner.after - corner.before - mean;
    turning += arm.x() * motion.y() - arm.y() * motion.x();
    growing += arm.dot(motion);
    arms += arm.squaredNorm();
    sigma = std::max(sigma, corner.sigma);
  }
  if (arms > 0) {
    fit.turn = turning / arms;
    fit.scale = growing / arms;
  }
  fit.shift = mean;
  fit.shift = fit.At(middle - fit.centre);
  double squares = 0;
  for (const Moved& corner : corners) {
    squares += (corner.after - corner.before - fit.At(corner.before - middle)).squaredNorm();
  }
  const double freedom = std::max(1.0, 2 * static_cast<double>(corners.size()) - 4);
  fit.left = std::sqrt(squares / freedom);
  fit.beyond = std::sqrt(std::max(0.0, fit.left * fit.left - sigma * sigma));
  fit.unsure = arms > 0 ? kTurnSigmas * std::max(sigma, fit.left) / std::sqrt(arms) : 1;
  return fit;
}

}  // namespace

absl::StatusOr<std::map<SeenTag, TagSighting>> MeanSightings(
    const std::string& view, const ViewSizes& sizes, std::span<const TagSighting> sightings) {
  const double still = StillPixels(sizes);
  std::map<SeenTag, std::vector<const TagSighting*>> by_tag;
  for (const TagSighting& sighting : sightings) {
    if (sighting.view != view) continue;
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
        if ((sighting->corners[i] - seen.front()->corners[i]).norm() > still) {
          return absl::InvalidArgumentError(absl::StrCat(
              "view '", view, "' saw tag ", mean.tag, " of ", mean.family,
              " move between the frames '", seen.front()->frame, "' and '", sighting->frame,
              "'; take frames of tags that stay in the cell, from one camera "
              "position"));
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
                      const std::map<SeenTag, TagSighting>& after, bool has_noise) {
  ViewDrift drift;
  drift.view = view;
  drift.method = "tags";
  std::vector<Moved> corners;
  for (const auto& [key, was] : before) {
    const auto is = after.find(key);
    if (was.view != view || is == after.end()) continue;
    if (is->second.corners.size() != was.corners.size()) continue;
    for (size_t i = 0; i < was.corners.size(); ++i) {
      corners.push_back(
          {was.corners[i], is->second.corners[i], std::hypot(was.sigma, is->second.sigma), key});
    }
  }
  if (corners.empty()) {
    drift.message =
        "none of the tags that it saw when it was calibrated is seen now; clear the view to them";
    return drift;
  }
  const PixelSize image = sizes.image;
  const Vector2d middle(0.5 * (image.width - 1), 0.5 * (image.height - 1));
  const PlaneMotion motion = FitMotion(corners, middle);
  drift.shift = motion.shift;
  drift.turn = motion.turn;
  drift.scale = motion.scale;
  drift.rms_left = motion.left;
  const Vector2d to_mask(static_cast<double>(sizes.mask.width) / image.width,
                         static_cast<double>(sizes.mask.height) / image.height);
  for (const double x : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5}) {
      const Vector2d from_middle(x * image.width, y * image.height);
      const Vector2d moved = motion.At(from_middle);
      const double more = motion.unsure * (from_middle + middle - motion.centre).norm();
      const double not_known = more + kNearer * motion.beyond;
      drift.moved = std::max(drift.moved, moved.norm() + not_known);
      drift.moved_mask = std::max(
          drift.moved_mask, moved.cwiseProduct(to_mask).norm() + not_known * to_mask.maxCoeff());
    }
  }
  for (const Moved& corner : corners) {
    drift.before.push_back(corner.before);
    drift.after.push_back(corner.after);
  }
  drift.corners = static_cast<int>(corners.size());
  drift.odd_tags = OddTags(corners, StillPixels(sizes));
  const bool repeated = has_noise && drift.before == drift.after;
  drift.checked = drift.odd_tags.empty() && !repeated;
  if (repeated) {
    drift.message =
        "its corners are those of the calibration to the last digit: the images are not new. Take "
        "new ones; if the camera repeats an old image, restart it; if its source has no noise, "
        "state "
        "'noise: none' in the cell file and give --cell";
  } else if (!drift.checked) {
    drift.message = OddTagsText(drift.odd_tags);
  } else if (corners.size() < kFewCorners) {
    drift.message = "three tags or more, spread over the image, would tell more";
  }
  return drift;
}

}  // namespace silhouette
