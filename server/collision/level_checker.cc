// SPDX-License-Identifier: Apache-2.0
#include "server/collision/level_checker.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>

namespace silhouette {
namespace {

// The greatest squared distance whose PixelsOf is not above the level.
uint32_t SquaredOf(double level) {
  constexpr uint32_t kMost = DistanceImage::kInfinite - 1;
  if (level >= PixelsOf(kMost)) return kMost;
  auto squared = static_cast<uint32_t>(level * level);
  while (PixelsOf(squared + 1) <= level) ++squared;
  while (squared > 0 && PixelsOf(squared) > level) --squared;
  return squared;
}

CollisionImages Within(const DistanceImages& distances, uint32_t squared) {
  CollisionImages planes(distances.size());
  for (size_t view = 0; view < planes.size(); ++view) {
    if (distances[view]) planes[view] = distances[view]->Within(squared);
  }
  return planes;
}

}  // namespace

void RequireLevels(std::span<const double> levels) {
  if (levels.empty()) throw std::invalid_argument("there must be a clearance level");
  for (size_t i = 0; i < levels.size(); ++i) {
    if (!(levels[i] >= 0) || !std::isfinite(levels[i])) {
      throw std::invalid_argument("a clearance level must be finite, and 0 or more");
    }
    if (i > 0 && !(levels[i - 1] < levels[i])) {
      throw std::invalid_argument("clearance levels must ascend");
    }
  }
}

LevelChecker::LevelChecker(const ClearanceMeter& meter, std::span<const double> levels,
                           std::span<const PixelTree> trees)
    : meter_(meter) {
  RequireLevels(levels);
  for (const double level : levels) squared_.push_back(SquaredOf(level));
  if (trees.empty()) return;
  levels_.resize(levels.size());
  if (meter.possible_space_ != nullptr) {
    AddParts(trees);
  } else {
    AddDecidingPlanes(trees);
    if (meter.searched_bands_ != nullptr) BoundLines(trees);
  }
}

void LevelChecker::AddDecidingPlanes(std::span<const PixelTree> trees) {
  for (size_t i = 0; i < levels_.size(); ++i) {
    levels_[i].reached.emplace_back(trees, Within(meter_.distances_, squared_[i]),
                                    meter_.test_.min_views());
  }
}

void LevelChecker::AddParts(std::span<const PixelTree> trees) {
  for (const PossibleSpace::Part& part : meter_.possible_space_->parts()) {
    const DistanceImages distances = DistancesTo(part.planes);
    for (size_t i = 0; i < levels_.size(); ++i) {
      levels_[i].reached.emplace_back(trees, Within(distances, squared_[i]),
                                      meter_.test_.min_views(), part.beyond);
    }
  }
}

// A view shows an obstacle only by a pixel other than background, and only if some view has an
// obstacle pixel (SpaceChecker).
void LevelChecker::BoundLines(std::span<const PixelTree> trees) {
  CollisionImages something(meter_.obstacle_images_.size());
  for (size_t view = 0; view < something.size(); ++view) {
    const std::optional<ObstacleImage>& image = meter_.obstacle_images_[view];
    if (image) something[view] = ~image->Background();
  }
  const DistanceImages to_something = DistancesTo(something);
  const DistanceImages to_witness = DistancesTo(ObstaclePlanes(meter_.obstacle_images_));
  for (size_t i = 0; i < levels_.size(); ++i) {
    std::vector<PlaneVotes>& perhaps = levels_[i].perhaps;
    perhaps.emplace_back(trees, Within(to_something, squared_[i]), meter_.test_.min_views());
    perhaps.emplace_back(trees, Within(to_witness, squared_[i]), 1);
  }
}

std::optional<std::vector<PlaceSet>> LevelChecker::Above(uint64_t tile, const TileIndex* index,
                                                         const PlaceSet& free,
                                                         const Stop& stop) const {
  std::vector<PlaceSet> above(squared_.size());
  if (index == nullptr || levels_.empty()) {
    if (!MeasureSingly(tile, free, stop, above)) return std::nullopt;
    return above;
  }
  PlaceSet left = free;
  PlaceSet open;
  for (size_t i = 0; i < levels_.size() && !left.Empty(); ++i) {
    for (const PlaneVotes& votes : levels_[i].reached) left -= votes.Touching(*index);
    above[i] = left;
    if (levels_[i].perhaps.empty()) continue;
    PlaceSet perhaps = left;
    for (const PlaneVotes& votes : levels_[i].perhaps) {
      if (!perhaps.Empty()) perhaps &= votes.Touching(*index);
    }
    above[i] -= perhaps;
    open |= perhaps;
  }
  if (!MeasureSingly(tile, open, stop, above)) return std::nullopt;
  return above;
}

bool LevelChecker::MeasureSingly(uint64_t tile, const PlaceSet& places, const Stop& stop,
                                 std::vector<PlaceSet>& above) const {
  for (size_t word = 0; word < PlaceSet::kWords; ++word) {
    for (uint64_t bits = places.words[word]; bits != 0; bits &= bits - 1) {
      if (Stopped(stop)) return false;
      const uint64_t place = 64 * word + static_cast<uint64_t>(std::countr_zero(bits));
      const Configuration q = meter_.test_.grid().At(tile * kTileSize + place);
      const size_t exceeded = meter_.CountExceeded(q, squared_);
      for (size_t i = 0; i < exceeded; ++i) above[i].Insert(place);
    }
  }
  return true;
}

}  // namespace silhouette
