#include "clients/shared_map/reader.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>

namespace silhouette::shared_map {

static_assert(std::atomic_ref<uint64_t>::is_always_lock_free, "processes share no locks");

Reader::Reader(std::span<const uint64_t> memory) : memory_(memory) {
  if (memory.size_bytes() < kPage || memory[kHeadMagic] != kMagic) {
    throw std::invalid_argument("is not a shared map of the configuration space");
  }
  if (memory[kHeadVersion] != kFormatVersion) {
    throw std::invalid_argument(
        "is a shared map of format " + std::to_string(memory[kHeadVersion]) +
        ", and this program reads format " + std::to_string(kFormatVersion) +
        ": use programs of the same version");
  }
  // Each word is read once: what is checked is what is used.
  const Layout layout{.tiles = memory[kHeadTiles],
                      .description_bytes = memory[kHeadDescriptionBytes]};
  if (!layout.Possible() || memory.size_bytes() != layout.FileBytes() ||
      memory[kHeadFileBytes] != layout.FileBytes() ||
      memory[kHeadDescriptionOffset] != layout.DescriptionOffset() ||
      memory[kHeadBufferOffset] != layout.BufferOffset() ||
      memory[kHeadBufferDistance] != layout.BufferDistance()) {
    throw std::invalid_argument("is a damaged shared map: its size is not what its head says");
  }
  tiles_ = layout.tiles;
  clock_ = {.boot = {memory[kHeadBoot], memory[kHeadBoot + 1]},
            .time_namespace = memory[kHeadTimeNamespace]};
  const auto* bytes = reinterpret_cast<const char*>(memory.data());
  description_.assign(bytes + layout.DescriptionOffset(), layout.description_bytes);
  for (size_t i = 0; i < kBuffers; ++i) {
    buffers_[i] =
        memory.data() + (layout.BufferOffset() + i * layout.BufferDistance()) / sizeof(uint64_t);
  }
}

std::string Reader::Update::names() const {
  const size_t bytes = std::min<uint64_t>(Load(words_[kBufferNamesBytes]), kMostNamesBytes);
  std::string names((bytes + sizeof(uint64_t) - 1) / sizeof(uint64_t) * sizeof(uint64_t), '\0');
  for (size_t at = 0; at < names.size(); at += sizeof(uint64_t)) {
    const uint64_t word = Load(words_[kBufferNames + at / sizeof(uint64_t)]);
    std::memcpy(names.data() + at, &word, sizeof(word));
  }
  names.resize(bytes);
  return names;
}

}  // namespace silhouette::shared_map
