// Small helpers for messages and medians.
#pragma once

#include <string>
#include <vector>

namespace silhouette {

// "a, b, c and 4 more".
std::string FewOf(const std::vector<std::string>& names);

// Infinity of nothing; of an even number the upper of the two in the middle.
double MedianOf(std::vector<double> values);

}  // namespace silhouette
