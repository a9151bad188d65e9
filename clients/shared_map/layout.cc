#include "clients/shared_map/layout.h"

#include <sys/stat.h>

#include <cctype>
#include <fstream>
#include <string>

namespace silhouette::shared_map {
namespace {

// Grids have at most 2^40 configurations; nothing here comes near the end of 64 bits then.
constexpr uint64_t kMostTiles = uint64_t{1} << 40;
constexpr uint64_t kMostDescriptionBytes = uint64_t{1} << 30;

uint64_t WholePages(uint64_t bytes) { return (bytes + kPage - 1) / kPage * kPage; }

}  // namespace

bool Layout::Possible() const {
  return tiles <= kMostTiles && description_bytes <= kMostDescriptionBytes;
}

uint64_t Layout::BufferOffset() const {
  return DescriptionOffset() + WholePages(description_bytes);
}

uint64_t Layout::BufferDistance() const {
  return WholePages(kStatesOffset + tiles * kWordsPerTile * sizeof(uint64_t));
}

uint64_t Layout::FileBytes() const { return BufferOffset() + kBuffers * BufferDistance(); }

ClockId ClockId::Ours() {
  ClockId id;
  std::ifstream file("/proc/sys/kernel/random/boot_id");
  std::string text;
  std::getline(file, text);
  size_t digits = 0;
  for (const char c : text) {
    if (std::isxdigit(static_cast<unsigned char>(c)) == 0 || digits == 32) continue;
    const uint64_t value = static_cast<uint64_t>(c <= '9' ? c - '0' : (c | 0x20) - 'a' + 10);
    // Byte digits / 2 of the two words; its upper half comes first.
    id.boot[digits / 16] |= value << (8 * (digits / 2 % 8) + (digits % 2 == 0 ? 4 : 0));
    ++digits;
  }
  struct stat status {};
  if (stat("/proc/self/ns/time", &status) == 0) id.time_namespace = status.st_ino;
  return id;
}

}  // namespace silhouette::shared_map
