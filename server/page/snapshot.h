// SPDX-License-Identifier: Apache-2.0
// What the page shows of one moment, as JSON. It comes from the functions that answer the RPCs:
// messages of the API stand in it as the API's JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/service/serving.h"

namespace silhouette {

// Which slice of the configuration space: the joints along both axes, by their place in the grid,
// and the grid steps of the others; nothing: where the robot is.
struct SliceChoice {
  int x = 0;
  int y = 1;
  std::vector<std::optional<int>> at;
};

// Of the texts "0", "1" and "3,,7"; an empty text leaves the default. InvalidArgument: it is none
// of these. Whether the grid has these joints and steps is not asked: what it has not is replaced
// by what it has.
absl::StatusOr<SliceChoice> SliceChoiceFrom(const std::string& x, const std::string& y,
                                            const std::string& at);

// The moment now. What is not known is null, "unknown", or the letter 'u' among the cells, and so
// is all that nothing can rest on when this is ready. Takes up to 0.1 s beyond what a look at the
// index takes, if maps have to be worked out.
nlohmann::json PageSnapshot(Serving& serving, const SliceChoice& choice);

}  // namespace silhouette
