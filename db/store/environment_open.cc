// SPDX-License-Identifier: Apache-2.0
// Making and opening an environment: what must be known before LMDB may touch a folder.
#include "db/store/environment.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <list>
#include <mutex>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/schema.h"
#include "db/store/writer_lock.h"

namespace silhouette {
namespace {

constexpr size_t kFirstMapBytes = size_t{64} << 20;
constexpr off_t kLockFileBytes = 8192;

using FileId = std::pair<dev_t, ino_t>;

// An environment that is open in a process. A forked child must not use its parent's.
struct OpenEnvironment {
  pid_t process = getpid();
  std::optional<FileId> data;
  std::optional<FileId> lock;  // nothing: it does not register its readers
  std::weak_ptr<Environment> environment;
};

struct Registry {
  std::mutex mutex;
  std::condition_variable closed;
  std::list<OpenEnvironment> open;
};

Registry& TheRegistry() {
  static Registry& registry = *new Registry;
  return registry;
}

std::string DataPath(const std::string& folder) { return folder + "/" + schema::kDataFile; }
std::string EnvironmentOpenLockPath(const std::string& folder) {
  return folder + "/" + schema::kLockFile;
}

bool IsPermission(int code) { return code == EACCES || code == EROFS || code == EPERM; }

FileId IdOf(const struct stat& file) { return {file.st_dev, file.st_ino}; }

// Never opens the lock file: to close it would end the locks that this process has on it.
std::optional<FileId> IdOfLockFile(const std::string& folder) {
  struct stat file {};
  if (stat(EnvironmentOpenLockPath(folder).c_str(), &file) != 0) return std::nullopt;
  return IdOf(file);
}

OpenEnvironment FilesOf(const Environment& environment) {
  OpenEnvironment files;
  mdb_filehandle_t data = -1;
  struct stat file {};
  if (mdb_env_get_fd(environment.get(), &data) == 0 && fstat(data, &file) == 0) {
    files.data = IdOf(file);
  }
  unsigned flags = 0;
  mdb_env_get_flags(environment.get(), &flags);
  if ((flags & MDB_NOLOCK) == 0) files.lock = IdOfLockFile(environment.folder());
  return files;
}

// Adds an opened environment; the registry's mutex is held.
std::shared_ptr<Environment> Register(std::unique_ptr<Environment> environment) {
  std::list<OpenEnvironment>& all = TheRegistry().open;
  const auto entry = all.insert(all.end(), FilesOf(*environment));
  std::shared_ptr<Environment> shared(environment.release(), [entry](Environment* closing) {
    delete closing;
    Registry& registry = TheRegistry();
    const std::lock_guard lock(registry.mutex);
    registry.open.erase(entry);
    registry.closed.notify_all();
  });
  entry->environment = shared;
  return shared;
}

// The environment that this process has open of the data file `data` in `folder`; null: none, and
// `lock`, of the registry's mutex, is still held. Two environments on one lock file would clear
// each other's readers there, and writers would overwrite what those read.
absl::StatusOr<std::shared_ptr<Environment>> FindOpen(const std::string& folder, const FileId& data,
                                                      std::unique_lock<std::mutex>& lock) {
  Registry& registry = TheRegistry();
  for (;;) {
    const std::optional<FileId> lock_file = IdOfLockFile(folder);
    const auto found = std::ranges::find_if(registry.open, [&](const OpenEnvironment& one) {
      return one.process == getpid() && (one.data == data || (one.lock && one.lock == lock_file));
    });
    if (found == registry.open.end()) return nullptr;
    if (const std::shared_ptr<Environment> shared = found->environment.lock()) {
      const bool same_data = found->data == data;
      const bool same_lock = !found->lock || found->lock == lock_file;
      lock.unlock();  // the last of it may go here, and is taken out under the lock
      if (same_data && same_lock) return shared;
      return absl::FailedPreconditionError(absl::StrCat(
          "'", same_data ? EnvironmentOpenLockPath(folder) : DataPath(folder),
          "' is no longer the file that this program has open; replace the whole folder instead "
          "of a file in it, or start the program again"));
    }
    registry.closed.wait(lock);
  }
}

// Checks the head of a data file before LMDB, which trusts it, opens the file.
absl::Status CheckHead(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return LmdbError(errno, absl::StrCat("'", path, "' cannot be read"));
  const absl::Status status = CheckMetaPages(file, path);
  close(file);
  return status;
}

}  // namespace

absl::StatusOr<std::shared_ptr<Environment>> Environment::Create(const std::string& folder,
                                                                 const Change& fill) {
  const std::lock_guard lock(TheRegistry().mutex);
  std::unique_ptr<Environment> environment(new Environment(folder));
  RETURN_IF_ERROR(environment->OpenFiles(true));
  RETURN_IF_ERROR(environment->Update(0, [&](WriteTransaction& transaction) -> absl::Status {
    ASSIGN_OR_RETURN(environment->meta_, transaction.MakeSubDatabase(schema::kMeta));
    ASSIGN_OR_RETURN(environment->robot_images_, transaction.MakeSubDatabase(schema::kRobotImages));
    return fill(transaction);
  }));
  return Register(std::move(environment));
}

absl::StatusOr<std::shared_ptr<Environment>> Environment::Open(const std::string& folder) {
  const std::string data = DataPath(folder);
  struct stat file {};
  if (stat(data.c_str(), &file) != 0) {
    if (errno == ENOENT || errno == ENOTDIR) {
      return absl::NotFoundError(absl::StrCat("there is no database in '", folder, "'"));
    }
    return LmdbError(errno, absl::StrCat("'", data, "' cannot be read"));
  }
  if (file.st_size == 0) {
    return absl::NotFoundError(absl::StrCat("there is no database in '", folder, "': '", data,
                                            "' is empty, as if making it was interrupted; if "
                                            "it held data, restore it from a copy"));
  }
  std::unique_lock lock(TheRegistry().mutex);
  ASSIGN_OR_RETURN(const std::shared_ptr<Environment> shared, FindOpen(folder, IdOf(file), lock));
  if (shared != nullptr) {
    RETURN_IF_ERROR(CheckHead(data));
    RETURN_IF_ERROR(shared->CheckState());
    return shared;
  }
  RETURN_IF_ERROR(CheckHead(data));
  std::unique_ptr<Environment> environment(new Environment(folder));
  RETURN_IF_ERROR(environment->OpenFiles(false));
  RETURN_IF_ERROR(environment->CheckState());
  RETURN_IF_ERROR(environment->OpenSubDatabases());
  return Register(std::move(environment));
}

absl::Status Environment::OpenFiles(bool create) {
  ASSIGN_OR_RETURN(const unsigned flags, ChooseFlags());
  if (int code = mdb_env_create(&environment_); code != 0) return ReadError(code);
  int code = mdb_env_set_maxdbs(environment_, schema::kMaxSubDatabases);
  if (code == 0 && create) code = mdb_env_set_mapsize(environment_, kFirstMapBytes);
  if (code == 0) code = mdb_env_open(environment_, folder_.c_str(), flags, 0664);
  if (code != 0) return create ? WriteError(code) : ReadError(code);
  int dead = 0;
  mdb_reader_check(environment_, &dead);
  return absl::OkStatus();
}

absl::StatusOr<unsigned> Environment::ChooseFlags() {
  const std::string data = DataPath(folder_);
  read_only_ = faccessat(AT_FDCWD, data.c_str(), W_OK, AT_EACCESS) != 0 && IsPermission(errno);
  const unsigned flags = MDB_NOTLS | (read_only_ ? MDB_RDONLY : 0);
  const int lock =
      open(EnvironmentOpenLockPath(folder_).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0664);
  if (lock < 0) {
    if (!IsPermission(errno))
      return LmdbError(errno, EnvironmentOpenLockPath(folder_) + " cannot be opened");
    read_only_ = true;
    ASSIGN_OR_RETURN(const int guard,
                     WriterLock::KeepWritersOut(
                         folder_, absl::StrCat(", and without permission to write '",
                                               schema::kLockFile, "' it cannot be read meanwhile; ",
                                               "wait, or get that permission")));
    readers_guard_ = guard;
    return flags | MDB_RDONLY | MDB_NOLOCK;
  }
  // LMDB writes into the lock file through a map, which on a full disk would end the process.
  const int error = fallocate(lock, 0, 0, kLockFileBytes) == 0 ? 0 : errno;
  close(lock);
  if (error == ENOSPC || error == EDQUOT) return ReadError(error);
  return flags;
}

// Looks at the present state's pages before LMDB does.
absl::Status Environment::CheckState() {
  mdb_filehandle_t file = -1;
  if (int code = mdb_env_get_fd(environment_, &file); code != 0) return ReadError(code);
  absl::Status status = absl::UnavailableError("not looked at yet");
  for (int attempt = 0; attempt < 10 && absl::IsUnavailable(status); ++attempt) {
    ASSIGN_OR_RETURN(const Transaction transaction, BeginReading());
    status = CheckPages(file, DataPath(folder_), mdb_txn_id(transaction.get()));
  }
  return status;
}

absl::Status Environment::OpenSubDatabases() {
  const std::string not_ours =
      absl::StrCat("'", DataPath(folder_), "' is an LMDB database, but not one of Silhouette's");
  ASSIGN_OR_RETURN(Transaction transaction, BeginReading());
  int code = mdb_dbi_open(transaction.get(), schema::kMeta, 0, &meta_);
  if (code == MDB_NOTFOUND) {
    MDB_stat main;
    mdb_env_stat(environment_, &main);
    if (main.ms_entries > 0) return absl::FailedPreconditionError(not_ours);
    return absl::NotFoundError(
        absl::StrCat("there is no database in '", folder_, "': making it was interrupted"));
  }
  if (code == MDB_INCOMPATIBLE) return absl::FailedPreconditionError(not_ours);
  if (code != 0) return ReadError(code);
  ASSIGN_OR_RETURN(const auto format, Get(transaction.get(), meta_, schema::kFormatKey));
  const std::optional<int> version = schema::FormatVersionIn(format.value_or(""));
  if (!version) return absl::FailedPreconditionError(not_ours);
  if (*version != schema::kFormatVersion) {
    return absl::FailedPreconditionError(absl::StrCat(
        "database '", folder_, "' has format version ", *version, ", this program knows version ",
        schema::kFormatVersion, "; use the programs of the version that made it"));
  }
  code = mdb_dbi_open(transaction.get(), schema::kRobotImages, 0, &robot_images_);
  if (code != 0) return ReadError(code == MDB_NOTFOUND ? MDB_CORRUPTED : code);
  code = mdb_txn_commit(transaction.release());  // keeps the handles
  return code == 0 ? absl::OkStatus() : ReadError(code);
}

absl::StatusOr<std::optional<MDB_dbi>> Environment::Find(const std::string& name) {
  // LMDB wants sub-databases to be opened by one transaction at a time.
  const std::lock_guard lock(opened_mutex_);
  if (const auto open = opened_.find(name); open != opened_.end()) return open->second;
  ASSIGN_OR_RETURN(Transaction transaction, BeginReading());
  const MapHold hold = HoldMap();
  MDB_dbi database = 0;
  unsigned flags = 0;
  int code = mdb_dbi_open(transaction.get(), name.c_str(), 0, &database);
  if (code == 0) code = mdb_dbi_flags(transaction.get(), database, &flags);
  if (code == MDB_NOTFOUND || code == MDB_INCOMPATIBLE || flags != 0) return std::nullopt;
  if (code == 0) code = mdb_txn_commit(transaction.release());  // keeps the handle
  if (code != 0) return ReadError(code);
  opened_[name] = database;
  return database;
}

absl::StatusOr<MDB_dbi> Environment::Make(const std::string& name) {
  ASSIGN_OR_RETURN(const std::optional<MDB_dbi> found, Find(name));
  if (found) return *found;
  const std::lock_guard lock(opened_mutex_);
  MDB_dbi database = 0;
  RETURN_IF_ERROR(Update(0, [&](WriteTransaction& transaction) -> absl::Status {
    ASSIGN_OR_RETURN(database, transaction.MakeSubDatabase(name.c_str()));
    return absl::OkStatus();
  }));
  opened_[name] = database;
  return database;
}

}  // namespace silhouette
