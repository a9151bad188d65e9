// The file of the server's shared map (clients/shared_map/layout.h).
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace silhouette {

struct SharedMapSettings {
  // Empty: there is none. Best in /dev/shm, which is memory.
  std::string file;
  // Who may read it. Nobody but the server's user may write to it.
  mode_t mode = 0640;
};

// A file, locked and mapped for writing. It gets its name when it is complete; whoever opened one
// of this name before keeps that.
class SharedMapFile {
 public:
  // Zeros, with room kept for all of them. `before`: the server's own file that it is to replace,
  // or null. InvalidArgument: the mode lets others write, or bars the server's user.
  // FailedPrecondition: another server's map has the name, or a file that is none. Unavailable:
  // there is no room, or another fault of the system.
  static absl::StatusOr<std::unique_ptr<SharedMapFile>> Create(const SharedMapSettings& settings,
                                                               uint64_t bytes,
                                                               const SharedMapFile* before);
  // Removes the file, if it has its name still.
  ~SharedMapFile();
  SharedMapFile(const SharedMapFile&) = delete;
  SharedMapFile& operator=(const SharedMapFile&) = delete;

  std::span<uint64_t> words() const { return words_; }

  // Gives it its name and permissions.
  absl::Status Show();

 private:
  SharedMapFile(SharedMapSettings settings, int file)
      : settings_(std::move(settings)), file_(file) {}

  absl::Status Map(uint64_t bytes);
  absl::Status MayTakeName(const SharedMapFile* before) const;
  // Whether `status` is of this file.
  bool Is(const struct stat& status) const;
  std::string HiddenName() const { return settings_.file + ".new"; }
  absl::Status Failed(const char* what, int error) const;

  const SharedMapSettings settings_;
  int file_ = -1;
  bool shown_ = false;
  std::span<uint64_t> words_;
};

}  // namespace silhouette
