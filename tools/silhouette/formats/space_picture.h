// The configuration space of two joints as a chart (Figure 8).
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/picture/chart.h"
#include "silhouette/configuration_space.h"

namespace silhouette {

// InvalidArgument if the grid has not two joints. Axes in degrees. With clearance levels free cells
// are shaded by the greatest that they exceed.
absl::StatusOr<ConfigurationChart> ChartOf(const client::ConfigurationSpace& space,
                                           const std::string& title);

// A place in the chart of this grid of two joints: continuous joints wrapped into it.
ChartPoint ChartPointOf(const ConfigurationGrid& grid, const Configuration& configuration);

// The path in the chart of this grid of two joints, in pieces where it goes over the rim of a
// continuous joint.
std::vector<std::vector<ChartPoint>> ChartLines(const ConfigurationGrid& grid,
                                                const std::vector<Configuration>& waypoints);

}  // namespace silhouette
