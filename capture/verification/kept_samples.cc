// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/kept_samples.h"

#include <algorithm>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// The cell with a grid so fine that chance hardly finds a grid value twice.
storage::v1::CellDescription FineCell(storage::v1::CellDescription cell) {
  constexpr int kBitsOfAll = 36;  // a grid has at most 2^40 configurations
  constexpr int kMostBits = 20;
  const int steps = 1 << std::min(kMostBits, kBitsOfAll / std::max(1, cell.grid_joints_size()));
  for (storage::v1::GridJoint& joint : *cell.mutable_grid_joints()) {
    joint.set_steps(joint.lower() < joint.upper() ? steps : 1);
  }
  cell.clear_tile_edges();
  return cell;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Database>> OpenKeptSamples(const std::string& path,
                                                          const Database& drawn,
                                                          const std::string& program) {
  const storage::v1::CellDescription cell = FineCell(drawn.cell());
  ASSIGN_OR_RETURN(const Snapshot snapshot, drawn.Read());
  ASSIGN_OR_RETURN(const auto references, snapshot.References());
  auto kept = Database::Open(path, Database::Access::kWrite);
  if (absl::IsNotFound(kept.status())) kept = Database::Create(path, cell);
  if (!kept.ok()) return kept.status();
  std::vector<std::string> differences =
      Differences(cell, "the cell", (*kept)->cell(), "these configurations");
  ASSIGN_OR_RETURN(const Snapshot of_kept, (*kept)->Read());
  ASSIGN_OR_RETURN(const auto before, of_kept.References());
  if (!before && of_kept.size() == 0 && references) {
    RETURN_IF_ERROR((*kept)->SetReferences(*references, program));
  } else if (!before || !references ||
             before->SerializeAsString() != references->SerializeAsString()) {
    differences.emplace_back("the reference images are others");
  }
  if (differences.empty()) return kept;
  return absl::FailedPreconditionError(
      absl::StrCat("the configurations kept in '", path, "' are not of this cell any more: ",
                   absl::StrJoin(differences, "; "), "; move that folder away to begin again"));
}

}  // namespace silhouette
