// SPDX-License-Identifier: Apache-2.0
// What `fundamental` reads of its views, and how it says what it has found of their pairs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/sighting_file.h"
#include "calib/fundamental/view_pairs.h"

namespace silhouette {

// Sources of the views; empty: not given.
struct ViewSources {
  std::string cell;     // cell.yaml: names and sizes
  std::string cameras;  // folder of .cameramodel files
  std::string image_size;
  std::string mask_size;
};

// In the order of the cell, else of the cameras' files, else of the sightings. InvalidArgument or
// NotFound in a sentence: an unspecified size, a camera that is missing or for another size, a
// sighting of a view that is not there or beyond its image, less than two views.
absl::StatusOr<std::vector<PairedView>> PairedViews(const ViewSources& sources,
                                                    std::span<const TagSighting> sightings);

// In words. `refusals`: whether matrices are wanted, so that it matters which must not be used.
std::string PairsText(const std::vector<PairedView>& views, const std::vector<PairResult>& pairs,
                      bool refusals);

nlohmann::ordered_json PairsJson(const std::vector<PairedView>& views,
                                 const std::vector<PairResult>& pairs);

}  // namespace silhouette
