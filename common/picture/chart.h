// Charts over two joints: one coloured cell per configuration, axes with ticks, an outline, a path.
//
//   ConfigurationChart chart;
//   chart.x = {.label = "axis 1", .first = -90, .last = 90, .cells = 37};
//   chart.y = {.label = "axis 3", .first = 0, .last = 120, .cells = 25};
//   chart.classes = ConfigurationClasses();
//   chart.cells = ...;  // 37 * 25 of ConfigurationClass
//   absl::Status status = WritePng("space.png", Draw(chart));
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/picture/picture.h"
#include "common/picture/sheet.h"

namespace silhouette {

// The values along an axis: `cells` of them, evenly spread from `first` to `last`. Without a label
// the axis has no ticks.
struct ChartAxis {
  std::string label;
  std::string unit = "deg";
  double first = 0;
  double last = 0;
  int cells = 1;
};

// A place in the units of the axes; it need not be a cell's middle.
struct ChartPoint {
  double x = 0;
  double y = 0;
};

// The classes of ConfigurationClasses(), in its order.
enum ConfigurationClass : uint8_t { kUnknownCell = 0, kFreeCell = 1, kOccupiedCell = 2 };
std::vector<LegendEntry> ConfigurationClasses();

struct ConfigurationChart {
  std::string title;
  ChartAxis x;
  ChartAxis y;  // grows upwards

  // What a cell can be; those that occur are in the legend.
  std::vector<LegendEntry> classes;
  // x.cells * y.cells indices into `classes`, x running fastest, from the lower left.
  std::vector<uint8_t> cells;

  // The boundary of this set of cells is drawn as a line; empty: none. As many as `cells`, 0 or 1.
  std::vector<uint8_t> outlined;
  LegendEntry outline{palette::kTruth, "truth's boundary"};

  // Lines with dots at their points. A path that leaves the chart at one rim and comes back at the
  // other is two of them.
  std::vector<std::vector<ChartPoint>> path;
  std::optional<ChartPoint> start;
  std::optional<ChartPoint> goal;
};

// Throws std::invalid_argument if the counts or the classes of cells do not fit.
Picture Draw(const ConfigurationChart& chart);

}  // namespace silhouette
