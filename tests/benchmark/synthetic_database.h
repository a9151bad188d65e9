// Databases of synthesised cells on disk, as a capture would leave them.
#pragma once

#include <string>

#include "silhouette/storage/v1/storage.pb.h"
#include "tests/benchmark/synthetic_cell.h"

namespace silhouette::benchmarks {

// Views are called view_1 to view_4.
storage::v1::CellDescription DescriptionOf(const SyntheticCell& cell);

// Makes a database with all robot images of the cell in the new folder `path`; about 10 us per
// configuration. Throws std::runtime_error if the disk does not allow it.
void WriteDatabase(const SyntheticCell& cell, const std::string& path);

}  // namespace silhouette::benchmarks
