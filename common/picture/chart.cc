#include "common/picture/chart.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/text.h"

namespace silhouette {
namespace {

constexpr int kPlotWidth = 640;   // about
constexpr int kPlotHeight = 560;  // about
constexpr int kLargestCell = 40;
constexpr int kChartMargin = 18;
constexpr int kChartTitle = 20;
constexpr int kChartText = 15;
constexpr int kChartTick = 5;
constexpr int kLeastTickDistance = 56;

cv::Scalar ChartBgr(Colour colour) {
  return {double(colour.blue), double(colour.green), double(colour.red)};
}

void RequireValid(const ConfigurationChart& chart) {
  if (chart.x.cells < 1 || chart.y.cells < 1) throw std::invalid_argument("a chart without cells");
  const size_t cells = static_cast<size_t>(chart.x.cells) * static_cast<size_t>(chart.y.cells);
  if (chart.cells.size() != cells || (!chart.outlined.empty() && chart.outlined.size() != cells)) {
    throw std::invalid_argument("a chart needs x.cells * y.cells cells");
  }
  for (uint8_t cell : chart.cells) {
    if (cell >= chart.classes.size()) throw std::invalid_argument("a cell of an unknown class");
  }
}

int CellSize(int cells, int room) { return std::clamp(room / cells, 1, kLargestCell); }

// The distance between ticks: a round number of `unit` at least kLeastTickDistance pixels apart.
double TickStep(const ChartAxis& axis, int pixels) {
  const double least = (axis.last - axis.first) / std::max(1, pixels) * kLeastTickDistance;
  if (axis.unit == "deg" && least > 0.5) {
    for (double step : {1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0}) {
      if (step >= least) return step;
    }
    return 180;
  }
  const double decade = std::pow(10, std::floor(std::log10(least)));
  for (double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= least) return factor * decade;
  }
  return 10 * decade;
}

// The plot's place in the picture, and how values and cells lie in it.
class Plot {
 public:
  Plot(const ConfigurationChart& chart, cv::Point corner)
      : chart_(chart),
        cell_width_(CellSize(chart.x.cells, kPlotWidth)),
        cell_height_(CellSize(chart.y.cells, kPlotHeight)),
        area_(corner.x, corner.y, cell_width_ * chart.x.cells, cell_height_ * chart.y.cells) {}

  const cv::Rect& area() const { return area_; }

  // The upper left corner of cell (x, y); y = -1 is below the lowest row.
  cv::Point Corner(int x, int y) const {
    return {area_.x + x * cell_width_, area_.y + (chart_.y.cells - 1 - y) * cell_height_};
  }
  cv::Rect Cell(int x, int y) const { return {Corner(x, y), cv::Size(cell_width_, cell_height_)}; }

  double PixelX(double value) const {
    return area_.x + (Place(chart_.x, value) + 0.5) * cell_width_;
  }
  double PixelY(double value) const {
    return area_.y + area_.height - (Place(chart_.y, value) + 0.5) * cell_height_;
  }
  cv::Point At(ChartPoint point) const {
    return {static_cast<int>(std::lround(PixelX(point.x))),
            static_cast<int>(std::lround(PixelY(point.y)))};
  }

 private:
  // Of a value, counted in cells from the middle of the first.
  static double Place(const ChartAxis& axis, double value) {
    if (axis.cells == 1 || axis.last == axis.first) return 0;
    return (value - axis.first) / (axis.last - axis.first) * (axis.cells - 1);
  }

