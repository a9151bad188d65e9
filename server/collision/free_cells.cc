// SPDX-License-Identifier: Apache-2.0
#include "server/collision/free_cells.h"

#include <algorithm>
#include <bit>
#include <utility>

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

FreeCells::FreeCells(const SpaceChecker& test, IndexOf index_of)
    : test_(test), index_of_(std::move(index_of)) {
  const ConfigurationGrid& grid = test_.grid();
  for (int joint = 0; joint < grid.dimensions(); ++joint) joints_.emplace_back(grid, joint);
  while (across_ + 1 < joints_.size() && joints_[across_].tiles() == 1) ++across_;
  slab_tiles_ = joints_[across_].stride();
  left_ = joints_[across_].tiles();
  tiles_.resize(grid.tiles());
  ready_ = std::make_unique<std::atomic<bool>[]>(grid.tiles());
}

bool FreeCells::WorkOut(std::span<const uint64_t> tiles, const Stop& stop) {
  for (const uint64_t tile : tiles) {
    if (test_.none_free()) ready_[tile].store(true, std::memory_order_release);
    while (!ready(tile)) {
      if (Stopped(stop)) return false;
      const std::lock_guard lock(mutex_);
      if (!ready(tile)) Step(tile / slab_tiles_);
    }
  }
  return true;
}

bool FreeCells::Surveyed() {
  if (!needed_.empty()) return true;
  constexpr size_t kAtOnce = 64;
  const size_t end = std::min(tiles_.size(), may_touch_.size() + kAtOnce);
  may_touch_.reserve(tiles_.size());
  while (may_touch_.size() < end) {
    may_touch_.push_back(test_.MayTouch(index_of_(may_touch_.size())));
  }
  if (end < tiles_.size()) return false;
  for (const JointStep& joint : joints_) {
    const uint64_t last = (joint.tiles() - 1) * joint.stride();
    for (uint64_t begin = 0; begin < tiles_.size(); ++begin) {
      if (joint.PlaceOf(begin) != 0) continue;
      const uint64_t first = joint.wraps() ? may_touch_[begin] : 0;
      for (uint64_t at = 0; at < last; at += joint.stride()) {
        may_touch_[begin + at] |= may_touch_[begin + at + joint.stride()];
      }
      may_touch_[begin + last] |= first;
    }
  }
  std::vector<uint8_t> needed;
  for (const uint64_t may_touch : may_touch_) needed.push_back(test_.MayBeOccupied(may_touch));
  for (const JointStep& joint : joints_) {
    const uint64_t last = (joint.tiles() - 1) * joint.stride();
    for (uint64_t begin = 0; begin < tiles_.size(); ++begin) {
      if (joint.PlaceOf(begin) != 0) continue;
      const uint8_t round = joint.wraps() ? needed[begin + last] : uint8_t{0};
      for (uint64_t at = last; at > 0; at -= joint.stride()) {
        needed[begin + at] |= needed[begin + at - joint.stride()];
      }
      needed[begin] |= round;
    }
  }
  needed_ = std::move(needed);
  may_touch_ = {};
  return false;
}

void FreeCells::Step(uint64_t slab) {
  if (!Surveyed()) return;
  if (working_ == kNone) working_ = slab;
  const JointStep& joint = joints_[across_];
  const uint64_t after = working_ + 1 < joint.tiles() ? working_ + 1 : 0;
  Slab& held = Hold(working_, after);
  if (!Prepared(held)) return;
  Slab& next = Hold(after, working_);
  const bool takes_next = after != 0 || joint.wraps();
  if (takes_next && !Prepared(next)) return;
  Finish(held, next, finished_);
  if (++finished_ < slab_tiles_) return;
  working_ = kNone;
  finished_ = 0;
  if (--left_ > 0) return;
  slabs_ = {};
  scratch_ = {};
}

FreeCells::Slab& FreeCells::Hold(uint64_t number, uint64_t other) {
  for (Slab& slab : slabs_) {
    if (slab.number == number) return slab;
  }
  Slab& slab = slabs_[0].number == other && other != kNone ? slabs_[1] : slabs_[0];
  slab.number = number;
  slab.looked_up = 0;
  slab.spread = 0;
  return slab;
}

bool FreeCells::Prepared(Slab& slab) {
  const size_t sets = test_.sets();
  if (slab.looked_up < slab_tiles_) {
    slab.sets.resize(slab_tiles_ * sets);
    slab.something.resize(slab_tiles_ * sets);
    const uint64_t tile = slab.number * slab_tiles_ + slab.looked_up;
    const size_t first = slab.looked_up * sets;
    const std::span<PlaceSet> looked_up = std::span(slab.sets).subspan(first, sets);
    const bool judged_only = needed_[tile] == 0;
    if (!test_.LookUp(tile, index_of_(tile), judged_only, looked_up)) all_read_.store(false);
    for (size_t i = 0; i < sets; ++i) slab.something[first + i] = looked_up[i].Empty() ? 0 : 1;
    ++slab.looked_up;
    return false;
  }
  while (slab.spread < static_cast<int>(joints_.size())) {
    const auto joint = static_cast<size_t>(slab.spread++);
    if (joint == across_) continue;
    Spread(slab, joints_[joint]);
    return false;
  }
  return true;
}

void FreeCells::Spread(Slab& slab, const JointStep& joint) {
  const size_t sets = test_.sets();
  const uint64_t last = joint.tiles() - 1;
  for (uint64_t begin = 0; begin < slab_tiles_; ++begin) {
    if (joint.PlaceOf(begin) != 0) continue;
    for (size_t i = 0; i < sets; ++i) {
      const size_t row = begin * sets + i;
      const size_t step = joint.stride() * sets;
      const PlaceSet first = slab.sets[row];
      const uint8_t first_something = slab.something[row];
      for (uint64_t at = 0; at <= last; ++at) {
        const size_t here = row + at * step;
        const bool more = at < last;
        uint8_t& something = slab.something[here];
        something |= more ? slab.something[here + step] : joint.wraps() ? first_something : 0;
        if (something == 0) continue;
        joint.AddPlacesBefore(at, more ? slab.sets[here + step] : first, slab.sets[here]);
      }
    }
  }
}

void FreeCells::Finish(const Slab& slab, const Slab& next, uint64_t at) {
  const size_t sets = test_.sets();
  scratch_.resize(sets);
  const JointStep& joint = joints_[across_];
  for (size_t i = 0; i < sets; ++i) {
    const size_t place = at * sets + i;
    scratch_[i] = slab.sets[place];
    if (slab.something[place] == 0 && (next.something.empty() || next.something[place] == 0)) {
      continue;
    }
    joint.AddPlacesBefore(slab.number, next.sets.empty() ? scratch_[i] : next.sets[place],
                          scratch_[i]);
  }
  const uint64_t tile = slab.number * slab_tiles_ + at;
  tiles_[tile] = test_.Free(scratch_);
  ready_[tile].store(true, std::memory_order_release);
}

}  // namespace silhouette
