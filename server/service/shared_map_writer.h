// Publishes the configuration-space map of the default policy in a file that clients on the same
// machine map into their memory (clients/shared_map/layout.h).
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "clients/shared_map/writer.h"
#include "server/scene/configuration_space.h"
#include "server/scene/scene_store.h"

namespace silhouette {

// The file of the server's shared map (clients/shared_map/layout.h).
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

// Used by one thread at a time.
class SharedMapWriter {
 public:
  // Makes the file; all is unknown, there is no scene. `max_age`: the server's own. Errors as
  // SharedMapFile's.
  static absl::StatusOr<std::unique_ptr<SharedMapWriter>> Create(
      SharedMapSettings settings, absl::Duration max_age,
      const std::shared_ptr<const ServedDatabase>& database, const Policy& policy);

  // Tells readers that the map is closed, and removes the file.
  ~SharedMapWriter();
  SharedMapWriter(const SharedMapWriter&) = delete;
  SharedMapWriter& operator=(const SharedMapWriter&) = delete;

  // What is so from now on. `blocked`: why all is unknown (BlockedReason), else kNone, and then
  // `space` is the map of served.scene under `policy`; tiles of it that are not ready are unknown.
  // Cells are told of if those of all tiles are ready, and the policy looks at any.
  // Another database than before gets a file of its own, and readers of the one before are told; if
  // it cannot be made they are told all the same, and the next call tries again. Moments must be of
  // SystemClock.
  absl::Status Publish(const Served& served, const Policy& policy, const ConfigurationSpace* space,
                       Reason blocked);

 private:
  SharedMapWriter(SharedMapSettings settings, absl::Duration max_age)
      : settings_(std::move(settings)), max_age_(max_age) {}

  absl::Status Begin(const std::shared_ptr<const ServedDatabase>& database, const Policy& policy);
  void Close(shared_map::Closed why);
  static shared_map::Cells CellsOf(const ConfigurationSpace& space, const Policy& policy);
  shared_map::Stamp StampOf(const Served& served, const Policy& policy, Reason blocked) const;

  const SharedMapSettings settings_;
  const absl::Duration max_age_;
  // What the file is of. Not kept alive: it is large.
  std::weak_ptr<const ServedDatabase> database_;
  std::unique_ptr<SharedMapFile> file_;
  std::optional<shared_map::Writer> writer_;
};

}  // namespace silhouette
