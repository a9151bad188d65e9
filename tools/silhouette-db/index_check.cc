#include "tools/silhouette-db/index_check.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace silhouette {

IndexCheck::IndexCheck(const CollisionIndex& index) : index_(index), builder_(index.trees()) {}

void IndexCheck::Take(ConfigurationNumber number, const absl::StatusOr<RobotImage>& image) {
  if (tile_ && *tile_ != number / kTileSize) CompareTile();
  tile_ = number / kTileSize;
  readable_ = readable_ && image.ok();
  if (!image.ok() || image->excluded) return;
  std::vector<MaskWords> words;
  for (const Mask& mask : image->masks) words.push_back(mask.words());
  builder_.Add(number % kTileSize, words);
}

void IndexCheck::Finish() {
  if (tile_) CompareTile();
  tile_.reset();
}

// A record that became unreadable after the tile was built cannot be compared; it is a fault of its
// own.
void IndexCheck::CompareTile() {
  const std::vector<std::byte> expected = builder_.Finish();
  const std::span<const std::byte> stored = index_.Bytes(*tile_);
  const bool same = stored.size() >= expected.size() &&
                    std::ranges::equal(expected, stored.first(expected.size()));
  if (!stored.empty() && readable_ && !same) {
    faults_.push_back(
        absl::StrCat("the collision index of tile ", *tile_, " is not that of its robot images"));
  }
  readable_ = true;
}

}  // namespace silhouette
