// Where a calibration comes from and how good it was found to be, for people and scripts.
#pragma once

#include <nlohmann/json.hpp>

#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// To stdout; nothing if nothing is known.
void PrintText(const storage::v1::CalibrationRecord& record);

nlohmann::json JsonOf(const storage::v1::CalibrationRecord& record,
                      const storage::v1::CellDescription& cell);

}  // namespace silhouette
