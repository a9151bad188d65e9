// All robot images of one generation of a database, in memory: per view one contiguous block, in
// the order of configuration numbers. Cannot be changed once built; read by any number of threads.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "db/configuration_grid.h"
#include "db/index/place_set.h"
#include "db/mask.h"

namespace silhouette {

// What the table holds for a configuration.
enum class RobotImageState : uint8_t {
  kMissing = 0,  // nothing was captured; also a number that no configuration has
  kPresent,
  kExcluded,  // in a region the robot must never enter
  kCorrupt,   // a record that fails its checksum
};

class RobotImageTable {
 public:
  // A table without any robot image. `mask_sizes`: one per view, at least one, all valid.
  // `expected`: about how many images will be added, to reserve memory. Throws
  // std::invalid_argument if this does not hold, or if the grid has more than 2^32 - 16 places.
  class Builder;

  const ConfigurationGrid& grid() const { return grid_; }
  int views() const { return static_cast<int>(mask_sizes_.size()); }
  std::span<const MaskSize> mask_sizes() const { return mask_sizes_; }

  RobotImageState state(ConfigurationNumber number) const {
    if (number >= slots_.size()) return RobotImageState::kMissing;
    return slots_[number] < kFirstMark ? RobotImageState::kPresent : StateOfMark(slots_[number]);
  }

  // The robot image of a configuration whose state is kPresent.
  MaskWords image(int view, ConfigurationNumber number) const {
    const size_t words = mask_sizes_[static_cast<size_t>(view)].words();
    return {images_[static_cast<size_t>(view)].data() + slots_[number] * words, words};
  }
  Mask ImageAsMask(int view, ConfigurationNumber number) const;

  // The configurations of a tile of the grid whose state is kPresent.
  const PlaceSet& present(uint64_t tile) const { return present_sets_[tile]; }

  // Number of configurations in a state.
  uint64_t Count(RobotImageState state) const;

  // The pixels that the robot covers in every configuration that is present; none if there is no
  // such configuration.
  const Mask& permanent(int view) const { return permanent_[static_cast<size_t>(view)]; }

 private:
  // slots_ has for every number the place of its images in images_, or one of these marks.
  static constexpr uint32_t kFirstMark = 0xfffffff0;
  static constexpr uint32_t kMissingMark = 0xffffffff;
  static constexpr uint32_t kExcludedMark = 0xfffffffe;
  static constexpr uint32_t kCorruptMark = 0xfffffffd;

  RobotImageTable(ConfigurationGrid grid, std::vector<MaskSize> mask_sizes, uint64_t expected);
  static RobotImageState StateOfMark(uint32_t mark);
  void FindPermanentPixels();

  ConfigurationGrid grid_;
  std::vector<MaskSize> mask_sizes_;
  std::vector<uint32_t> slots_;
  std::vector<std::vector<uint64_t>> images_;  // per view
  std::vector<PlaceSet> present_sets_;         // by tile
  std::vector<Mask> permanent_;
  uint64_t present_ = 0;
  uint64_t excluded_ = 0;
  uint64_t corrupt_ = 0;
};

class RobotImageTable::Builder {
 public:
  Builder(ConfigurationGrid grid, std::vector<MaskSize> mask_sizes, uint64_t expected = 0)
      : table_(std::move(grid), std::move(mask_sizes), expected) {}

  // Each configuration is added once, by one of these three. Throws std::invalid_argument for one
  // that is outside the grid or added twice, and for masks that do not fit the views.
  void Add(ConfigurationNumber number, std::span<const Mask> masks);
  void AddExcluded(ConfigurationNumber number);
  void AddCorrupt(ConfigurationNumber number);

  // The finished table; the builder is empty afterwards.
  RobotImageTable Build() &&;

 private:
  void RequireNew(ConfigurationNumber number) const;

  RobotImageTable table_;
};

}  // namespace silhouette
