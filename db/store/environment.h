// SPDX-License-Identifier: Apache-2.0
// The LMDB environment in a database's folder: opening it safely, transactions, growth of its map.
//
// LMDB allows an environment to be open only once per process, so all that a process opens of one
// folder share one Environment. Thread-safe, but a transaction is for one thread at a time.
#pragma once

#include <lmdb.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace silhouette {

// The status for an LMDB or errno code other than 0; `what` says what could not be done, e.g.
// "database 'cells/a' cannot be read".
absl::Status LmdbError(int code, const std::string& what);

inline MDB_val ToVal(std::string_view bytes) {
  return {bytes.size(), const_cast<char*>(bytes.data())};
}
inline std::string_view FromVal(const MDB_val& value) {
  return {static_cast<const char*>(value.mv_data), value.mv_size};
}

// Where in the data file a value should begin that LMDB shows: a large one, which has pages of its
// own, whose head of 16 bytes has their number. Nothing if the value does not lie so.
std::optional<uint64_t> OffsetInFile(std::string_view shown, size_t page_size);

// The same for any value, large or not. Nothing, too, if the file's pages are larger than this
// machine's: LMDB's map is not aligned to them.
std::optional<uint64_t> PlaceInFile(std::string_view shown, size_t page_size);

// Whether the pages of a state of the database make sense: see page_check.cc. `file`: an open data
// file, which `name` names in messages. `transaction`: the state, by the id of the transaction that
// made it (mdb_txn_id of a read transaction, which must stay active meanwhile). DataLoss with the
// first fault found. Unavailable if the state has been overwritten: try again with the present one.
absl::Status CheckPages(int file, const std::string& name, uint64_t transaction);

// Whether both meta pages of an open data file make sense (meta_pages.cc); `name` names it in
// messages. FailedPrecondition: it is no data file of LMDB's. DataLoss: what is wrong.
absl::Status CheckMetaPages(int file, const std::string& name);

class Environment;

struct EndTransaction {
  void operator()(MDB_txn* transaction) const { mdb_txn_abort(transaction); }
};
using Transaction = std::unique_ptr<MDB_txn, EndTransaction>;

// A read transaction. Pages that it may need are not reused while it is active.
class ReadTransaction {
 public:
  ReadTransaction(ReadTransaction&&) noexcept = default;
  ReadTransaction& operator=(ReadTransaction&&) = delete;

  MDB_txn* get() const { return transaction_.get(); }

  // Lets go of its state; Renew() takes the present one. Cheaper than a new transaction.
  void Reset();
  absl::Status Renew();

 private:
  friend class Environment;
  ReadTransaction(std::shared_ptr<Environment> environment, Transaction transaction)
      : environment_(std::move(environment)), transaction_(std::move(transaction)) {}
  std::shared_ptr<Environment> environment_;
  Transaction transaction_;  // ends before the environment may
};

// A write transaction, as Environment::Update gives it to a change.
class WriteTransaction {
 public:
  MDB_txn* get() const { return transaction_; }
  const Environment& environment() const { return environment_; }

  // Writes `value` under `key`. `flags` as mdb_put takes them.
  absl::Status Put(MDB_dbi database, std::string_view key, std::string_view value,
                   unsigned flags = 0);
  // Removes the value under `key`, if there is one.
  absl::Status Delete(MDB_dbi database, std::string_view key);
  // Opens a sub-database, making it if it is not there.
  absl::StatusOr<MDB_dbi> MakeSubDatabase(const char* name);

 private:
  friend class Environment;
  WriteTransaction(Environment& environment, MDB_txn* transaction)
      : environment_(environment), transaction_(transaction) {}
  Environment& environment_;
  MDB_txn* transaction_;
  bool map_full_ = false;
};

class Environment : public std::enable_shared_from_this<Environment> {
 public:
  using Change = std::function<absl::Status(WriteTransaction&)>;

