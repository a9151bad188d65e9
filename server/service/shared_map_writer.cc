#include "server/service/shared_map_writer.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "clients/shared_map/layout.h"
#include "db/status/status_macros.h"
#include "server/scene/checker.h"
#include "server/service/messages.h"

namespace silhouette {

namespace {

constexpr mode_t kRequired = S_IRUSR | S_IWUSR;
constexpr mode_t kPossible = kRequired | S_IRGRP | S_IROTH;

bool IsSharedMap(int file) {
  uint64_t magic = 0;
  return pread(file, &magic, sizeof(magic), 0) == sizeof(magic) && magic == shared_map::kMagic;
}

}  // namespace

absl::Status SharedMapFile::Failed(const char* what, int error) const {
  return absl::UnavailableError(absl::StrCat("the shared map '", settings_.file, "' cannot be ",
                                             what, ": ", std::strerror(error)));
}

absl::StatusOr<std::unique_ptr<SharedMapFile>> SharedMapFile::Create(
    const SharedMapSettings& settings, uint64_t bytes, const SharedMapFile* before) {
  if ((settings.mode & kRequired) != kRequired || (settings.mode & ~kPossible) != 0) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the shared map cannot have the mode %04o: its user reads and writes, others read at most, "
        "as with 0600, 0640 or 0644",
        settings.mode));
  }
  auto made = std::unique_ptr<SharedMapFile>(new SharedMapFile(settings, -1));
  RETURN_IF_ERROR(made->MayTakeName(before));
  // What a server left that was killed just then.
  unlink(made->HiddenName().c_str());
  made->file_ = open(made->HiddenName().c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW,
                     kRequired);
  if (made->file_ < 0) return made->Failed("made", errno);
  if (flock(made->file_, LOCK_EX | LOCK_NB) != 0) return made->Failed("locked", errno);
  RETURN_IF_ERROR(made->Map(bytes));
  return made;
}

absl::Status SharedMapFile::Map(uint64_t bytes) {
  // A file whose room is not kept ends the server when it writes to it and there is none.
  if (const int error = posix_fallocate(file_, 0, static_cast<off_t>(bytes)); error != 0) {
    return absl::UnavailableError(absl::StrCat("the shared map '", settings_.file, "' takes ",
                                               bytes, " bytes: ", std::strerror(error)));
  }
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file_, 0);
  if (memory == MAP_FAILED) return Failed("mapped", errno);
  words_ = {static_cast<uint64_t*>(memory), bytes / sizeof(uint64_t)};
  return absl::OkStatus();
}

absl::Status SharedMapFile::MayTakeName(const SharedMapFile* before) const {
  const std::string& path = settings_.file;
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (file < 0 && errno == ENOENT) return absl::OkStatus();
  if (file < 0) return Failed("put in the place of what is there", errno);
  const absl::Cleanup close_file = [file] { close(file); };
  struct stat status {};
  if (fstat(file, &status) != 0) return Failed("put in the place of what is there", errno);
  if (before != nullptr && before->Is(status)) return absl::OkStatus();
  if (!S_ISREG(status.st_mode) || !IsSharedMap(file)) {
    return absl::FailedPreconditionError(
        absl::StrCat("'", path, "' is there and no shared map: name another file, or remove it"));
  }
  if (flock(file, LOCK_EX | LOCK_NB) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("another server publishes its configuration space in '", path,
                     "': name another file, or end that server"));
  }
  return absl::OkStatus();
}

bool SharedMapFile::Is(const struct stat& status) const {
  struct stat own {};
  return fstat(file_, &own) == 0 && own.st_dev == status.st_dev && own.st_ino == status.st_ino;
}

absl::Status SharedMapFile::Show() {
  if (fchmod(file_, settings_.mode) != 0) return Failed("given its permissions", errno);
  if (rename(HiddenName().c_str(), settings_.file.c_str()) != 0) {
    return Failed("given its name", errno);
  }
  shown_ = true;
  return absl::OkStatus();
}

SharedMapFile::~SharedMapFile() {
  if (file_ < 0) return;
  const std::string name = shown_ ? settings_.file : HiddenName();
  struct stat status {};
  if (lstat(name.c_str(), &status) == 0 && Is(status)) unlink(name.c_str());
  if (!words_.empty()) munmap(words_.data(), words_.size_bytes());
  close(file_);
}

absl::StatusOr<std::unique_ptr<SharedMapWriter>> SharedMapWriter::Create(
    SharedMapSettings settings, absl::Duration max_age,
    const std::shared_ptr<const ServedDatabase>& database, const Policy& policy) {
  auto writer = std::unique_ptr<SharedMapWriter>(new SharedMapWriter(std::move(settings), max_age));
  RETURN_IF_ERROR(writer->Begin(database, policy));
  return writer;
}

