#include "clients/shared_map/writer.h"

#include <atomic>
#include <cstring>
#include <stdexcept>

namespace silhouette::shared_map {
namespace {

static_assert(std::atomic_ref<uint64_t>::is_always_lock_free, "processes share no locks");

void Store(uint64_t& word, uint64_t value) {
  std::atomic_ref<uint64_t>(word).store(value, std::memory_order_release);
}

// Leaves a word alone that has the value already: readers keep it in their caches.
void Update(uint64_t& word, uint64_t value) {
  if (std::atomic_ref<uint64_t>(word).load(std::memory_order_relaxed) != value) Store(word, value);
}

void UpdateNames(uint64_t* buffer, std::string_view names) {
  while (names.size() > kMostNamesBytes) {
    const size_t last = names.rfind('\n');
    names = names.substr(0, last == std::string_view::npos ? 0 : last);
  }
  Update(buffer[kBufferNamesBytes], names.size());
  for (size_t at = 0; at < names.size(); at += sizeof(uint64_t)) {
    uint64_t word = 0;
    const std::string_view part = names.substr(at, sizeof(word));
    std::memcpy(&word, part.data(), part.size());
    Update(buffer[kBufferNames + at / sizeof(word)], word);
  }
}

}  // namespace

Writer::Writer(std::span<uint64_t> memory, const Layout& layout, std::string_view description,
               const ClockId& clock)
    : memory_(memory), layout_(layout) {
  if (!layout.Possible() || memory.size_bytes() != layout.FileBytes() ||
      description.size() != layout.description_bytes) {
    throw std::invalid_argument("the memory of a shared map must have the size of its layout");
  }
  memory[kHeadMagic] = kMagic;
  memory[kHeadVersion] = kFormatVersion;
  memory[kHeadFileBytes] = layout.FileBytes();
  memory[kHeadTiles] = layout.tiles;
  memory[kHeadDescriptionOffset] = layout.DescriptionOffset();
  memory[kHeadDescriptionBytes] = layout.description_bytes;
  memory[kHeadBufferOffset] = layout.BufferOffset();
  memory[kHeadBufferDistance] = layout.BufferDistance();
  memory[kHeadBoot] = clock.boot[0];
  memory[kHeadBoot + 1] = clock.boot[1];
  memory[kHeadTimeNamespace] = clock.time_namespace;
  std::memcpy(memory.data() + layout.DescriptionOffset() / sizeof(uint64_t), description.data(),
              description.size());
}

uint64_t* Writer::Buffer(uint64_t update) const {
  const uint64_t offset = layout_.BufferOffset() + update % kBuffers * layout_.BufferDistance();
  return memory_.data() + offset / sizeof(uint64_t);
}

void Writer::Publish(const Stamp& stamp, std::string_view names, const Tiles& tiles) {
  if (!tiles && stamp.reason == 0) {
    throw std::invalid_argument("states without tiles must be unknown for a reason");
  }
  const uint64_t update = newest_ + 1;
  uint64_t* buffer = Buffer(update);
  Store(buffer[kBufferSequence], 2 * update - 1);
  Update(buffer[kBufferReason], stamp.reason);
  Update(buffer[kBufferScene], stamp.scene);
  Update(buffer[kBufferTaken], static_cast<uint64_t>(stamp.taken));
  Update(buffer[kBufferValidUntil], static_cast<uint64_t>(stamp.valid_until));
  Update(buffer[kBufferReasonAfter], stamp.reason_after);
  Update(buffer[kBufferSceneTime], static_cast<uint64_t>(stamp.scene_time));
  Update(buffer[kBufferCells], static_cast<uint64_t>(stamp.cells));
  UpdateNames(buffer, names);
  const bool cells = stamp.cells != Cells::kNothing;
  uint64_t* states = buffer + kStatesOffset / sizeof(uint64_t);
  for (uint64_t tile = 0; tiles && tile < layout_.tiles; ++tile) {
    const TileStates of_tile = tiles(tile);
    for (size_t i = 0; i < of_tile.free.size(); ++i) {
      Update(states[0], of_tile.free[i]);
      Update(states[1], of_tile.occupied[i]);
      Update(states[2], cells ? of_tile.free_cells[i] : 0);
      states += kWordsPerPlaces;
    }
  }
  Store(buffer[kBufferSequence], 2 * update);
  Store(memory_[kHeadNewest], update);
  newest_ = update;
}

void Writer::Close(Closed why) { Store(memory_[kHeadClosed], static_cast<uint64_t>(why)); }

}  // namespace silhouette::shared_map
