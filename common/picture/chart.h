// SPDX-License-Identifier: Apache-2.0
// Charts over two joints: one coloured cell per configuration, axes with ticks, an outline, a path.
// And charts with lines: values against numbers, one line per series, several panels with one
// legend.
//
//   ConfigurationChart chart;
//   chart.x = {.label = "axis 1", .first = -90, .last = 90, .cells = 37};
//   chart.y = {.label = "axis 3", .first = 0, .last = 120, .cells = 25};
//   chart.classes = ConfigurationClasses();
//   chart.cells = ...;  // 37 * 25 of ConfigurationClass
//   absl::Status status = WritePng("space.png", Draw(chart));
//
//   LineChart panel;
//   panel.title = "pixels that are touched";
//   panel.x_label = "cameras";
//   panel.y_label = "additional configurations (%)";
//   panel.series = {{"calibrated", SeriesColour(0), {{1, 21.1}, {2, 6.8}}}};
//   absl::Status status = WritePng("figure.png", Draw({panel}, {.title = "Figure 7"}));
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

// A line with marks at its points.
struct LineSeries {
  std::string name;
  Colour colour;
  std::vector<ChartPoint> points;
};

// Both axes begin at 0 if no value is below, x at its least value.
struct LineChart {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<LineSeries> series;  // the same place in every panel has the same mark
};

struct LineChartOptions {
  std::string title;
  int columns = 2;
  int width = 460;  // of a panel's plot, in pixels
  int height = 300;
};

// Colours that differ plainly, for the first eight series; then they come again.
Colour SeriesColour(size_t number);

// The panels row by row with one legend of all series by name. ASCII texts. Throws
// std::invalid_argument if there are no panels, or a value is not finite.
Picture Draw(const std::vector<LineChart>& panels, const LineChartOptions& options);

}  // namespace silhouette
