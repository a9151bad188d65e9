// SPDX-License-Identifier: Apache-2.0
#include "server/collision/space_checker.h"

#include <algorithm>
#include <bit>
#include <stdexcept>

namespace silhouette {
namespace {

Nodes RootOf(const PixelTree& tree) {
  return {{static_cast<uint32_t>(tree.root() / 64), uint64_t{1} << (tree.root() % 64)}};
}

// `reached`: place j has what is in j + 1 of the sets so far, or more.
void AddVote(const PlaceSet& touching, std::span<PlaceSet> reached) {
  for (size_t j = reached.size() - 1; j > 0; --j) {
    PlaceSet both = reached[j - 1];
    both &= touching;
    reached[j] |= both;
  }
  reached[0] |= touching;
}

// Memory of the thread, empty sets.
std::span<PlaceSet> NoVotes(size_t needed) {
  thread_local std::vector<PlaceSet> reached;
  reached.assign(needed, PlaceSet());
  return reached;
}

}  // namespace

PlaneVotes::PlaneVotes(std::span<const PixelTree> trees, const CollisionImages& planes,
                       int min_views, const std::vector<bool>& beyond)
    : needed_(min_views) {
  if (planes.size() != trees.size()) throw std::invalid_argument("there is one plane per view");
  for (size_t i = 0; i < planes.size(); ++i) {
    if (!planes[i]) {
      --needed_;
      continue;
    }
    View& view = views_.emplace_back();
    view.view = static_cast<int>(i);
    view.plane = *planes[i];
    view.cover = trees[i].Cover(*planes[i]);
    view.beyond = !beyond.empty() && beyond[i];
    if (view.beyond) view.root = RootOf(trees[i]);
  }
}

PlaceSet PlaneVotes::Touching(const TileIndex& index) const {
  if (needed_ <= 0) return index.present();
  const auto needed = static_cast<size_t>(needed_);
  // Views beyond those needed that touch none of the tile's robot images.
  const auto silent = static_cast<size_t>(std::ranges::count_if(views_, [&](const View& view) {
    return !view.beyond && !index.AnyTouches(view.view, view.cover);
  }));
  if (views_.size() - silent < needed) return {};
  const std::span<PlaceSet> reached = NoVotes(needed);
  for (size_t i = 0; i < views_.size(); ++i) AddVote(TouchingIn(i, index), reached);
  return reached.back();
}

PlaceSet PlaneVotes::TouchingIn(size_t i, const TileIndex& index) const {
  const View& view = views_[i];
  PlaceSet touching;
  index.AddTouching(view.view, view.cover, touching);
  if (!view.beyond) return touching;
  PlaceSet seen;
  index.AddTouching(view.view, view.root, seen);
  PlaceSet unseen = index.present();
  unseen -= seen;
  touching |= unseen;
  return touching;
}

bool PlaneVotes::AnyTouchesIn(size_t i, const TileIndex& index) const {
  return views_[i].beyond || index.AnyTouches(views_[i].view, views_[i].cover);
}

bool PlaneVotes::TouchesIn(size_t i, MaskWords robot_image) const {
  if (Intersects(views_[i].plane.words(), robot_image)) return true;
  return views_[i].beyond && NothingSet(robot_image);
}

PlaceSet PlaneVotes::InEnough(std::span<const PlaceSet> touching) const {
  PlaceSet all;
  all.words.fill(~uint64_t{0});
  if (needed_ <= 0) return all;
  if (touching.size() < static_cast<size_t>(needed_)) return {};
  const std::span<PlaceSet> reached = NoVotes(static_cast<size_t>(needed_));
  for (const PlaceSet& each : touching) AddVote(each, reached);
  return reached.back();
}

bool PlaneVotes::beyond() const {
  return std::ranges::any_of(views_, [](const View& view) { return view.beyond; });
}

SpaceChecker::SpaceChecker(const CollisionChecker& test, std::span<const PixelTree> trees)
    : test_(test) {
  if (test.possible_space_ != nullptr) {
    BoundPossibleSpace(trees);
    return;
  }
  CollisionImages shown(test.obstacle_images_.size());
  for (size_t view = 0; view < shown.size(); ++view) {
    if (!test.obstacle_images_[view]) continue;
    const MaskWords words = test.ShownBy(static_cast<int>(view));
    shown[view] =
        Mask::FromWords(test.obstacle_images_[view]->size(), {words.begin(), words.end()});
  }
  occupied_.emplace_back(trees, shown, test.min_views_);
  if (test.searched_bands_ != nullptr) BoundLines(trees);
}

// A view without an obstacle pixel in the intersection image convicts only by unknown or error
// pixels there, and only if some view has an obstacle pixel.
void SpaceChecker::BoundLines(std::span<const PixelTree> trees) {
  CollisionImages something(test_.obstacle_images_.size());
  CollisionImages witness(something.size());
  for (size_t view = 0; view < something.size(); ++view) {
    const std::optional<ObstacleImage>& image = test_.obstacle_images_[view];
    if (!image) continue;
    something[view] = ~image->Background();
    witness[view] = image->obstacle();
  }
  possible_.emplace_back(trees, something, test_.min_views_);
  witnesses_.emplace_back(trees, witness, 1);
}

void SpaceChecker::BoundPossibleSpace(std::span<const PixelTree> trees) {
  const PossibleSpace& space = *test_.possible_space_;
  std::vector<PlaneVotes>& votes = test_.voxels_decide_ ? possible_ : occupied_;
  for (const PossibleSpace::Part& part : space.parts()) {
    votes.emplace_back(trees, part.planes, test_.min_views_, part.beyond);
  }
  everything_possible_ = !space.always_met().Empty();
}

PlaceSet SpaceChecker::Occupied(const TileIndex& index) const {
  PlaceSet occupied;
  for (const PlaneVotes& votes : occupied_) occupied |= votes.Touching(index);
  return occupied;
}

PlaceSet SpaceChecker::Open(const TileIndex& index) const {
  PlaceSet open;
  if (everything_possible_) {
    open = index.present();
  } else {
    for (const PlaneVotes& votes : possible_) open |= votes.Touching(index);
  }
  for (const PlaneVotes& votes : witnesses_) {
    if (open.Empty()) break;
    open &= votes.Touching(index);
  }
  if (!open.Empty()) open -= Occupied(index);
  return open;
}

TileVerdicts SpaceChecker::CheckNodes(const TileIndex& own, const TileIndex& reach) const {
  if (!planes_decide() || test_.possible_space_ != nullptr) return {};
  PlaceSet present = own.present();
  present &= reach.present();
  PlaceSet occupied = Occupied(own);
  occupied &= present;
  TileVerdicts verdicts{.free = {}, .occupied = occupied.words};
  if (test_.missing_views_ == 0) {
    present -= occupied;
    present -= Occupied(reach);
    verdicts.free = present.words;
  }
  return verdicts;
}

PlaceSet SpaceChecker::Leaving(uint64_t tile, const PlaceSet& among) const {
  PlaceSet leaving;
  for (uint64_t place = 0; place < kTileSize; ++place) {
    if (!among.Contains(place)) continue;
    if (test_.LeavesWorkspace(test_.grid().At(tile * kTileSize + place), {})) leaving.Insert(place);
  }
  return leaving;
}

std::optional<TileVerdicts> SpaceChecker::CheckTile(uint64_t tile, const TileIndex& index,
                                                    const Stop& stop) const {
  PlaceSet present = index.present();
  if (test_.table_.drawn() == nullptr) present &= test_.table_.present(tile);
  PlaceSet occupied = Occupied(index);
  PlaceSet open = planes_decide() ? PlaceSet() : Open(index);
  open &= present;
  PlaceSet unread;
  for (size_t word = 0; word < PlaceSet::kWords; ++word) {
    for (uint64_t left = open.words[word]; left != 0; left &= left - 1) {
      if (Stopped(stop)) return std::nullopt;
      const uint64_t place = 64 * word + static_cast<uint64_t>(std::countr_zero(left));
      const State state = test_.StateOf(tile * kTileSize + place);
      if (state == State::kOccupied) occupied.Insert(place);
      if (state == State::kUnknown) unread.Insert(place);
    }
  }
  occupied &= present;
  if (test_.workspace_) unread |= Leaving(tile, present);
  present -= unread;
  TileVerdicts verdicts{.free = {}, .occupied = occupied.words};
  if (test_.missing_views_ == 0) {
    present -= occupied;
    verdicts.free = present.words;
  }
  return verdicts;
}

}  // namespace silhouette
