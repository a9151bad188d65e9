// Charts with lines: values against numbers, one line per series, several panels with one legend.
//
//   LineChart panel;
//   panel.title = "pixels that are touched";
//   panel.x_label = "cameras";
//   panel.y_label = "additional configurations (%)";
//   panel.series = {{"calibrated", SeriesColour(0), {{1, 21.1}, {2, 6.8}}}};
//   absl::Status status = WritePng("figure.png", Draw({panel}, {.title = "Figure 7"}));
#pragma once

#include <string>
#include <vector>

#include "common/picture/chart.h"
#include "common/picture/picture.h"

namespace silhouette {

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

// Colours that can be told apart, for the first eight series; then they come again.
Colour SeriesColour(size_t number);

// The panels row by row with one legend of all series by name. ASCII texts. Throws
// std::invalid_argument if there are no panels, or a value is not finite.
Picture Draw(const std::vector<LineChart>& panels, const LineChartOptions& options);

}  // namespace silhouette
