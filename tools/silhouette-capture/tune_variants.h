// The settings that silhouette-capture tune compares.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/segmentation/settings.h"
#include "db/store/store.h"

namespace silhouette {

struct TuneVariant {
  std::string name;  // what was asked for, e.g. "faint_side: 7"
  SegmentationSettings settings;
};

// First what the database's masks were made with, then those of the cell file where they differ;
// then one for each of `tries`, keys of the section `segmentation` that change those of the cell
// file. Without tries a lower and a higher value of each setting that matters. InvalidArgument,
// naming it, if one of `tries` has unknown keys, is not valid, or changes nothing.
absl::StatusOr<std::vector<TuneVariant>> TuneVariants(const storage::v1::CellDescription& database,
                                                      const SegmentationSettings& of_cell_file,
                                                      const std::vector<std::string>& tries);

}  // namespace silhouette
