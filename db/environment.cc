#include "db/environment.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <system_error>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/page_check.h"
#include "db/schema.h"
#include "db/writer_lock.h"

namespace silhouette {
namespace {

constexpr size_t kFirstMapBytes = size_t{64} << 20;
constexpr size_t kMapStep = size_t{1} << 20;
constexpr off_t kLockFileBytes = 8192;
constexpr uint32_t kLmdbMagic = 0xBEEFC0DE;
constexpr size_t kMagicOffset = 16;
constexpr size_t kPageSizeOffset = 40;

// The environments that are open in this process, by their data file. The process is part of the
// key because a forked child must not use its parent's.
using FileId = std::tuple<pid_t, dev_t, ino_t>;
struct Registry {
  std::mutex mutex;
  std::condition_variable closed;
  std::map<FileId, std::weak_ptr<Environment>> open;
};

Registry& TheRegistry() {
  static Registry& registry = *new Registry;
  return registry;
}

std::string DataPath(const std::string& folder) { return folder + "/" + schema::kDataFile; }
std::string LockPath(const std::string& folder) { return folder + "/" + schema::kLockFile; }

bool IsPermission(int code) { return code == EACCES || code == EROFS || code == EPERM; }

FileId IdOf(const struct stat& file) { return {getpid(), file.st_dev, file.st_ino}; }

// Adds an opened environment; the registry's mutex is held.
std::shared_ptr<Environment> Register(std::unique_ptr<Environment> environment, const FileId& id) {
  std::shared_ptr<Environment> shared(environment.release(), [id](Environment* closing) {
    delete closing;
    Registry& registry = TheRegistry();
    const std::lock_guard lock(registry.mutex);
    registry.open.erase(id);
    registry.closed.notify_all();
  });
  TheRegistry().open[id] = shared;
  return shared;
}

// The head of a data file tells what it is before LMDB, which trusts it, is let near it.
absl::Status CheckHead(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return LmdbError(errno, absl::StrCat("'", path, "' cannot be read"));
  char head[64] = {};
  const ssize_t length = pread(file, head, sizeof(head), 0);
  close(file);
  if (length < 0) return LmdbError(errno, absl::StrCat("'", path, "' cannot be read"));
  uint32_t magic = 0;
  uint32_t page_size = 0;
  std::memcpy(&magic, head + kMagicOffset, sizeof(magic));
  std::memcpy(&page_size, head + kPageSizeOffset, sizeof(page_size));
  if (length < static_cast<ssize_t>(sizeof(head)) || magic != kLmdbMagic) {
    return absl::FailedPreconditionError(absl::StrCat(
        "'", path, "' is not a database: it does not begin as an LMDB data file does"));
  }
  if (page_size < 512 || page_size > 32768 || (page_size & (page_size - 1)) != 0) {
    return absl::DataLossError(
        absl::StrCat("'", path, "' is damaged: its page size is ", page_size));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status LmdbError(int code, const std::string& what) {
  switch (code) {
    case ENOSPC:
    case EDQUOT:
      return absl::ResourceExhaustedError(what + ": the disk is full; make room and try again");
    case ENOMEM:
    case MDB_READERS_FULL:
    case MDB_MAP_FULL:
      return absl::ResourceExhaustedError(absl::StrCat(what, ": ", mdb_strerror(code)));
    case EACCES:
    case EPERM:
      return absl::FailedPreconditionError(what + ": no permission");
    case EROFS:
      return absl::FailedPreconditionError(what + ": the file system is read-only");
    case MDB_CORRUPTED:
    case MDB_PAGE_NOTFOUND:
    case MDB_INVALID:
      return absl::DataLossError(what + ": it is damaged");
    case MDB_VERSION_MISMATCH:
      return absl::FailedPreconditionError(what + ": another version of LMDB made it");
    case MDB_PANIC:
      return absl::DataLossError(what + ": an earlier error left it unusable; open it anew");
    default:
      return absl::InternalError(absl::StrCat(what, ": ", mdb_strerror(code)));
  }
}

// ----- transactions

ReadTransaction::ReadTransaction(std::shared_ptr<Environment> environment, MDB_txn* transaction)
    : environment_(std::move(environment)), transaction_(transaction) {}

ReadTransaction::ReadTransaction(ReadTransaction&& other) noexcept
    : environment_(std::move(other.environment_)),
      transaction_(std::exchange(other.transaction_, nullptr)) {}

ReadTransaction& ReadTransaction::operator=(ReadTransaction&& other) noexcept {
  std::swap(environment_, other.environment_);
  std::swap(transaction_, other.transaction_);
  return *this;
}

ReadTransaction::~ReadTransaction() {
  if (transaction_ != nullptr) mdb_txn_abort(transaction_);
}

void ReadTransaction::Reset() { mdb_txn_reset(transaction_); }

absl::Status ReadTransaction::Renew() {
  Environment::MapHold hold = environment_->HoldMap();
  const int code =
      environment_->BeginPatiently([this] { return mdb_txn_renew(transaction_); }, hold);
  return code == 0 ? absl::OkStatus() : environment_->ReadError(code);
}

absl::Status WriteTransaction::Put(MDB_dbi database, std::string_view key, std::string_view value,
                                   unsigned flags) {
  MDB_val key_val = ToVal(key);
  MDB_val value_val = ToVal(value);
  const int code = mdb_put(transaction_, database, &key_val, &value_val, flags);
  map_full_ = map_full_ || code == MDB_MAP_FULL;
  return code == 0 ? absl::OkStatus() : environment_.WriteError(code);
}

absl::StatusOr<MDB_dbi> WriteTransaction::MakeSubDatabase(const char* name) {
  MDB_dbi database = 0;
  const int code = mdb_dbi_open(transaction_, name, MDB_CREATE, &database);
  if (code != 0) return environment_.WriteError(code);
  return database;
}

// ----- opening

Environment::Environment(std::string folder) : folder_(std::move(folder)) {}

Environment::~Environment() {
  if (environment_ != nullptr) mdb_env_close(environment_);
  if (readers_guard_ >= 0) close(readers_guard_);
}

absl::StatusOr<std::shared_ptr<Environment>> Environment::Create(const std::string& folder,
                                                                 const Change& fill) {
  const std::lock_guard lock(TheRegistry().mutex);
  std::unique_ptr<Environment> environment(new Environment(folder));
  if (absl::Status status = environment->OpenFiles(true); !status.ok()) return status;
  absl::Status status = environment->Update(0, [&](WriteTransaction& transaction) -> absl::Status {
    const absl::StatusOr<MDB_dbi> meta = transaction.MakeSubDatabase(schema::kMeta);
    if (!meta.ok()) return meta.status();
    const absl::StatusOr<MDB_dbi> images = transaction.MakeSubDatabase(schema::kRobotImages);
    if (!images.ok()) return images.status();
    environment->meta_ = *meta;
    environment->robot_images_ = *images;
    return fill(transaction);
  });
  if (!status.ok()) return status;
  struct stat file {};
  if (stat(DataPath(folder).c_str(), &file) != 0) return environment->ReadError(errno);
  return Register(std::move(environment), IdOf(file));
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
    return absl::NotFoundError(
        absl::StrCat("there is no database in '", folder, "': making it was interrupted"));
  }
  Registry& registry = TheRegistry();
  std::unique_lock lock(registry.mutex);
  for (;;) {
    const auto found = registry.open.find(IdOf(file));
    if (found == registry.open.end()) break;
    if (std::shared_ptr<Environment> shared = found->second.lock()) return shared;
    registry.closed.wait(lock);
  }
  if (absl::Status status = CheckHead(data); !status.ok()) return status;
  std::unique_ptr<Environment> environment(new Environment(folder));
  if (absl::Status status = environment->OpenFiles(false); !status.ok()) return status;
  if (absl::Status status = environment->CheckState(); !status.ok()) return status;
  if (absl::Status status = environment->OpenSubDatabases(); !status.ok()) return status;
  return Register(std::move(environment), IdOf(file));
}

absl::Status Environment::OpenFiles(bool create) {
  const absl::StatusOr<unsigned> flags = ChooseFlags();
  if (!flags.ok()) return flags.status();
  if (int code = mdb_env_create(&environment_); code != 0) return ReadError(code);
  int code = mdb_env_set_maxdbs(environment_, schema::kMaxSubDatabases);
  if (code == 0 && create) code = mdb_env_set_mapsize(environment_, kFirstMapBytes);
  if (code == 0) code = mdb_env_open(environment_, folder_.c_str(), *flags, 0664);
  if (code != 0) return create ? WriteError(code) : ReadError(code);
  int dead = 0;
  mdb_reader_check(environment_, &dead);
  return absl::OkStatus();
}

absl::StatusOr<unsigned> Environment::ChooseFlags() {
  const std::string data = DataPath(folder_);
  read_only_ = faccessat(AT_FDCWD, data.c_str(), W_OK, AT_EACCESS) != 0 && IsPermission(errno);
  const unsigned flags = MDB_NOTLS | (read_only_ ? MDB_RDONLY : 0);
  const int lock = open(LockPath(folder_).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0664);
  if (lock < 0) {
    if (!IsPermission(errno)) return LmdbError(errno, LockPath(folder_) + " cannot be opened");
    read_only_ = true;
    const absl::StatusOr<int> guard = WriterLock::KeepWritersOut(folder_);
    if (!guard.ok()) return guard.status();
    readers_guard_ = *guard;
    return flags | MDB_RDONLY | MDB_NOLOCK;
  }
  // LMDB writes into the lock file through a map, which on a full disk would end the process.
  const bool full = fallocate(lock, 0, 0, kLockFileBytes) != 0 && errno == ENOSPC;
  close(lock);
  if (full) return ReadError(ENOSPC);
  return flags;
}

// Looks at the present state's pages before LMDB does.
absl::Status Environment::CheckState() {
  mdb_filehandle_t file = -1;
  if (int code = mdb_env_get_fd(environment_, &file); code != 0) return ReadError(code);
  absl::Status status = absl::UnavailableError("not looked at yet");
  for (int attempt = 0; attempt < 10 && absl::IsUnavailable(status); ++attempt) {
    MDB_txn* transaction = nullptr;
    if (const int code = BeginReading(&transaction); code != 0) return ReadError(code);
    status = CheckPages(file, DataPath(folder_), mdb_txn_id(transaction));
    mdb_txn_abort(transaction);
  }
  return status;
}

absl::Status Environment::OpenSubDatabases() {
  const std::string not_ours =
      absl::StrCat("'", DataPath(folder_), "' is an LMDB database, but not one of Silhouette's");
  MDB_txn* transaction = nullptr;
  int code = BeginReading(&transaction);
  if (code != 0) return ReadError(code);
  const auto end = [&](absl::Status status) {
    mdb_txn_abort(transaction);
    return status;
  };
  code = mdb_dbi_open(transaction, schema::kMeta, 0, &meta_);
  if (code == MDB_NOTFOUND) {
    MDB_stat main;
    mdb_env_stat(environment_, &main);
    if (main.ms_entries > 0) return end(absl::FailedPreconditionError(not_ours));
    return end(absl::NotFoundError(
        absl::StrCat("there is no database in '", folder_, "': making it was interrupted")));
  }
  if (code == MDB_INCOMPATIBLE) return end(absl::FailedPreconditionError(not_ours));
  if (code != 0) return end(ReadError(code));
  MDB_val key = ToVal(schema::kFormatKey);
  MDB_val value;
  code = mdb_get(transaction, meta_, &key, &value);
  if (code == MDB_NOTFOUND) return end(absl::FailedPreconditionError(not_ours));
  if (code != 0) return end(ReadError(code));
  const std::optional<int> version = schema::FormatVersionIn(FromVal(value));
  if (!version) return end(absl::FailedPreconditionError(not_ours));
  if (*version != schema::kFormatVersion) {
    return end(absl::FailedPreconditionError(absl::StrCat(
        "database '", folder_, "' has format version ", *version, ", this program knows version ",
        schema::kFormatVersion, "; use the programs of the version that made it")));
  }
  code = mdb_dbi_open(transaction, schema::kRobotImages, 0, &robot_images_);
  if (code != 0) return end(ReadError(code == MDB_NOTFOUND ? MDB_CORRUPTED : code));
  code = mdb_txn_commit(transaction);  // keeps the handles
  return code == 0 ? absl::OkStatus() : ReadError(code);
}

// ----- reading and writing

absl::Status Environment::ReadError(int code) const {
  return LmdbError(code, absl::StrCat("database '", folder_, "' cannot be read"));
}

absl::Status Environment::WriteError(int code) const {
  // A disk that becomes full within a write cuts it short; LMDB calls that EIO.
  std::error_code error;
  if (code == EIO && std::filesystem::space(folder_, error).available < (1 << 16)) code = ENOSPC;
  return LmdbError(code, absl::StrCat("database '", folder_, "' cannot be written"));
}

int Environment::BeginPatiently(const std::function<int()>& begin, MapHold& hold) {
  int code = 0;
  for (int attempt = 0; attempt < 10; ++attempt) {
    code = begin();
    if (code == MDB_MAP_RESIZED) {
      hold.unlock();
      const absl::Status status = Resize(0);
      hold.lock();
      if (!status.ok()) return code;
    } else if (code == MDB_READERS_FULL) {
      int dead = 0;
      mdb_reader_check(environment_, &dead);
      if (dead == 0) return code;
    } else {
      return code;
    }
  }
  return code;
}

int Environment::BeginReading(MDB_txn** transaction) {
  MapHold hold = HoldMap();
  return BeginPatiently(
      [&] { return mdb_txn_begin(environment_, nullptr, MDB_RDONLY, transaction); }, hold);
}

absl::StatusOr<ReadTransaction> Environment::Read() {
  MDB_txn* transaction = nullptr;
  if (const int code = BeginReading(&transaction); code != 0) return ReadError(code);
  return ReadTransaction(shared_from_this(), transaction);
}

absl::Status Environment::Update(size_t new_bytes, const Change& change) {
  const std::lock_guard one_at_a_time(update_mutex_);
  for (;;) {
    bool map_full = false;
    absl::Status status = UpdateOnce(change, map_full);
    if (!map_full) return status;
    MDB_envinfo info;
    mdb_env_info(environment_, &info);
    const size_t wanted = std::max(2 * info.me_mapsize, info.me_mapsize + 4 * new_bytes);
    status = Resize((wanted + kMapStep - 1) / kMapStep * kMapStep);
    if (!status.ok()) return status;
  }
}

absl::Status Environment::UpdateOnce(const Change& change, bool& map_full) {
  MapHold hold = HoldMap();
  MDB_txn* begun = nullptr;
  int code = BeginPatiently([&] { return mdb_txn_begin(environment_, nullptr, 0, &begun); }, hold);
  if (code != 0) return WriteError(code);
  WriteTransaction transaction(*this, begun);
  absl::Status status = change(transaction);
  map_full = transaction.map_full_;
  if (!status.ok()) {
    mdb_txn_abort(begun);
    return status;
  }
  code = mdb_txn_commit(begun);
  map_full = code == MDB_MAP_FULL;
  return code == 0 ? absl::OkStatus() : WriteError(code);
}

absl::Status Environment::Resize(size_t bytes) {
  const std::unique_lock lock(map_mutex_);
  // LMDB gives up the old map before it asks for the new one: see first that there is room.
  void* probe = mmap(nullptr, std::max<size_t>(bytes, 1), PROT_NONE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (probe == MAP_FAILED) return WriteError(errno);
  munmap(probe, std::max<size_t>(bytes, 1));
  const int code = mdb_env_set_mapsize(environment_, bytes);
  return code == 0 ? absl::OkStatus() : WriteError(code);
}

}  // namespace silhouette
