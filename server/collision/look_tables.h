// One view's image in tables, so that one look-up tells what a voxel touches: made once per scene.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "db/mask/mask.h"
#include "server/collision/obstacle_image.h"
#include "server/collision/voxel_space.h"

namespace silhouette {

class LookTables {
 public:
  // Of the pixels that a voxel touches:
  static constexpr uint8_t kPossible = 1;  // one is not background, or the view says nothing
  static constexpr uint8_t kObstacle = 2;  // one is an obstacle, or the view says nothing
  static constexpr uint8_t kAllowed = 4;   // all that are not background are allowed

  // Without an image the view says nothing, and allows nothing. `allowed`: the allowed pixels, if
  // any.
  LookTables(const VoxelSpace::Look& look, const std::optional<ObstacleImage>& image,
             const std::optional<Mask>& allowed);

  // By an entry of VoxelSpace::Look::touched.
  const uint8_t* touched() const { return touched_.data(); }

  // Whether a ball may have its centre in a voxel, by an entry of VoxelSpace::Look::certain.
  bool CentrePossible(uint32_t index) const {
    return (certain_[index / 64] >> (index % 64) & 1) != 0;
  }
  // Whether any pixel of a rectangle is not background.
  bool AnyPossible(const PixelRectangle& pixels) const;

 private:
  void FillTouched(const VoxelSpace::Look& look, const ObstacleImage& image,
                   const std::optional<Mask>& allowed);
  void FillCertain(const VoxelSpace::Look& look, const Mask& foreground);

  int width_ = 0;
  std::vector<uint8_t> touched_;
  std::vector<uint64_t> certain_;
  // Per corner of a pixel, how many pixels above and left of it are not background.
  std::vector<uint32_t> sums_;
};

}  // namespace silhouette
