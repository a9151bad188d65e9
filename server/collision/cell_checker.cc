// SPDX-License-Identifier: Apache-2.0
#include "server/collision/cell_checker.h"

#include <algorithm>
#include <bit>
#include <vector>

#include "server/collision/robot_image_table.h"

namespace silhouette {

CellChecker::CellChecker(const SpaceChecker& test) : test_(test), sets_(1) {
  bool beyond = false;
  ForAllVotes([&](const PlaneVotes& votes) {
    sets_ += votes.views();
    beyond = beyond || votes.beyond();
  });
  // Something is possible at any place off the grid, unless the body is known.
  const bool always = test.everything_possible_;
  const bool body = test.test_.robot_may_touch_ != nullptr;
  const bool complete = test.test_.missing_views_ == 0;
  none_free_ = always || !complete;
  exact_ = complete &&
           (always ? !test.test_.voxels_decide_ && !body : test.possible_.empty() && !beyond);
}

template <typename Each>
void CellChecker::ForAllVotes(const Each& each) const {
  for (const PlaneVotes& votes : test_.occupied_) each(votes);
  for (const PlaneVotes& votes : test_.possible_) each(votes);
  for (const PlaneVotes& votes : test_.witnesses_) each(votes);
}

uint64_t CellChecker::MayTouch(const TileIndex* index) const {
  if (index == nullptr || sets_ > 65) return ~uint64_t{0};
  uint64_t may_touch = 0;
  uint64_t bit = 1;
  ForAllVotes([&](const PlaneVotes& votes) {
    for (size_t i = 0; i < votes.views(); ++i, bit <<= 1) {
      if (votes.AnyTouchesIn(i, *index)) may_touch |= bit;
    }
  });
  return may_touch;
}

bool CellChecker::MayBeOccupied(uint64_t may_touch) const {
  if (sets_ > 65) return true;
  const auto next = [&may_touch](const PlaneVotes& votes) {
    int touching = 0;
    for (size_t i = 0; i < votes.views(); ++i, may_touch >>= 1) touching += may_touch & 1 ? 1 : 0;
    return votes.IsEnough(touching);
  };
  bool occupied = false;
  for (const PlaneVotes& votes : test_.occupied_) occupied |= next(votes);
  bool possible = false;
  for (const PlaneVotes& votes : test_.possible_) possible |= next(votes);
  for (const PlaneVotes& votes : test_.witnesses_) possible &= next(votes);
  return occupied || possible;
}

bool CellChecker::LookUp(uint64_t tile, const TileIndex* index, bool judged_only,
                         std::span<PlaceSet> sets) const {
  const PlaceSet& present = table().present(tile);
  for (size_t word = 0; word < PlaceSet::kWords; ++word) {
    const uint64_t known = index != nullptr ? index->present().words[word] : ~uint64_t{0};
    sets[0].words[word] = ~(present.words[word] & known);
  }
  if (index == nullptr) return LookAtImages(tile, sets);
  if (judged_only) {
    std::fill(sets.begin() + 1, sets.end(), PlaceSet());
    return true;
  }
  size_t at = 1;
  ForAllVotes([&](const PlaneVotes& votes) {
    for (size_t i = 0; i < votes.views(); ++i) sets[at++] = votes.TouchingIn(i, *index);
  });
  return true;
}

bool CellChecker::LookAtImages(uint64_t tile, std::span<PlaceSet> sets) const {
  std::fill(sets.begin() + 1, sets.end(), PlaceSet());
  TestRobot robot;
  bool all_read = true;
  const PlaceSet& present = table().present(tile);
  for (size_t word = 0; word < PlaceSet::kWords; ++word) {
    for (uint64_t left = present.words[word]; left != 0; left &= left - 1) {
      const uint64_t place = 64 * word + static_cast<uint64_t>(std::countr_zero(left));
      const ConfigurationNumber number = tile * kTileSize + place;
      if (!robot.Take(table(), {&number, 1})) {
        sets[0].Insert(place);
        all_read = false;
        continue;
      }
      size_t at = 1;
      ForAllVotes([&](const PlaneVotes& votes) {
        for (size_t i = 0; i < votes.views(); ++i, ++at) {
          if (votes.TouchesIn(i, robot.Words(votes.view(i), {}))) sets[at].Insert(place);
        }
      });
    }
  }
  return all_read;
}

PlaceSet CellChecker::Free(std::span<const PlaceSet> sets) const {
  std::span<const PlaceSet> left = sets.subspan(1);
  const auto next = [&left](const PlaneVotes& votes) {
    const std::span<const PlaceSet> touching = left.first(votes.views());
    left = left.subspan(votes.views());
    return votes.InEnough(touching);
  };
  PlaceSet occupied;
  for (const PlaneVotes& votes : test_.occupied_) occupied |= next(votes);
  PlaceSet possible;
  for (const PlaneVotes& votes : test_.possible_) possible |= next(votes);
  for (const PlaneVotes& votes : test_.witnesses_) possible &= next(votes);
  PlaceSet free;
  for (size_t word = 0; word < PlaceSet::kWords; ++word) {
    free.words[word] = ~(sets[0].words[word] | occupied.words[word] | possible.words[word]);
  }
  return free;
}

}  // namespace silhouette
