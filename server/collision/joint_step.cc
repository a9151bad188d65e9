#include "server/collision/joint_step.h"

#include <bit>

namespace silhouette {
namespace {

constexpr size_t kWords = PlaceSet::kWords;

// Adds to `set` what is in `mask` of the places `by` before its own. Upwards: what is read has not
// been changed yet.
void AddShiftedDown(uint64_t by, const PlaceSet& mask, PlaceSet& set) {
  uint64_t* words = set.words.data();
  const size_t skip = by / 64;
  const auto bits = static_cast<int>(by % 64);
  if (bits == 0) {
    for (size_t i = 0; i + skip < kWords; ++i) words[i] |= words[i + skip] & mask.words[i];
    return;
  }
  size_t i = 0;
  for (; i + skip + 1 < kWords; ++i) {
    words[i] |= (words[i + skip] >> bits | words[i + skip + 1] << (64 - bits)) & mask.words[i];
  }
  words[i] |= words[i + skip] >> bits & mask.words[i];
}

// The same of places behind those of another set.
void AddShiftedUp(const PlaceSet& other, uint64_t by, const PlaceSet& mask, PlaceSet& set) {
  const uint64_t* from = other.words.data();
  uint64_t* words = set.words.data() + by / 64;
  const uint64_t* masks = mask.words.data() + by / 64;
  const size_t count = kWords - by / 64;
  const auto bits = static_cast<int>(by % 64);
  words[0] |= from[0] << bits & masks[0];
  if (bits == 0) {
    for (size_t i = 1; i < count; ++i) words[i] |= from[i] & masks[i];
  } else {
    for (size_t i = 1; i < count; ++i) {
      words[i] |= (from[i] << bits | from[i - 1] >> (64 - bits)) & masks[i];
    }
  }
}

}  // namespace

JointStep::JointStep(const ConfigurationGrid& grid, int joint) {
  const auto tiles_along = [&](int j) {
    const auto edge = static_cast<uint64_t>(grid.tile_edges()[static_cast<size_t>(j)]);
    return (static_cast<uint64_t>(grid.joints()[static_cast<size_t>(j)].steps) + edge - 1) / edge;
  };
  for (int j = joint + 1; j < grid.dimensions(); ++j) {
    stride_ *= tiles_along(j);
    step_ *= static_cast<uint64_t>(grid.tile_edges()[static_cast<size_t>(j)]);
  }
  tiles_ = tiles_along(joint);
  edge_ = static_cast<uint64_t>(grid.tile_edges()[static_cast<size_t>(joint)]);
  const GridJoint& along = grid.joints()[static_cast<size_t>(joint)];
  wraps_ = along.continuous;
  inner_ = WayWhere(edge_ - 1, true);
  last_ = WayWhere(static_cast<uint64_t>(along.steps - 1) % edge_, wraps_);
}

// In a tile that has values 0 to `last` of the joint; `goes_on`: another follows on the last one.
JointStep::Way JointStep::WayWhere(uint64_t last, bool goes_on) const {
  Way way;
  const int step_bits = std::countr_zero(step_);
  for (uint64_t place = 0; place < kTileSize; ++place) {
    const uint64_t value = (place >> step_bits) & (edge_ - 1);
    const uint64_t bit = uint64_t{1} << (place % 64);
    way.within.words[place / 64] |= value < last ? bit : 0;
    way.across.words[place / 64] |= value == last && goes_on ? bit : 0;
  }
  way.some_within = !way.within.Empty();
  way.some_across = !way.across.Empty();
  way.back = last * step_;
  return way;
}

void JointStep::AddPlacesBefore(uint64_t at, const PlaceSet& next, PlaceSet& set) const {
  const Way& way = at + 1 == tiles_ ? last_ : inner_;
  if (way.some_within) AddShiftedDown(step_, way.within, set);
  if (way.some_across) AddShiftedUp(next, way.back, way.across, set);
}

}  // namespace silhouette
