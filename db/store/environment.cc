// SPDX-License-Identifier: Apache-2.0
#include "db/store/environment.h"

#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/read_at.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

// The head of a page: its number (u64), 2 bytes, flags (u16), 4 bytes.
constexpr size_t kPageHead = 16;
constexpr uint16_t kEnvironmentLeaf = 0x02;
constexpr uint16_t kOverflow = 0x04;
constexpr uint64_t kMostPages = uint64_t{1} << 47;
struct PageHead {
  explicit PageHead(const char* page)
      : number(Load<uint64_t>(page)), flags(Load<uint16_t>(page + 10)) {}

  uint64_t number;
  uint16_t flags;
};

constexpr size_t kMapStep = size_t{1} << 20;

// LMDB calls it EIO if a write is cut short, as by a disk that becomes full within it or a file
// that becomes as large as it may.
int WhyCutShort(const std::string& folder) {
  std::error_code error;
  if (std::filesystem::space(folder, error).available < (1 << 16)) return ENOSPC;
  const auto size = std::filesystem::file_size(folder + "/" + schema::kDataFile, error);
  rlimit most;
  const bool largest = !error && getrlimit(RLIMIT_FSIZE, &most) == 0 && size >= most.rlim_cur;
  return largest ? EFBIG : EIO;
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
    case MDB_DBS_FULL:
      return absl::ResourceExhaustedError(
          what + ": the program has met too many variants, removed ones included; start it again");
    case EFBIG:
      return absl::ResourceExhaustedError(
          what + ": the file would be larger than 'ulimit -f' permits; raise that and try again");
    case EACCES:
    case EPERM:
      return absl::FailedPreconditionError(what + ": no permission");
    case EROFS:
      return absl::FailedPreconditionError(what + ": the file system is read-only");
    case ENAMETOOLONG:
      return absl::InvalidArgumentError(what +
                                        ": a name is too long; shorten it to 255 characters");
    case MDB_CORRUPTED:
    case MDB_PAGE_NOTFOUND:
    case MDB_INVALID:
      return absl::DataLossError(what + ": it is damaged");
    case MDB_VERSION_MISMATCH:
      return absl::FailedPreconditionError(what + ": another version of LMDB made it");
    case MDB_PANIC:
      return absl::DataLossError(what + ": an earlier error left it unusable; open it again");
    default:
      return absl::InternalError(absl::StrCat(what, ": ", mdb_strerror(code)));
  }
}

std::optional<uint64_t> OffsetInFile(std::string_view shown, size_t page_size) {
  const PageHead head(shown.data() - kPageHead);
  if (head.flags != kOverflow || head.number >= kMostPages) return std::nullopt;
  return head.number * page_size + kPageHead;
}

std::optional<uint64_t> PlaceInFile(std::string_view shown, size_t page_size) {
  if (page_size > static_cast<size_t>(sysconf(_SC_PAGESIZE))) return std::nullopt;
  const size_t in_page = reinterpret_cast<uintptr_t>(shown.data()) % page_size;
  if (in_page < kPageHead) return std::nullopt;
  const PageHead head(shown.data() - in_page);
  if (head.flags != kEnvironmentLeaf && head.flags != kOverflow) return std::nullopt;
  if (head.number >= kMostPages) return std::nullopt;
  return head.number * page_size + in_page;
}

void ReadTransaction::Reset() { mdb_txn_reset(get()); }

absl::Status ReadTransaction::Renew() {
  Environment::MapHold hold = environment_->HoldMap();
  const int code = environment_->BeginPatiently([this] { return mdb_txn_renew(get()); }, hold);
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

absl::Status WriteTransaction::Delete(MDB_dbi database, std::string_view key) {
  MDB_val key_val = ToVal(key);
  const int code = mdb_del(transaction_, database, &key_val, nullptr);
  map_full_ = map_full_ || code == MDB_MAP_FULL;
  return code == 0 || code == MDB_NOTFOUND ? absl::OkStatus() : environment_.WriteError(code);
}

absl::StatusOr<MDB_dbi> WriteTransaction::MakeSubDatabase(const char* name) {
  MDB_dbi database = 0;
  const int code = mdb_dbi_open(transaction_, name, MDB_CREATE, &database);
  map_full_ = map_full_ || code == MDB_MAP_FULL;
  if (code != 0) return environment_.WriteError(code);
  return database;
}

Environment::Environment(std::string folder) : folder_(std::move(folder)) {}

Environment::~Environment() {
  if (environment_ != nullptr) mdb_env_close(environment_);
  if (readers_guard_ >= 0) close(readers_guard_);
}

absl::Status Environment::ReadError(int code) const {
  const std::string what = absl::StrCat("database '", folder_, "' cannot be read");
  if (code != EAGAIN) return LmdbError(code, what);
  // LMDB tells readers apart by their process number.
  return absl::FailedPreconditionError(
      absl::StrCat(what, ": a process with the same number (", getpid(),
                   ") in another container has it open; start one of them with --pid=host"));
}

absl::Status Environment::WriteError(int code) const {
  if (code == EIO) code = WhyCutShort(folder_);
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

absl::StatusOr<Transaction> Environment::BeginReading() {
  MapHold hold = HoldMap();
  MDB_txn* begun = nullptr;
  const int code = BeginPatiently(
      [&] { return mdb_txn_begin(environment_, nullptr, MDB_RDONLY, &begun); }, hold);
  if (code != 0) return ReadError(code);
  return Transaction(begun);
}

absl::StatusOr<ReadTransaction> Environment::Read() {
  ASSIGN_OR_RETURN(Transaction transaction, BeginReading());
  return ReadTransaction(shared_from_this(), std::move(transaction));
}

absl::StatusOr<std::optional<std::string_view>> Environment::Get(MDB_txn* transaction,
                                                                 MDB_dbi database,
                                                                 std::string_view key) const {
  MDB_val key_val = ToVal(key);
  MDB_val value;
  const int code = mdb_get(transaction, database, &key_val, &value);
  if (code == MDB_NOTFOUND || code == EINVAL) return std::optional<std::string_view>();
  if (code != 0) return ReadError(code);
  return std::optional(FromVal(value));
}

absl::Status Environment::ForEachEntry(
    MDB_txn* transaction, MDB_dbi database, std::string_view from,
    const std::function<bool(std::string_view key, std::string_view value)>& visit) const {
  MDB_cursor* cursor = nullptr;
  int code = mdb_cursor_open(transaction, database, &cursor);
  if (code == EINVAL) return absl::OkStatus();
  if (code != 0) return ReadError(code);
  MDB_val key = ToVal(from);
  MDB_val value;
  code = mdb_cursor_get(cursor, &key, &value, from.empty() ? MDB_FIRST : MDB_SET_RANGE);
  while (code == 0 && visit(FromVal(key), FromVal(value))) {
    code = mdb_cursor_get(cursor, &key, &value, MDB_NEXT);
  }
  mdb_cursor_close(cursor);
  return code == 0 || code == MDB_NOTFOUND ? absl::OkStatus() : ReadError(code);
}

size_t Environment::PageSize() const {
  MDB_stat stat;
  mdb_env_stat(environment_, &stat);
  return stat.ms_psize;
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
    RETURN_IF_ERROR(Resize((wanted + kMapStep - 1) / kMapStep * kMapStep));
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
