// SPDX-License-Identifier: Apache-2.0
// The configurations to which a robot is driven for a comparison with its model, in a database of
// their own: no end of the drive loses one.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "db/store/store.h"

namespace silhouette {

// The database in the folder `path` for captured configurations of the cell of `drawn`, anywhere in
// its joints' ranges; made if there is none. Open for writing. FailedPrecondition: the one that is
// there is of another cell, or of other reference images.
absl::StatusOr<std::unique_ptr<Database>> OpenKeptSamples(const std::string& path,
                                                          const Database& drawn,
                                                          const std::string& program);

}  // namespace silhouette
