// SPDX-License-Identifier: Apache-2.0
#include "common/text/degrees_hint.h"

#include <cmath>
#include <numbers>

namespace silhouette {

std::string DegreesHint(std::span<const double> values, std::string_view or_else,
                        std::span<const std::optional<bool>> slides) {
  constexpr double kNoAngle = 4 * std::numbers::pi;  // joints hardly turn twice
  constexpr double kMost = 720;
  bool seems_degrees = false;
  for (size_t i = 0; i < values.size(); ++i) {
    const bool turns = i >= slides.size() || !slides[i].value_or(false);
    const double size = std::abs(values[i]);
    seems_degrees = seems_degrees || (turns && size > kNoAngle && size <= kMost);
  }
  if (!seems_degrees) return "";
  return " (joint values are radians; did you mean degrees? Write 90deg" + std::string(or_else) +
         ")";
}

}  // namespace silhouette
