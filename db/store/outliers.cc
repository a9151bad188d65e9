// SPDX-License-Identifier: Apache-2.0
#include "db/store/outliers.h"

#include <algorithm>
#include <bit>
#include <deque>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>

#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr size_t kCacheBytes = size_t{256} << 20;

// The images around the place that is being looked at; the oldest go first.
class ImageCache {
 public:
  using Image = std::shared_ptr<const RobotImage>;

  explicit ImageCache(const Snapshot& snapshot) : snapshot_(snapshot) {}

  // Nothing for a configuration without masks.
  absl::StatusOr<Image> Get(ConfigurationNumber number) {
    if (const auto found = images_.find(number); found != images_.end()) return found->second;
    absl::StatusOr<std::optional<RobotImage>> image = snapshot_.Find(number);
    if (!image.ok() && !absl::IsDataLoss(image.status())) return image.status();
    const bool usable = image.ok() && image->has_value() && !(*image)->excluded;
    return Keep(number, usable ? std::make_shared<const RobotImage>(**std::move(image)) : nullptr);
  }

  Image Keep(ConfigurationNumber number, Image image) {
    size_t bytes = 256;
    if (image) {
      for (const Mask& mask : image->masks) bytes += 64 + mask.size().bytes();
    }
    if (!images_.emplace(number, image).second) return image;
    order_.emplace_back(number, bytes);
    bytes_ += bytes;
    while (bytes_ > kCacheBytes && order_.size() > 1) {
      images_.erase(order_.front().first);
      bytes_ -= order_.front().second;
      order_.pop_front();
    }
    return image;
  }

 private:
  const Snapshot& snapshot_;
  std::unordered_map<ConfigurationNumber, Image> images_;
  std::deque<std::pair<ConfigurationNumber, size_t>> order_;
  size_t bytes_ = 0;
};

// Two images along a joint that show what an image should look like.
struct Witnesses {
  ImageCache::Image first;
  ImageCache::Image second;
  bool on_one_side = false;  // `second` is beyond `first`
};

// Nothing if there are not two.
absl::StatusOr<std::optional<Witnesses>> WitnessesOf(const ConfigurationGrid& grid,
                                                     const GridIndex& index, int joint,
                                                     ImageCache& cache) {
  const auto image_at = [&](int delta) -> absl::StatusOr<ImageCache::Image> {
    const std::optional<GridIndex> place = grid.Neighbour(index, joint, delta);
    if (!place) return ImageCache::Image();
    return cache.Get(grid.NumberOf(*place));
  };
  ASSIGN_OR_RETURN(const ImageCache::Image before, image_at(-1));
  ASSIGN_OR_RETURN(const ImageCache::Image after, image_at(1));
  if (before && after) return Witnesses{before, after, false};
  if (!before && !after) return std::optional<Witnesses>();
  ASSIGN_OR_RETURN(const ImageCache::Image beyond, image_at(before ? -2 : 2));
  if (!beyond) return std::optional<Witnesses>();
  return Witnesses{before ? before : after, beyond, true};
}

size_t DifferingPixels(const Mask& a, const Mask& b) {
  size_t count = 0;
  for (size_t i = 0; i < a.words().size(); ++i) {
    count += static_cast<size_t>(std::popcount(a.words()[i] ^ b.words()[i]));
  }
  return count;
}

bool IsUnlike(const Mask& mask, const Mask& first, const Mask& second, bool on_one_side,
              const OutlierSettings& settings) {
  const size_t area = std::max({mask.Count(), first.Count(), second.Count()});
  const double tolerance =
      std::max(settings.least_pixels, settings.least_share * static_cast<double>(area));
  size_t deviation = DifferingPixels(mask, first);
  size_t expected = DifferingPixels(first, second);
  if (on_one_side) {
    expected *= 2;
  } else {
    deviation = std::min(deviation, DifferingPixels(mask, second));
  }
  return static_cast<double>(deviation) > static_cast<double>(expected) + tolerance;
}

class OutlierSearch {
 public:
  OutlierSearch(const Snapshot& snapshot, const ConfigurationGrid& grid,
                const OutlierSettings& settings)
      : grid_(grid), settings_(settings), cache_(snapshot) {}

  absl::Status Look(ConfigurationNumber number, absl::StatusOr<RobotImage> read) {
    if (!read.ok()) {
      outliers_.push_back({number, OutlierReason::kDamaged, -1});
      return absl::OkStatus();
    }
    if (read->excluded) return absl::OkStatus();
    const auto image = cache_.Keep(number, std::make_shared<const RobotImage>(*std::move(read)));
    const GridIndex index = *grid_.IndexOf(number);
    std::vector<Witnesses> witnesses;
    for (int joint = 0; joint < grid_.dimensions(); ++joint) {
      ASSIGN_OR_RETURN(std::optional<Witnesses> found, WitnessesOf(grid_, index, joint, cache_));
      if (found) witnesses.push_back(*std::move(found));
    }
    for (size_t view = 0; view < image->masks.size(); ++view) {
      const auto report = [&](OutlierReason reason) {
        outliers_.push_back({number, reason, static_cast<int>(view)});
      };
      const Mask& mask = image->masks[view];
      if (mask.Empty()) {
        report(OutlierReason::kEmpty);
        continue;
      }
      if (TouchesBorder(mask)) report(OutlierReason::kTouchesBorder);
      const auto unlike =
          std::count_if(witnesses.begin(), witnesses.end(), [&](const Witnesses& each) {
            return IsUnlike(mask, each.first->masks[view], each.second->masks[view],
                            each.on_one_side, settings_);
          });
      if (2 * static_cast<size_t>(unlike) > witnesses.size()) {
        report(OutlierReason::kUnlikeNeighbours);
      }
    }
    return absl::OkStatus();
  }

  std::vector<Outlier> Take() { return std::move(outliers_); }

 private:
  const ConfigurationGrid& grid_;
  const OutlierSettings settings_;
  ImageCache cache_;
  std::vector<Outlier> outliers_;
};

}  // namespace

std::string NameOf(OutlierReason reason) {
  switch (reason) {
    case OutlierReason::kDamaged:
      return "damaged";
    case OutlierReason::kEmpty:
      return "empty";
    case OutlierReason::kTouchesBorder:
      return "touches-border";
    case OutlierReason::kUnlikeNeighbours:
      return "unlike-neighbours";
  }
  return "unknown";
}

absl::StatusOr<std::vector<Outlier>> FindOutliers(const Snapshot& snapshot,
                                                  const ConfigurationGrid& grid,
                                                  const OutlierSettings& settings,
                                                  const WorkProgress& progress) {
  OutlierSearch search(snapshot, grid, settings);
  absl::Status failure;
  uint64_t done = 0;
  const auto visit = [&](ConfigurationNumber number, absl::StatusOr<RobotImage> image) {
    failure = search.Look(number, std::move(image));
    if (failure.ok() && progress && !progress(++done)) failure = absl::CancelledError("stopped");
    return failure.ok();
  };
  RETURN_IF_ERROR(snapshot.ForEach(visit));
  if (!failure.ok()) return failure;
  return search.Take();
}

}  // namespace silhouette