  // Makes an environment in an existing folder without one and lets `fill` write into its `meta`;
  // all of it is one transaction. The caller holds the folder's WriterLock.
  static absl::StatusOr<std::shared_ptr<Environment>> Create(const std::string& folder,
                                                             const Change& fill);

  // Opens an existing one, and checks its pages even if the process has it open already; the errors
  // are those of Database::Open. NotFound also where Create() was interrupted.
  static absl::StatusOr<std::shared_ptr<Environment>> Open(const std::string& folder);

  ~Environment();
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

  const std::string& folder() const { return folder_; }
  MDB_env* get() const { return environment_; }
  MDB_dbi meta() const { return meta_; }
  // Of the default variant.
  MDB_dbi robot_images() const { return robot_images_; }

  // Another sub-database, by its name; nothing while there is none of its kind. A transaction that
  // was begun before this was first called may not know it: EINVAL. Not while the map is held.
  absl::StatusOr<std::optional<MDB_dbi>> Find(const std::string& name);
  // Makes it if it is not there. Only for the holder of the WriterLock; not within Update().
  absl::StatusOr<MDB_dbi> Make(const std::string& name);

  // Whether permissions allow nothing but reading.
  bool read_only() const { return read_only_; }

  absl::StatusOr<ReadTransaction> Read();

  // The value under a key; nothing if there is none, or if the transaction is older than the
  // sub-database. The caller holds the map, as long as it looks at the value.
  absl::StatusOr<std::optional<std::string_view>> Get(MDB_txn* transaction, MDB_dbi database,
                                                      std::string_view key) const;

  // Calls `visit` for the entries of a sub-database in order, the first of them under `from` or
  // after it, until it returns false. None if the transaction is older than the sub-database. The
  // caller holds the map.
  absl::Status ForEachEntry(
      MDB_txn* transaction, MDB_dbi database, std::string_view from,
      const std::function<bool(std::string_view key, std::string_view value)>& visit) const;

  // The size of a page. The caller holds the map.
  size_t PageSize() const;

  // Runs `change` in a write transaction and commits it durably, or undoes all of it if `change` or
  // the commit fails. `new_bytes`: about how much will be written. `change` is run again after the
  // map had to grow. Only for the holder of the WriterLock.
  absl::Status Update(size_t new_bytes, const Change& change);

  // Hold it around every use of a transaction and of what the transaction points to: otherwise the
  // map may move. Not recursive.
  using MapHold = std::shared_lock<std::shared_mutex>;
  MapHold HoldMap() { return MapHold(map_mutex_); }

  // LmdbError for something that went wrong while reading or writing.
  absl::Status ReadError(int code) const;
  absl::Status WriteError(int code) const;

 private:
  friend class ReadTransaction;
  explicit Environment(std::string folder);

  absl::Status OpenFiles(bool create);
  absl::StatusOr<unsigned> ChooseFlags();
  absl::Status CheckState();
  absl::Status OpenSubDatabases();
  absl::Status UpdateOnce(const Change& change, bool& map_full);
  // Sets the map's size; 0: to what another process has grown it to.
  absl::Status Resize(size_t bytes);
  // Calls `begin` until it is content with the map's size and the table of readers. `hold` is held
  // before and afterwards, and let go for the map to move.
  int BeginPatiently(const std::function<int()>& begin, MapHold& hold);
  absl::StatusOr<Transaction> BeginReading();

  const std::string folder_;
  MDB_env* environment_ = nullptr;
  bool read_only_ = false;
  int readers_guard_ = -1;  // keeps writers out where a reader cannot register itself
  MDB_dbi meta_ = 0;
  MDB_dbi robot_images_ = 0;
  std::map<std::string, MDB_dbi> opened_;  // by Find and Make
  std::mutex opened_mutex_;
  std::mutex update_mutex_;
  std::shared_mutex map_mutex_;
};

}  // namespace silhouette
