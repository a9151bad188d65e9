#include "server/collision/robot_image_table.h"

#include <stdexcept>
#include <string>
#include <utility>

namespace silhouette {

RobotImageTable::RobotImageTable(ConfigurationGrid grid, std::vector<MaskSize> mask_sizes,
                                 uint64_t expected)
    : grid_(std::move(grid)), mask_sizes_(std::move(mask_sizes)), images_(mask_sizes_.size()) {
  if (mask_sizes_.empty()) throw std::invalid_argument("there must be at least one view");
  if (grid_.number_limit() >= kFirstMark) {
    throw std::invalid_argument("the grid has too many configurations to hold in memory");
  }
  slots_.assign(grid_.number_limit(), kMissingMark);
  present_sets_.resize(grid_.tiles());
  for (size_t view = 0; view < mask_sizes_.size(); ++view) {
    if (!mask_sizes_[view].valid()) throw std::invalid_argument("a view's mask size is not valid");
    images_[view].reserve(expected * mask_sizes_[view].words());
  }
}

RobotImageState RobotImageTable::StateOfMark(uint32_t mark) {
  switch (mark) {
    case kExcludedMark:
      return RobotImageState::kExcluded;
    case kCorruptMark:
      return RobotImageState::kCorrupt;
    default:
      return RobotImageState::kMissing;
  }
}

Mask RobotImageTable::ImageAsMask(int view, ConfigurationNumber number) const {
  const MaskWords words = image(view, number);
  return Mask::FromWords(mask_sizes_[static_cast<size_t>(view)], {words.begin(), words.end()});
}

uint64_t RobotImageTable::Count(RobotImageState state) const {
  switch (state) {
    case RobotImageState::kPresent:
      return present_;
    case RobotImageState::kExcluded:
      return excluded_;
    case RobotImageState::kCorrupt:
      return corrupt_;
    case RobotImageState::kMissing:
      break;
  }
  return grid_.size() - present_ - excluded_ - corrupt_;
}

void RobotImageTable::FindPermanentPixels() {
  for (size_t view = 0; view < mask_sizes_.size(); ++view) {
    const size_t words = mask_sizes_[view].words();
    const std::vector<uint64_t>& images = images_[view];
    std::vector<uint64_t> common(words, 0);
    if (present_ > 0) common.assign(images.begin(), images.begin() + static_cast<int64_t>(words));
    for (size_t first = words; first < images.size(); first += words) {
      for (size_t i = 0; i < words; ++i) common[i] &= images[first + i];
    }
    permanent_.push_back(Mask::FromWords(mask_sizes_[view], std::move(common)));
  }
}

void RobotImageTable::Builder::RequireNew(ConfigurationNumber number) const {
  if (!table_.grid_.Contains(number)) {
    throw std::invalid_argument("configuration " + std::to_string(number) + " is not in the grid");
  }
  if (table_.slots_[number] != kMissingMark) {
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
  for (size_t view = 0; view < masks.size(); ++view) {
    const MaskWords words = masks[view].words();
    table_.images_[view].insert(table_.images_[view].end(), words.begin(), words.end());
  }
  table_.slots_[number] = static_cast<uint32_t>(table_.present_++);
  table_.present_sets_[number / kTileSize].Insert(number % kTileSize);
}

void RobotImageTable::Builder::AddExcluded(ConfigurationNumber number) {
  RequireNew(number);
  table_.slots_[number] = kExcludedMark;
  ++table_.excluded_;
}

void RobotImageTable::Builder::AddCorrupt(ConfigurationNumber number) {
  RequireNew(number);
  table_.slots_[number] = kCorruptMark;
  ++table_.corrupt_;
}

RobotImageTable RobotImageTable::Builder::Build() && {
  table_.FindPermanentPixels();
  return std::move(table_);
}

}  // namespace silhouette
