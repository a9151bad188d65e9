// SPDX-License-Identifier: Apache-2.0
// Whether joint values seem to be in degrees.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace silhouette {

// What to add to what is said of values in radians: a question if degrees seem to be meant, else
// nothing. `or_else`: what else mends it, as ", or give --degrees"; `slides`: of each joint,
// whose values are metres then.
std::string DegreesHint(std::span<const double> values, std::string_view or_else = "",
                        std::span<const std::optional<bool>> slides = {});

}  // namespace silhouette
