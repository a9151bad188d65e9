// How the bytes of a tile's index are put together.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

namespace silhouette {

// In the number of views: the sets are told by differences.
inline constexpr uint64_t kTellsDifferences = uint64_t{1} << 63;
// Where in a difference the number of lines before it stands, behind the lines that differ.
inline constexpr unsigned kLines = 8;
inline constexpr uint64_t kLinesMask = (uint64_t{1} << kLines) - 1;

template <typename T>
void Append(std::vector<std::byte>& bytes, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  const size_t at = bytes.size();
  bytes.resize(at + sizeof(T));
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

inline void FillUp(std::vector<std::byte>& bytes) { bytes.resize((bytes.size() + 63) / 64 * 64); }

}  // namespace silhouette