  const ConfigurationChart& chart_;
  int cell_width_;
  int cell_height_;
  cv::Rect area_;
};

std::vector<double> Ticks(const ChartAxis& axis, int pixels) {
  if (axis.label.empty()) return {};
  if (axis.cells == 1 || axis.last <= axis.first) return {axis.first};
  const double step = TickStep(axis, pixels);
  std::vector<double> ticks;
  for (double k = std::ceil(axis.first / step - 1e-9); k * step <= axis.last + 1e-9 * step; ++k) {
    ticks.push_back(k * step);
  }
  return ticks;
}

std::string AxisTitle(const ChartAxis& axis) {
  return axis.unit.empty() || axis.label.empty() ? axis.label
                                                 : absl::StrCat(axis.label, " (", axis.unit, ")");
}

std::string TickLabel(double value) { return absl::StrFormat("%.6g", value == 0 ? 0 : value); }

void DrawAxes(Picture& picture, const ConfigurationChart& chart, const Plot& plot) {
  const cv::Rect& area = plot.area();
  cv::rectangle(picture, cv::Rect(area.x - 1, area.y - 1, area.width + 2, area.height + 2),
                ChartBgr(palette::kInk), 1);
  const int bottom = area.y + area.height;
  for (double value : Ticks(chart.x, area.width)) {
    const int x = static_cast<int>(std::lround(plot.PixelX(value)));
    cv::line(picture, {x, bottom + 1}, {x, bottom + kChartTick}, ChartBgr(palette::kInk));
    DrawText(picture, TickLabel(value), {x, bottom + kChartTick + 3 + kChartText / 2},
             {.height = kChartText, .across = Align::kMiddle});
  }
  for (double value : Ticks(chart.y, area.height)) {
    const int y = static_cast<int>(std::lround(plot.PixelY(value)));
    cv::line(picture, {area.x - kChartTick - 1, y}, {area.x - 2, y}, ChartBgr(palette::kInk));
    DrawText(picture, TickLabel(value), {area.x - kChartTick - 4, y},
             {.height = kChartText, .across = Align::kEnd});
  }
  DrawText(picture, AxisTitle(chart.x),
           {area.x + area.width / 2, bottom + kChartTick + kChartText + 8 + kChartText / 2},
           {.height = kChartText, .across = Align::kMiddle});
  DrawText(picture, AxisTitle(chart.y), {kChartMargin + kChartText / 2, area.y + area.height / 2},
           {.height = kChartText, .across = Align::kMiddle, .upwards = true});
}

void DrawCells(Picture& picture, const ConfigurationChart& chart, const Plot& plot) {
  for (int y = 0; y < chart.y.cells; ++y) {
    for (int x = 0; x < chart.x.cells; ++x) {
      const uint8_t cell = chart.cells[static_cast<size_t>(y * chart.x.cells + x)];
      cv::rectangle(picture, plot.Cell(x, y), ChartBgr(chart.classes[cell].colour), cv::FILLED);
    }
  }
}

void DrawOutline(Picture& picture, const ConfigurationChart& chart, const Plot& plot) {
  const auto in = [&](int x, int y) {
    return chart.outlined[static_cast<size_t>(y * chart.x.cells + x)] != 0;
  };
  const cv::Scalar colour = ChartBgr(chart.outline.colour);
  for (int y = 0; y < chart.y.cells; ++y) {
    for (int x = 0; x < chart.x.cells; ++x) {
      if (x > 0 && in(x, y) != in(x - 1, y)) {
        cv::line(picture, plot.Corner(x, y), plot.Corner(x, y - 1), colour, 2);
      }
      if (y > 0 && in(x, y) != in(x, y - 1)) {
        cv::line(picture, plot.Corner(x, y - 1), plot.Corner(x + 1, y - 1), colour, 2);
      }
    }
  }
}

void ChartDrawMark(Picture& picture, cv::Point place, Colour colour, bool square) {
  constexpr int kRadius = 7;
  const cv::Point half(kRadius, kRadius);
  if (square) {
    cv::rectangle(picture, place - half, place + half, ChartBgr(colour), cv::FILLED, cv::LINE_AA);
    cv::rectangle(picture, place - half, place + half, ChartBgr(palette::kInk), 1, cv::LINE_AA);
  } else {
    cv::circle(picture, place, kRadius, ChartBgr(colour), cv::FILLED, cv::LINE_AA);
    cv::circle(picture, place, kRadius, ChartBgr(palette::kInk), 1, cv::LINE_AA);
  }
}

void DrawPath(Picture& picture, const ConfigurationChart& chart, const Plot& plot) {
  const cv::Scalar colour = ChartBgr(palette::kPath);
  for (const std::vector<ChartPoint>& line : chart.path) {
    for (size_t i = 0; i < line.size(); ++i) {
      const cv::Point here = plot.At(line[i]);
      if (i > 0) cv::line(picture, plot.At(line[i - 1]), here, colour, 2, cv::LINE_AA);
      cv::circle(picture, here, 2, colour, cv::FILLED, cv::LINE_AA);
    }
  }
  if (chart.start) ChartDrawMark(picture, plot.At(*chart.start), palette::kStart, false);
  if (chart.goal) ChartDrawMark(picture, plot.At(*chart.goal), palette::kGoal, true);
}

std::vector<LegendEntry> ChartLegendOf(const ConfigurationChart& chart) {
  std::vector<LegendEntry> legend;
  for (size_t i = 0; i < chart.classes.size(); ++i) {
    if (std::find(chart.cells.begin(), chart.cells.end(), i) != chart.cells.end()) {
      legend.push_back(chart.classes[i]);
    }
  }
  if (!chart.outlined.empty()) legend.push_back(chart.outline);
  if (!chart.path.empty()) legend.push_back({palette::kPath, "path"});
  if (chart.start) legend.push_back({palette::kStart, "start (round)"});
  if (chart.goal) legend.push_back({palette::kGoal, "goal (square)"});
  return legend;
}

}  // namespace

std::vector<LegendEntry> ConfigurationClasses() {
  return {
      {palette::kUnknown, "unknown"}, {palette::kFree, "free"}, {palette::kOccupied, "occupied"}};
}

Picture Draw(const ConfigurationChart& chart) {
  RequireValid(chart);
  int label_width = 0;
  for (double value : Ticks(chart.y, kPlotHeight)) {
    label_width = std::max(label_width, TextWidth(TickLabel(value), kChartText));
  }
  const int left = kChartMargin + kChartText + 8 + label_width + kChartTick + 4;
  const int top = kChartMargin + (chart.title.empty() ? 0 : kChartTitle + 12);
  const Plot plot(chart, {left, top});
  const std::vector<LegendEntry> legend = ChartLegendOf(chart);
  const int width = std::max(left + plot.area().width, left + TextWidth(chart.title, kChartTitle));
  const int below = top + plot.area().height + kChartTick + 2 * kChartText + 22;
  Picture picture = BlankPicture(width + kChartMargin + 8,
                                 below + LegendHeight(legend, width - left) + kChartMargin / 2);
  DrawText(picture, chart.title, {left, kChartMargin + kChartTitle / 2}, {.height = kChartTitle});
  DrawCells(picture, chart, plot);
  if (!chart.outlined.empty()) DrawOutline(picture, chart, plot);
  DrawPath(picture, chart, plot);
  DrawAxes(picture, chart, plot);
  DrawLegend(picture, legend, left, below, width - left);
  return picture;
}

}  // namespace silhouette
