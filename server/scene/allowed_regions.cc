// SPDX-License-Identifier: Apache-2.0
#include "server/scene/allowed_regions.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "common/times/times.h"

namespace silhouette {

bool RegionEffect::Touches(std::span<const std::optional<Mask>> test_robot) const {
  for (size_t view = 0; view < taken.size(); ++view) {
    if (!taken[view] || !test_robot[view]) continue;
    if (Intersects(taken[view]->words(), test_robot[view]->words())) return true;
  }
  return false;
}

namespace {

constexpr size_t kMostCorners = 1000;

// The obstacle pixels inside each of the regions.
std::vector<RegionEffect> Inside(const RegionSet& regions, const ObstacleImages& images) {
  std::vector<RegionEffect> inside;
  for (const AllowedRegion& region : regions.regions) {
    RegionEffect& effect = inside.emplace_back(
        RegionEffect{region.name, std::vector<std::optional<Mask>>(images.size())});
    for (size_t view = 0; view < images.size(); ++view) {
      if (!images[view] || !region.pixels[view]) continue;
      effect.taken[view] = images[view]->obstacle() & *region.pixels[view];
    }
  }
  return inside;
}

}  // namespace

std::vector<RegionEffect> Apply(const RegionSet& regions, std::span<const double> margins,
                                ObstacleImages& without_margins, ObstacleImages& images) {
  std::vector<RegionEffect> effects = Inside(regions, without_margins);
  for (size_t view = 0; view < images.size(); ++view) {
    if (!images[view]) continue;
    for (const RegionEffect& effect : effects) {
      if (effect.taken[view]) {
        without_margins[view] = without_margins[view]->Ignoring(*effect.taken[view]);
      }
    }
    const Mask before = images[view]->obstacle();
    images[view] = without_margins[view]->WithMargin(margins[view]);
    const Mask gone = before - images[view]->obstacle();
    // Where regions overlap, each counts as having taken the pixel away.
    for (RegionEffect& effect : effects) {
      std::optional<Mask>& taken = effect.taken[view];
      if (taken) taken = Grown(*taken, margins[view]) & gone;
      if (taken && taken->Empty()) taken.reset();
    }
  }
  std::erase_if(effects, [](const RegionEffect& effect) {
    return std::none_of(effect.taken.begin(), effect.taken.end(),
                        [](const std::optional<Mask>& taken) { return taken.has_value(); });
  });
  return effects;
}

absl::StatusOr<Mask> PixelsInPolygon(MaskSize size,
                                     std::span<const std::pair<double, double>> corners) {
  if (corners.size() < 3 || corners.size() > kMostCorners) {
    return absl::InvalidArgumentError(
        absl::StrCat("a polygon has 3 to ", kMostCorners, " corners, not ", corners.size()));
  }
  std::vector<cv::Point2f> polygon;
  for (const auto& [x, y] : corners) {
    const auto inside = [](double value, int pixels) {
      return value >= -0.5 && value <= pixels - 0.5;
    };
    if (!inside(x, size.width) || !inside(y, size.height)) {
      return absl::InvalidArgumentError(
          absl::StrCat("the corner ", x, ",", y,
                       " is outside the view's mask: corners are pixels of the mask, "
                       "which has ",
                       size.width, "x", size.height, ", not of the camera's image"));
    }
    polygon.emplace_back(static_cast<float>(x), static_cast<float>(y));
  }
  return Mask::FromPredicate(size, [&](int x, int y) {
    const cv::Point2f centre(static_cast<float>(x), static_cast<float>(y));
    return cv::pointPolygonTest(polygon, centre, /*measureDist=*/false) >= 0;
  });
}

absl::StatusOr<AllowedRegion> AllowedRegions::Allow(const std::string& name,
                                                    std::vector<std::optional<Mask>> pixels,
                                                    absl::Duration duration, const Moment& now) {
  const bool printable = std::none_of(name.begin(), name.end(), [](char c) {
    return absl::ascii_iscntrl(static_cast<unsigned char>(c));
  });
  if (name.empty() || name.size() > kLongestName || !printable) {
    return absl::InvalidArgumentError(
        absl::StrCat("name: a region has a name of 1 to ", kLongestName, " printable characters"));
  }
  if (!(duration > absl::ZeroDuration()) || duration > kLongest) {
    return absl::InvalidArgumentError(
        absl::StrCat("duration: a region is in force for more than 0 s and at most ",
                     SpokenTime(kLongest), ", not ", SpokenTime(duration)));
  }
  if (std::none_of(pixels.begin(), pixels.end(),
                   [](const std::optional<Mask>& mask) { return mask && !mask->Empty(); })) {
    return absl::InvalidArgumentError("views: the region has no pixel in any view");
  }
  std::vector<AllowedRegion> regions = InForce(now)->regions;
  std::erase_if(regions, [&](const AllowedRegion& region) { return region.name == name; });
  if (regions.size() == kMost) {
    return absl::ResourceExhaustedError(
        absl::StrCat("there are ", kMost, " allowed regions; revoke one"));
  }
  AllowedRegion region{name, std::move(pixels), now.running + duration, now.time + duration};
  regions.push_back(region);
  std::sort(regions.begin(), regions.end(),
            [](const AllowedRegion& a, const AllowedRegion& b) { return a.name < b.name; });
  Replace(std::move(regions));
  return region;
}

bool AllowedRegions::Revoke(const std::string& name, const Moment& now) {
  std::vector<AllowedRegion> regions = InForce(now)->regions;
  if (std::erase_if(regions, [&](const AllowedRegion& region) { return region.name == name; }) ==
      0) {
    return false;
  }
  Replace(std::move(regions));
  return true;
}

void AllowedRegions::Clear() {
  if (set_->regions.empty()) return;
  ended_.insert(ended_.end(), set_->regions.begin(), set_->regions.end());
  Replace({});
}

std::shared_ptr<const RegionSet> AllowedRegions::InForce(const Moment& now) {
  const auto ended = [&](const AllowedRegion& region) { return region.end <= now.running; };
  if (std::any_of(set_->regions.begin(), set_->regions.end(), ended)) {
    std::vector<AllowedRegion> regions = set_->regions;
    std::copy_if(regions.begin(), regions.end(), std::back_inserter(ended_), ended);
    std::erase_if(regions, ended);
    Replace(std::move(regions));
  }
  return set_;
}

std::vector<AllowedRegion> AllowedRegions::TakeEnded(const Moment& now) {
  InForce(now);
  return std::exchange(ended_, {});
}

void AllowedRegions::Replace(std::vector<AllowedRegion> regions) {
  set_ = std::make_shared<const RegionSet>(RegionSet{set_->revision + 1, std::move(regions)});
}

}  // namespace silhouette
