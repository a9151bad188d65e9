// The server's side of a shared map (layout.h), in memory that it has already. A part of the pure
// core.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>

#include "clients/shared_map/layout.h"

namespace silhouette::shared_map {

// Used by one thread at a time; readers of the memory may look at any time.
class Writer {
 public:
  // The states of a tile, a bit per place.
  struct TileStates {
    std::span<const uint64_t, kPlacesPerTile / 64> free;
    std::span<const uint64_t, kPlacesPerTile / 64> occupied;
    // Of the cells that begin there; not looked at where the stamp tells nothing of cells.
    std::span<const uint64_t, kPlacesPerTile / 64> free_cells;
  };
  using Tiles = std::function<TileStates(uint64_t tile)>;

  // Writes head and description; there is no update yet. `memory`: zeros, layout.FileBytes() of
  // them, which outlive this. std::invalid_argument where the sizes do not fit.
  Writer(std::span<uint64_t> memory, const Layout& layout, std::string_view description,
         const ClockId& clock);

  // Makes an update the newest. `names`: of allowed regions, one a line; those beyond
  // kMostNamesBytes are left out. `tiles`: tells the states of each tile, as of one scene; null
  // only with a reason why all are unknown, else std::invalid_argument. Only words that change are
  // stored. If `tiles` throws, the update before stays the newest.
  void Publish(const Stamp& stamp, std::string_view names, const Tiles& tiles);

  // Says that no update will follow.
  void Close(Closed why);

 private:
  uint64_t* Buffer(uint64_t update) const;

  std::span<uint64_t> memory_;
  Layout layout_;
  uint64_t newest_ = 0;
};

}  // namespace silhouette::shared_map
