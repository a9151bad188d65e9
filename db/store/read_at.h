// SPDX-License-Identifier: Apache-2.0
// Reading at a place of a file without a map: damage makes a read fail, and the process lives; and
// values in what was read.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>

namespace silhouette {

// Fills `bytes` from an open file; false if the file is too short, or the disk fails. Thread-safe.
inline bool ReadAt(int file, uint64_t offset, std::span<char> bytes) {
  while (!bytes.empty()) {
    const ssize_t got = pread(file, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    bytes = bytes.subspan(static_cast<size_t>(got));
    offset += static_cast<uint64_t>(got);
  }
  return true;
}

// A value as it stands in memory or in a file.
template <typename T>
T Load(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof(value));
  return value;
}

}  // namespace silhouette
