#include "server/collision/joint_step.h"

#include <algorithm>
#include <array>

namespace silhouette {
namespace {

constexpr size_t kWords = PlaceSet::kWords;

using Words = std::array<uint64_t, kWords>;

// Adds to `out` what is in `mask` of the places `by` before those of `in`. All loops are over
// memory that is the function's own: they become vectors.
void AddShiftedDown(const PlaceSet& in, uint64_t by, const PlaceSet& mask, PlaceSet& out) {
  alignas(64) uint64_t padded[kWords + kWords / 2 + 1];
  std::copy(in.words.begin(), in.words.end(), padded);
  std::fill(std::begin(padded) + kWords, std::end(padded), 0);
  const uint64_t* from = padded + by / 64;
  const auto bits = static_cast<int>(by % 64);
  alignas(64) Words shifted;
  for (size_t i = 0; i < kWords; ++i) shifted[i] = from[i] >> bits;
  if (bits != 0) {
    for (size_t i = 0; i < kWords; ++i) shifted[i] |= from[i + 1] << (64 - bits);
  }
  for (size_t i = 0; i < kWords; ++i) shifted[i] &= mask.words[i];
  for (size_t i = 0; i < kWords; ++i) out.words[i] |= shifted[i];
}

// The same, places behind them.
void AddShiftedUp(const PlaceSet& in, uint64_t by, const PlaceSet& mask, PlaceSet& out) {
  alignas(64) uint64_t padded[2 * kWords + 8];
  std::fill(std::begin(padded), std::begin(padded) + kWords + 8, 0);
  std::copy(in.words.begin(), in.words.end(), padded + kWords + 8);
  const uint64_t* from = padded + kWords + 8 - by / 64;
  const auto bits = static_cast<int>(by % 64);
  alignas(64) Words shifted;
  for (size_t i = 0; i < kWords; ++i) shifted[i] = from[i] << bits;
  if (bits != 0) {
    const uint64_t* before = from - 1;
    for (size_t i = 0; i < kWords; ++i) shifted[i] |= before[i] >> (64 - bits);
  }
  for (size_t i = 0; i < kWords; ++i) shifted[i] &= mask.words[i];
  for (size_t i = 0; i < kWords; ++i) out.words[i] |= shifted[i];
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
  for (uint64_t place = 0; place < kTileSize; ++place) {
    const uint64_t value = place / step_ % edge_;
    if (value < last) way.within.Insert(place);
    if (value == last && goes_on) way.across.Insert(place);
  }
  way.some_within = !way.within.Empty();
  way.some_across = !way.across.Empty();
  way.back = last * step_;
  return way;
}

void JointStep::AddPlacesBefore(uint64_t at, const PlaceSet& next, PlaceSet& set) const {
  const Way& way = at + 1 == tiles_ ? last_ : inner_;
  const PlaceSet own = set;
  if (way.some_across) AddShiftedUp(next, way.back, way.across, set);
  if (way.some_within) AddShiftedDown(own, step_, way.within, set);
}

}  // namespace silhouette
