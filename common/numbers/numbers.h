// SPDX-License-Identifier: Apache-2.0
// Sums that many places need.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace silhouette {

// `part` in percent of `whole`; 0 if `whole` is 0.
template <typename Part, typename Whole>
double Percent(Part part, Whole whole) {
  return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

// The largest of 1, 2 and 5 times a power of ten that is not above `value`, which is positive.
inline double RoundBelow(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {5.0, 2.0}) {
    if (step * power <= value) return step * power;
  }
  return power;
}

// The upper of two middle values; `of_nothing` of nothing.
inline double Median(std::vector<double> values, double of_nothing = 0) {
  if (values.empty()) return of_nothing;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}
// The same; infinity of nothing.
inline double MedianOrInfinity(std::vector<double> values) {
  return Median(std::move(values), std::numeric_limits<double>::infinity());
}

}  // namespace silhouette
