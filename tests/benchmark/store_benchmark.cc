// SPDX-License-Identifier: Apache-2.0
// Baseline: one look into the database per check, instead of robot images in memory.
#include <benchmark/benchmark.h>
#include <lmdb.h>

#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "db/store/schema.h"
#include "db/store/store.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/synthetic_database.h"
#include "tests/benchmark/timing.h"
#include "tests/test_folder.h"

namespace silhouette::benchmarks {
namespace {

constexpr int kGets = 20'000;

const SyntheticCell& StoredCell() {
  static const SyntheticCell cell({.steps = {64, 48, 40}});
  return cell;
}

// The folder of its database.
const std::string& StoredCellsPath() {
  static const std::string path = [] {
    std::string folder = TestFolder() / "cell.lmdb";
    WriteDatabase(StoredCell(), folder);
    return folder;
  }();
  return path;
}

// A read transaction of plain LMDB on the robot images.
class PlainRead {
 public:
  explicit PlainRead(const std::string& path) {
    ok_ = mdb_env_create(&environment_) == 0 && mdb_env_set_maxdbs(environment_, 16) == 0 &&
          mdb_env_set_mapsize(environment_, size_t{4} << 30) == 0 &&
          mdb_env_open(environment_, path.c_str(), MDB_RDONLY, 0) == 0 &&
          mdb_txn_begin(environment_, nullptr, MDB_RDONLY, &transaction_) == 0 &&
          mdb_dbi_open(transaction_, schema::kRobotImages, 0, &images_) == 0;
  }
  ~PlainRead() {
    if (transaction_ != nullptr) mdb_txn_abort(transaction_);
    mdb_env_close(environment_);
  }
  PlainRead(const PlainRead&) = delete;
  PlainRead& operator=(const PlainRead&) = delete;

  bool ok() const { return ok_; }

  // The value of a configuration; empty if there is none.
  std::string_view Get(ConfigurationNumber number) const {
    schema::NumberKey key = schema::EncodeKey(number);
    MDB_val key_val = {key.size(), key.data()};
    MDB_val value;
    if (mdb_get(transaction_, images_, &key_val, &value) != 0) return {};
    return {static_cast<const char*>(value.mv_data), value.mv_size};
  }

 private:
  MDB_env* environment_ = nullptr;
  MDB_txn* transaction_ = nullptr;
  MDB_dbi images_ = 0;
  bool ok_ = false;
};

uint64_t StoreUnionOf(std::string_view bytes) {
  uint64_t all = 0;
  for (; bytes.size() >= sizeof(uint64_t); bytes.remove_prefix(sizeof(uint64_t))) {
    uint64_t word = 0;
    std::memcpy(&word, bytes.data(), sizeof(word));
    all |= word;
  }
  return all;
}

// The record is looked up and its bytes are read, in a transaction that stays open.
void Get(benchmark::State& state) {
  const PlainRead read(StoredCellsPath());
  if (!read.ok()) {
    state.SkipWithError("LMDB cannot read the database");
    return;
  }
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(StoredCell().grid(), kGets);
  uint64_t bytes = 0;
  MeasureCalls(state, kGets, [&](int i) {
    const std::string_view value = read.Get(numbers[static_cast<size_t>(i)]);
    bytes += value.size();
    benchmark::DoNotOptimize(StoreUnionOf(value));
  });
  if (bytes == 0) state.SkipWithError("no record was found");
  state.counters["record_bytes"] =
      static_cast<double>(bytes) / static_cast<double>(state.iterations() * kGets);
}

// The same with its checksum tested and its masks decoded: what the server would have to do.
void GetAndDecode(benchmark::State& state) {
  const auto database = Database::Open(StoredCellsPath(), Database::Access::kRead);
  if (!database.ok()) {
    state.SkipWithError(std::string(database.status().message()).c_str());
    return;
  }
  const auto snapshot = (*database)->Read();
  const std::vector<ConfigurationNumber> numbers = RandomNumbers(StoredCell().grid(), kGets);
  bool found = snapshot.ok();
  MeasureCalls(state, kGets, [&](int i) {
    const auto image = snapshot->Find(numbers[static_cast<size_t>(i)]);
    found = found && image.ok() && image->has_value();
  });
  if (!found) state.SkipWithError("a record was not found");
}

BENCHMARK(Get)->Name("lmdb_get")->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(GetAndDecode)
    ->Name("lmdb_get_and_decode")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace silhouette::benchmarks
