// SPDX-License-Identifier: Apache-2.0
#include "server/collision/robot_image_table.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "calib/robot/drawing/drawn_places.h"

namespace silhouette {

RobotImageTable::RobotImageTable(ConfigurationGrid grid, std::vector<MaskSize> mask_sizes)
    : grid_(std::move(grid)), mask_sizes_(std::move(mask_sizes)), images_(mask_sizes_.size()) {
  if (mask_sizes_.empty()) throw std::invalid_argument("there must be at least one view");
  if (grid_.number_limit() >= kFirstMark) {
    throw std::invalid_argument("the grid has too many configurations to hold in memory");
  }
  for (const MaskSize size : mask_sizes_) {
    if (!size.valid()) throw std::invalid_argument("a view's mask size is not valid");
    words_ += size.words();
  }
}

namespace {

std::vector<MaskSize> SizesOf(const std::shared_ptr<const DrawnRobot>& robot) {
  if (robot == nullptr) throw std::invalid_argument("there must be a robot to draw");
  std::vector<MaskSize> sizes;
  for (const PartDrawer& view : robot->views()) sizes.push_back(view.size());
  return sizes;
}

// Whether no joint moves a link.
bool IsFixed(const KinematicChain& chain, size_t link) {
  for (int at = static_cast<int>(link); at >= 0;
       at = chain.links()[static_cast<size_t>(at)].parent) {
    if (chain.links()[static_cast<size_t>(at)].joint >= 0) return false;
  }
  return true;
}

}  // namespace

RobotImageTable RobotImageTable::Drawn(ConfigurationGrid grid,
                                       std::shared_ptr<const DrawnRobot> robot,
                                       JointRegions forbidden) {
  RobotImageTable table(std::move(grid), SizesOf(robot));
  RequireDrawnPlaces(robot->chain(), table.grid_, forbidden);
  if (table.grid_.has_any()) {
    const auto as = [&](DrawnKind kind) {
      return std::make_shared<const DrawnRobot>(AsKind(*robot, table.grid_, kind));
    };
    table.own_ = as(DrawnKind::kOwn);
    table.reach_ = as(DrawnKind::kReach);
  }
  table.drawn_ = std::move(robot);
  table.forbidden_ = std::move(forbidden);
  table.present_sets_.resize(1);
  table.counts_[static_cast<size_t>(RobotImageState::kPresent)] = table.grid_.size();
  table.permanent_ = table.DrawnFixedParts();
  for (const MaskSize size : table.mask_sizes_) table.covered_.push_back(~Mask(size));
  return table;
}

std::vector<Mask> RobotImageTable::DrawnFixedParts() const {
  std::vector<Eigen::Isometry3d> base_from_link;
  drawn_->chain().Pose(grid_.At(GridIndex{}), base_from_link);
  DrawingScratch scratch;
  std::vector<Mask> masks;
  for (const PartDrawer& view : drawn_->views()) {
    std::vector<uint64_t> words(view.size().words());
    for (size_t i = 0; i < drawn_->parts().size(); ++i) {
      const RobotPart& part = drawn_->parts()[i];
      if (!IsFixed(drawn_->chain(), part.moves_with)) continue;
      view.AddTouched(base_from_link[part.moves_with], part.points, drawn_->edges()[i], part.radius,
                      scratch, words);
    }
    masks.push_back(Mask::FromWords(view.size(), std::move(words)));
  }
  return masks;
}

RobotImageState RobotImageTable::DrawnState(ConfigurationNumber number) const {
  const std::optional<GridIndex> index = grid_.IndexOf(number);
  if (!index) return RobotImageState::kMissing;
  if (forbidden_.empty()) return RobotImageState::kPresent;
  const Configuration q = grid_.At(*index);
  if (!has_nodes()) return StateBetween(q, q);
  return IsForbiddenNear(q) ? RobotImageState::kExcluded : RobotImageState::kPresent;
}

bool RobotImageTable::IsForbiddenNear(const Configuration& q) const {
  const NodeCell cell = CellOf(grid_, q);
  return forbidden_.Between(cell.from, cell.to).has_value();
}

RobotImageState RobotImageTable::StateBetween(std::span<const double> from,
                                              std::span<const double> to) const {
  switch (DrawnPlaceBetween(drawn_->chain(), grid_, forbidden_, from, to)) {
    case DrawnPlace::kOpen:
      return RobotImageState::kPresent;
    case DrawnPlace::kForbidden:
      return RobotImageState::kExcluded;
    case DrawnPlace::kOutside:
      break;
  }
  return RobotImageState::kMissing;
}

void RobotImageTable::Draw(std::span<const double> q, Growth growth,
                           std::span<uint64_t> words) const {
  DrawRobot(*drawn_, q, growth, words);
}

void RobotImageTable::DrawNode(DrawnKind kind, ConfigurationNumber number,
                               std::span<uint64_t> words) const {
  if (!has_nodes() || kind == DrawnKind::kWhole) {
    throw std::invalid_argument("there is no such image of a node");
  }
  DrawRobot(*node_robot(kind), grid_.At(number), {}, words);
}

void RobotImageTable::DrawRobot(const DrawnRobot& robot, std::span<const double> q, Growth growth,
                                std::span<uint64_t> words) const {
  thread_local DrawingScratch scratch;
  thread_local std::vector<Eigen::Isometry3d> base_from_link;
  robot.chain().Pose(q, base_from_link);
  std::ranges::fill(words, uint64_t{0});
  for (size_t view = 0; view < mask_sizes_.size(); ++view) {
    const size_t count = mask_sizes_[view].words();
    robot.AddTouched(view, base_from_link, growth, scratch, words.first(count));
    words = words.subspan(count);
  }
}

bool RobotImageTable::Read(ConfigurationNumber number, std::span<uint64_t> words) const {
  if (reader_ != nullptr) return reader_(number, words);
  if (drawn_ != nullptr) {
    if (has_nodes()) return false;
    try {
      Draw(grid_.At(number), {}, words);
      return true;
    } catch (const std::exception&) {
      return false;
    }
  }
  auto to = words.begin();
  for (int view = 0; view < views(); ++view) to = std::ranges::copy(image(view, number), to).out;
  return true;
}

std::vector<Mask> RobotImageTable::MasksOf(std::span<const uint64_t> words) const {
  std::vector<Mask> masks;
  for (const MaskSize size : mask_sizes_) {
    const MaskWords own = words.first(size.words());
    masks.push_back(Mask::FromWords(size, {own.begin(), own.end()}));
    words = words.subspan(size.words());
  }
  return masks;
}

std::optional<std::vector<Mask>> RobotImageTable::Images(ConfigurationNumber number) const {
  std::vector<uint64_t> words(words_);
  if (state(number) != RobotImageState::kEmpty && !Read(number, words)) return std::nullopt;
  return MasksOf(words);
}

uint64_t RobotImageTable::Count(RobotImageState state) const {
  if (state != RobotImageState::kMissing) return counts_[static_cast<size_t>(state)];
  return grid_.size() - std::accumulate(counts_.begin(), counts_.end(), uint64_t{0});
}

RobotImageTable::Builder::Builder(ConfigurationGrid grid, std::vector<MaskSize> mask_sizes,
                                  uint64_t expected, JointRegions forbidden)
    : table_(std::move(grid), std::move(mask_sizes)), covered_(table_.words_, 0) {
  HoldNothing(std::move(forbidden));
  for (size_t view = 0; view < table_.images_.size(); ++view) {
    table_.images_[view].reserve(expected * table_.mask_sizes_[view].words());
  }
}

RobotImageTable::Builder::Builder(ConfigurationGrid grid, std::vector<MaskSize> mask_sizes,
                                  Reader reader, JointRegions forbidden)
    : table_(std::move(grid), std::move(mask_sizes)), covered_(table_.words_, 0) {
  HoldNothing(std::move(forbidden));
  if (reader == nullptr) throw std::invalid_argument("there must be a reader");
  table_.reader_ = std::move(reader);
}

void RobotImageTable::Builder::HoldNothing(JointRegions forbidden) {
  if (table_.grid_.has_any()) {
    throw std::invalid_argument(
        "the grid has a joint with one value that stands for any, which no captured robot image "
        "does; such robot images are drawn");
  }
  if (!forbidden.Fits(table_.grid_.joints().size())) {
    throw std::invalid_argument("a forbidden region bounds a joint that the grid does not have");
  }
  table_.forbidden_ = std::move(forbidden);
  table_.slots_.assign(table_.grid_.number_limit(), kFirstMark);
  table_.present_sets_.resize(table_.grid_.tiles());
}

void RobotImageTable::Builder::RequireNew(ConfigurationNumber number) const {
  if (!table_.grid_.Contains(number)) {
    throw std::invalid_argument("configuration " + std::to_string(number) + " is not in the grid");
  }
  if (table_.state(number) != RobotImageState::kMissing) {
    throw std::invalid_argument("configuration " + std::to_string(number) + " was added twice");
  }
}

void RobotImageTable::Builder::Add(ConfigurationNumber number, std::span<const Mask> masks) {
  RequireNew(number);
  bool fit = masks.size() == table_.mask_sizes_.size();
  for (size_t view = 0; fit && view < masks.size(); ++view) {
    fit = masks[view].size() == table_.mask_sizes_[view];
  }
  if (!fit) {
    throw std::invalid_argument("the masks of configuration " + std::to_string(number) +
                                " do not fit the views");
  }
  std::vector<uint64_t> words;
  words.reserve(table_.words_);
  for (const Mask& mask : masks) {
    words.insert(words.end(), mask.words().begin(), mask.words().end());
  }
  Add(number, words);
}

void RobotImageTable::Builder::Add(ConfigurationNumber number, std::span<const uint64_t> words) {
  RequireNew(number);
  if (words.size() != table_.words_) {
    throw std::invalid_argument("the masks of configuration " + std::to_string(number) +
                                " do not fit the views");
  }
  if (common_.empty()) common_.assign(words.begin(), words.end());
  for (size_t i = 0; i < words.size(); ++i) {
    common_[i] &= words[i];
    covered_[i] |= words[i];
  }
  if (table_.in_memory()) {
    std::span<const uint64_t> left = words;
    for (size_t view = 0; view < table_.images_.size(); ++view) {
      const size_t count = table_.mask_sizes_[view].words();
      table_.images_[view].insert(table_.images_[view].end(), left.begin(),
                                  left.begin() + static_cast<std::ptrdiff_t>(count));
      left = left.subspan(count);
    }
  }
  uint64_t& present = table_.counts_[static_cast<size_t>(RobotImageState::kPresent)];
  table_.slots_[number] = static_cast<uint32_t>(present++);
  table_.present_sets_[number / kTileSize].Insert(number % kTileSize);
}

void RobotImageTable::Builder::AddWithout(ConfigurationNumber number, RobotImageState state) {
  RequireNew(number);
  if (state == RobotImageState::kPresent || state == RobotImageState::kMissing) {
    throw std::invalid_argument("that a robot image is not usable has a reason");
  }
  table_.slots_[number] = kFirstMark + static_cast<uint32_t>(state);
  ++table_.counts_[static_cast<size_t>(state)];
}

void RobotImageTable::Builder::Forbid() {
  for (ConfigurationNumber number = 0; number < table_.slots_.size(); ++number) {
    const std::optional<GridIndex> index = table_.grid_.IndexOf(number);
    if (!index) continue;
    const Configuration q = table_.grid_.At(*index);
    if (!table_.IsForbiddenNear(q)) continue;
    PlaceSet place;
    place.Insert(number % kTileSize);
    table_.present_sets_[number / kTileSize] -= place;
    if (table_.forbidden_.Between(q, q)) Exclude(number);
  }
}

void RobotImageTable::Builder::Exclude(ConfigurationNumber number) {
  const RobotImageState state = table_.state(number);
  if (state == RobotImageState::kExcluded) return;
  if (state != RobotImageState::kMissing) --table_.counts_[static_cast<size_t>(state)];
  ++table_.counts_[static_cast<size_t>(RobotImageState::kExcluded)];
  // Scenes, and places beside the region, need what was captured.
  if (state == RobotImageState::kPresent || state == RobotImageState::kEmpty) return;
  table_.slots_[number] = kFirstMark + static_cast<uint32_t>(RobotImageState::kExcluded);
}

RobotImageTable RobotImageTable::Builder::Build() && {
  if (!table_.forbidden_.empty()) Forbid();
  common_.resize(table_.words_, 0);
  table_.permanent_ = table_.MasksOf(common_);
  table_.covered_ = table_.MasksOf(covered_);
  return std::move(table_);
}

bool TestRobot::Take(const RobotImageTable& table, std::span<const ConfigurationNumber> corners) {
  table_ = &table;
  corners_ = corners;
  if (table.in_memory()) return true;
  united_.resize(table.words());
  if (!table.Read(corners.front(), united_)) return false;
  read_.resize(table.words());
  for (const ConfigurationNumber corner : corners.subspan(1)) {
    if (!table.Read(corner, read_)) return false;
    for (size_t i = 0; i < united_.size(); ++i) united_[i] |= read_[i];
  }
  return true;
}

bool TestRobot::Draw(const RobotImageTable& table, std::span<const double> q, Growth growth) {
  table_ = &table;
  corners_ = {};
  united_.resize(table.words());
  try {
    table.Draw(q, growth, united_);
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

void TestRobot::DrawNode(const RobotImageTable& table, DrawnKind kind, ConfigurationNumber number) {
  table_ = &table;
  corners_ = {};
  united_.resize(table.words());
  table.DrawNode(kind, number, united_);
}

TestRobot::View TestRobot::view(int view) const {
  View result;
  if (!table_->in_memory()) {
    size_t before = 0;
    for (const MaskSize size : table_->mask_sizes().first(static_cast<size_t>(view))) {
      before += size.words();
    }
    result.images_[0] = united_.data() + before;
    return result;
  }
  result.count_ = corners_.size();
  for (size_t i = 0; i < corners_.size(); ++i) {
    result.images_[i] = table_->image(view, corners_[i]).data();
  }
  return result;
}

MaskWords TestRobot::Words(int view, std::span<uint64_t> room) const {
  const View robot = this->view(view);
  const size_t count = table_->mask_sizes()[static_cast<size_t>(view)].words();
  if (robot.count_ == 1) return {robot.images_[0], count};
  for (size_t i = 0; i < count; ++i) room[i] = robot[i];
  return room.first(count);
}

std::string WhyNoMotionShows(const std::string& view, const Mask& any, const Mask& every,
                             uint64_t images) {
  constexpr uint64_t kMany = 10;  // fewer may be neighbours, with the same masks
  const bool empty = any.Count() == 0;
  if (images == 0 || (!empty && (images < kMany || any != every))) return "";
  return "the view '" + view + "' shows " +
         (empty ? "no robot in any" : "the robot in the same pixels in each") + " of " +
         std::to_string(images) +
         " robot images, so that no obstacle there would count: aim the camera at the robot and "
         "capture again, import the right masks, or leave the view out of the cell";
}

}  // namespace silhouette
