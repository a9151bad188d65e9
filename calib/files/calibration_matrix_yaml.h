// Parts of the calibration's YAML files that several of them have.
#pragma once

#include "common/yaml/strict_yaml.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// The place of the view that `node` names; throws YamlError, naming those that are there.
int ViewByName(const YamlNode& node, const storage::v1::CellDescription& cell);

// The list of calibration_matrix_file.h; throws YamlError.
storage::v1::Calibration MatricesFromYaml(const YamlNode& list,
                                          const storage::v1::CellDescription& cell);

}  // namespace silhouette
