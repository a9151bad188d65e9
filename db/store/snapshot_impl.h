// What a Snapshot consists of.
#pragma once

#include <cstdint>
#include <memory>

#include "db/store/database_state.h"
#include "db/store/raw_records.h"

namespace silhouette {

struct Snapshot::Impl {
  std::shared_ptr<const DatabaseState> state;
  // That of the snapshots of other variants, too, that were taken together
  // (Database::ReadVariants).
  std::shared_ptr<const ReadTransaction> held;
  uint64_t generation = 0;
  uint64_t size = 0;

  Environment& environment() const { return *state->environment; }
  MDB_txn* transaction() const { return held->get(); }
  RecordSource records() const { return {*state, transaction()}; }
};

}  // namespace silhouette
