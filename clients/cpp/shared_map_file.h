// The file of a shared map, mapped into memory for reading.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "absl/status/statusor.h"

namespace silhouette::client {

class SharedMapFile {
 public:
  // Only looks at the file as such: SharedSpace::Open has the errors.
  static absl::StatusOr<std::unique_ptr<SharedMapFile>> Open(const std::string& path,
                                                             std::optional<uint32_t> owner);
  ~SharedMapFile();
  SharedMapFile(const SharedMapFile&) = delete;
  SharedMapFile& operator=(const SharedMapFile&) = delete;

  std::span<const uint64_t> words() const { return words_; }
  // The number of the user who it belongs to.
  uint32_t owner() const { return owner_; }

 private:
  SharedMapFile(std::span<const uint64_t> words, uint32_t owner) : words_(words), owner_(owner) {}

  std::span<const uint64_t> words_;
  uint32_t owner_;
};

}  // namespace silhouette::client
