// Whether the pages of an LMDB data file make sense. LMDB trusts its pages: one damaged pointer can
// end the process, or let a write destroy what is sound. Thus every page of every tree is looked at
// before LMDB is.
//
// Checked are the trees of one state of the database: the page numbers, kinds and bounds of all
// branch and leaf pages, the bounds and order of their nodes, counts and depths, that no page is
// used twice or lies beyond the file's end. Values are not: they have checksums of their own. The
// format is that of LMDB 0.9 on 64-bit little-endian machines, data version 1.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

namespace silhouette {

// `file`: an open data file, which `name` names in messages. `transaction`: the state, by the id of
// the transaction that made it (mdb_txn_id of a read transaction, which must stay active
// meanwhile). DataLoss with the first fault found. Unavailable if the state has been overwritten:
// try again with the present one.
absl::Status CheckPages(int file, const std::string& name, uint64_t transaction);

}  // namespace silhouette