SharedMapWriter::~SharedMapWriter() { Close(shared_map::Closed::kStopped); }

void SharedMapWriter::Close(shared_map::Closed why) {
  if (writer_) writer_->Close(why);
  writer_.reset();
  file_.reset();
}

absl::Status SharedMapWriter::Begin(const std::shared_ptr<const ServedDatabase>& database,
                                    const Policy& policy) {
  v1::GetDatabaseResponse message;
  ToMessage(*database, policy, &message);
  const std::string description = message.SerializeAsString();
  const shared_map::Layout layout{.tiles = database->grid().tiles(),
                                  .description_bytes = description.size()};
  ASSIGN_OR_RETURN(std::unique_ptr<SharedMapFile> file,
                   SharedMapFile::Create(settings_, layout.FileBytes(), file_.get()));
  std::optional<shared_map::Writer> writer(std::in_place, file->words(), layout, description,
                                           shared_map::ClockId::Ours());
  RETURN_IF_ERROR(file->Show());
  Close(shared_map::Closed::kReplaced);
  file_ = std::move(file);
  writer_ = std::move(writer);
  database_ = database;
  return absl::OkStatus();
}

shared_map::Stamp SharedMapWriter::StampOf(const Served& served, const Policy& policy,
                                           Reason blocked) const {
  shared_map::Stamp stamp{.reason = static_cast<uint64_t>(blocked)};
  if (served.scene == nullptr) return stamp;
  const Scene& scene = *served.scene;
  const absl::Duration taken = scene.arrived.running - scene.AgeAt(scene.arrived);
  stamp.scene = scene.id;
  stamp.scene_time = absl::ToUnixNanos(scene.oldest);
  stamp.taken = absl::ToInt64Nanoseconds(taken);
  stamp.valid_until = absl::ToInt64Nanoseconds(taken + max_age_);
  stamp.reason_after = static_cast<uint64_t>(Reason::kSceneStale);
  for (const AllowedRegion& region : served.regions->regions) {
    // At its end a region is in force no more.
    const int64_t last = absl::ToInt64Nanoseconds(region.end) - 1;
    if (last >= stamp.valid_until) continue;
    stamp.valid_until = last;
    stamp.reason_after = static_cast<uint64_t>(Reason::kRegionEnded);
  }
  if (served.trust != nullptr && RestsOnCalibration(policy) &&
      served.trust->until != absl::InfiniteDuration()) {
    const int64_t last = absl::ToInt64Nanoseconds(served.trust->until) - 1;
    if (last < stamp.valid_until) {
      stamp.valid_until = last;
      stamp.reason_after = static_cast<uint64_t>(Reason::kCalibrationDoubtful);
    }
  }
  return stamp;
}

shared_map::Cells SharedMapWriter::CellsOf(const ConfigurationSpace& space, const Policy& policy) {
  if (policy.off_grid != OffGrid::kCell) return shared_map::Cells::kNothing;
  for (uint64_t tile = 0; tile < space.tiles(); ++tile) {
    if (!space.cells_ready(tile)) return shared_map::Cells::kNothing;
  }
  return space.cells_exact() ? shared_map::Cells::kExact : shared_map::Cells::kSomeFree;
}

absl::Status SharedMapWriter::Publish(const Served& served, const Policy& policy,
                                      const ConfigurationSpace* space, Reason blocked) {
  // The variants have the same grid: a scene with another variant changes but the states.
  const std::shared_ptr<const ServedDatabase>& whole =
      served.whole != nullptr ? served.whole : served.database;
  if (database_.lock() != whole || !writer_) {
    if (absl::Status begun = Begin(whole, policy); !begun.ok()) {
      Close(shared_map::Closed::kReplaced);
      return begun;
    }
  }
  if (blocked == Reason::kNone && (space == nullptr || served.scene == nullptr)) {
    blocked = Reason::kInternal;
  }
  static const TileVerdicts unknown;
  const auto states = [space](uint64_t tile) -> shared_map::Writer::TileStates {
    const TileVerdicts& verdicts = space->ready(tile) ? space->tile(tile) : unknown;
    return {verdicts.free, verdicts.occupied, space->free_cells(tile).words};
  };
  shared_map::Stamp stamp = StampOf(served, policy, blocked);
  if (blocked == Reason::kNone) stamp.cells = CellsOf(*space, policy);
  writer_->Publish(
      stamp, absl::StrJoin(RegionsIn(served, policy), "\n"),
      blocked == Reason::kNone ? shared_map::Writer::Tiles(states) : shared_map::Writer::Tiles());
  return absl::OkStatus();
}

}  // namespace silhouette
