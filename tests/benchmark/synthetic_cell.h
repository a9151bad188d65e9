// SPDX-License-Identifier: Apache-2.0
// A cell without cameras and robot: a serial arm of seven capsules with the proportions of a
// Staubli RX130, seen by four pinhole views around it. It makes databases as large as benchmarks
// need them, about 2 us per robot image; the masks are any-touch (capsule_image.h).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"
#include "server/collision/collision_images.h"
#include "server/collision/robot_image_table.h"
#include "tests/benchmark/capsule_image.h"

namespace silhouette::benchmarks {

inline constexpr int kLinks = 7;
inline constexpr int kViews = 4;

struct CellSettings {
  // Grid values of each moving joint: of 2 (axes 1 and 3), 3 (1 to 3), 4 (1 to 3 and 5) or 6
  // joints.
  std::vector<int> steps;
  MaskSize mask_size{64, 64};
  // The share of its pixels that the robot covers in a view, on the average: the field of view is
  // as wide as that takes; where the robot is too thin even for the narrowest view that shows its
  // reach, its radii grow.
  double fill = 0.02;

  bool operator==(const CellSettings&) const = default;
};

// The robot images of a tile.
class TileMasks {
 public:
  uint64_t tile() const { return tile_; }
  // Whether a place is in the grid; bit i % 64 of word i / 64.
  std::span<const uint64_t> present() const { return present_; }
  bool present(uint64_t place) const { return (present_[place / 64] >> (place % 64) & 1) != 0; }
  // The robot image of a place; no pixels where the grid has none.
  MaskWords mask(int view, uint64_t place) const {
    return MaskWords(words_[static_cast<size_t>(view)]).subspan(place * mask_words_, mask_words_);
  }

 private:
  friend class SyntheticCell;
  uint64_t tile_ = 0;
  size_t mask_words_ = 0;
  std::array<uint64_t, kTileSize / 64> present_{};
  std::array<std::vector<uint64_t>, kViews> words_;
};

// Cannot be changed once made; used by any number of threads.
class SyntheticCell {
 public:
  // Throws std::invalid_argument for another number of joints, or a fill that cannot be reached.
  explicit SyntheticCell(const CellSettings& settings);

  const ConfigurationGrid& grid() const { return grid_; }
  MaskSize mask_size() const { return views_[0].size(); }
  std::vector<MaskSize> mask_sizes() const { return {kViews, mask_size()}; }
  std::span<const PinholeView> views() const { return views_; }
  // The fill that was reached, over random configurations.
  double fill() const { return fill_; }

  // The arm, from the base outward. `q`: values of the moving joints.
  std::array<Capsule, kLinks> RobotAt(std::span<const double> q) const;
  Mask RobotImage(int view, std::span<const double> q) const;

  TileMasks RenderTile(uint64_t tile) const;
  // Calls `take` with every tile, in order, on this thread; the tiles are rendered by as many
  // threads as the machine has cores, a few ahead.
  void ForEachTile(const std::function<void(const TileMasks&)>& take) const;

  // All robot images in memory.
  RobotImageTable Table() const;

  // What the views see of obstacles while the robot stands at `q`.
  ObstacleImages See(std::span<const Capsule> obstacles, std::span<const double> q) const;

 private:
  double MeanFill() const;

  std::vector<int> moving_;  // which of the six axes
  ConfigurationGrid grid_;
  double radius_scale_ = 1;
  std::vector<PinholeView> views_;
  double fill_ = 0;
};

// The grids of benchmarks: 3 k configurations of 2 joints, 1 M of 3, 10 M of 4, and a coarse grid
// of 6 joints with 10 M.
std::vector<int> StepsOfSize3k();
std::vector<int> StepsOfSize1M();
std::vector<int> StepsOfSize10M();
std::vector<int> StepsOfSize10MWithSixJoints();

}  // namespace silhouette::benchmarks
