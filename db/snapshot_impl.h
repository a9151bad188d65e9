// What a Snapshot consists of.
#pragma once

#include <cstdint>
#include <memory>

#include "db/database_state.h"

namespace silhouette {

struct Snapshot::Impl {
  std::shared_ptr<const DatabaseState> state;
  ReadTransaction transaction;
  uint64_t generation = 0;
  uint64_t size = 0;

  Environment& environment() const { return *state->environment; }
};

}  // namespace silhouette
