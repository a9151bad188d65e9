// SPDX-License-Identifier: Apache-2.0
#include "common/picture/chart.h"

#include <algorithm>
#include <array>
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
constexpr double kRoom = 0.06;  // beside the outer points of lines, as a share of the plot's width

// 1, 2 or 5 times a power of ten, at least `least`.
double RoundStep(double least) {
  const double decade = std::pow(10, std::floor(std::log10(least)));
  for (double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= least * (1 - 1e-9)) return factor * decade;
  }
  return 10 * decade;
}

// An axis of a plot.
struct Axis {
  std::string title;  // empty: no ticks
  double from = 0;    // values
  double to = 0;
  double step = 1;     // between ticks
  double at_from = 0;  // pixels
  double at_to = 0;

  int Pixel(double value) const {
    const double share = to > from ? (value - from) / (to - from) : 0;
    return static_cast<int>(std::lround(at_from + share * (at_to - at_from)));
  }

  std::vector<double> Ticks() const {
    if (title.empty()) return {};
    if (!(to > from)) return {from};
    std::vector<double> ticks;
    for (double k = std::ceil(from / step - 1e-9); k * step <= to + 1e-9 * step; ++k) {
      ticks.push_back(k == 0 ? 0 : k * step);
    }
    return ticks;
  }
};

std::string TickLabel(double value) { return absl::StrFormat("%.6g", value); }

// The width of a vertical axis's labels.
int LabelWidth(const Axis& axis) {
  int width = 0;
  for (double value : axis.Ticks())
    width = std::max(width, TextWidth(TickLabel(value), kChartText));
  return width;
}

// What a vertical axis takes to the left of the plot, and a horizontal one below it.
int LeftOfPlot(const Axis& axis) { return kChartText + 8 + LabelWidth(axis) + kChartTick + 4; }
constexpr int kBelowPlot = kChartTick + 2 * kChartText + 22;

void DrawAxes(Picture& picture, const cv::Rect& area, const Axis& x, const Axis& y) {
  const cv::Scalar ink = BgrOf(palette::kInk);
  cv::rectangle(picture, area - cv::Point(1, 1) + cv::Size(2, 2), ink, 1);
  const int bottom = area.y + area.height;
  for (double value : x.Ticks()) {
    const int place = x.Pixel(value);
    cv::line(picture, {place, bottom + 1}, {place, bottom + kChartTick}, ink);
    DrawText(picture, TickLabel(value), {place, bottom + kChartTick + 3 + kChartText / 2},
             {.height = kChartText, .across = Align::kMiddle});
  }
  for (double value : y.Ticks()) {
    const int place = y.Pixel(value);
    cv::line(picture, {area.x - kChartTick - 1, place}, {area.x - 2, place}, ink);
    DrawText(picture, TickLabel(value), {area.x - kChartTick - 4, place},
             {.height = kChartText, .across = Align::kEnd});
  }
  DrawText(picture, x.title,
           {area.x + area.width / 2, bottom + kChartTick + kChartText + 8 + kChartText / 2},
           {.height = kChartText, .across = Align::kMiddle});
  DrawText(picture, y.title, {area.x - LeftOfPlot(y) + kChartText / 2, area.y + area.height / 2},
           {.height = kChartText, .across = Align::kMiddle, .upwards = true});
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

// The axis over cells of `size` pixels, from pixel 0 on. Its ends are the middles of the outer
// cells; its ticks are round numbers of the unit at least kLeastTickDistance pixels apart.
Axis AxisOf(const ChartAxis& chart, int size) {
  const double least =
      (chart.last - chart.first) / std::max(1, size * chart.cells) * kLeastTickDistance;
  double step = least > 0 ? RoundStep(least) : 1;
  if (chart.unit == "deg" && least > 0.5) {
    constexpr std::array kSteps = {1, 2, 5, 10, 15, 30, 45, 90};
    const auto found = std::ranges::find_if(kSteps, [&](int each) { return each >= least; });
    step = found == kSteps.end() ? 180 : *found;
  }
  return {.title = chart.unit.empty() || chart.label.empty()
                       ? chart.label
                       : absl::StrCat(chart.label, " (", chart.unit, ")"),
          .from = chart.first,
          .to = chart.cells == 1 ? chart.first : chart.last,
          .step = step,
          .at_from = 0.5 * size,
          .at_to = (chart.cells - 0.5) * size};
}

// The plot of a chart over two joints.
class Plot {
 public:
  explicit Plot(const ConfigurationChart& chart)
      : chart_(chart),
        cell_(std::clamp(kPlotWidth / chart.x.cells, 1, kLargestCell),
              std::clamp(kPlotHeight / chart.y.cells, 1, kLargestCell)),
        x_(AxisOf(chart.x, cell_.width)),
        y_(AxisOf(chart.y, cell_.height)),
        area_(kChartMargin + LeftOfPlot(y_),
              kChartMargin + (chart.title.empty() ? 0 : kChartTitle + 12),
              cell_.width * chart.x.cells, cell_.height * chart.y.cells) {
    x_.at_from += area_.x;
    x_.at_to += area_.x;
    y_.at_from = area_.y + area_.height - y_.at_from;
    y_.at_to = area_.y + area_.height - y_.at_to;
  }

  const cv::Rect& area() const { return area_; }

  void Draw(Picture& picture) const {
    for (int y = 0; y < chart_.y.cells; ++y) {
      for (int x = 0; x < chart_.x.cells; ++x) {
        const Colour colour = chart_.classes[Of(chart_.cells, x, y)].colour;
        cv::rectangle(picture, cv::Rect(Corner(x, y), cell_), BgrOf(colour), cv::FILLED);
      }
    }
    if (!chart_.outlined.empty()) DrawOutline(picture);
    DrawPath(picture);
    DrawAxes(picture, area_, x_, y_);
  }

 private:
  uint8_t Of(const std::vector<uint8_t>& cells, int x, int y) const {
    return cells[static_cast<size_t>(y * chart_.x.cells + x)];
  }

  // The upper left corner of cell (x, y); y = -1 is below the lowest row.
  cv::Point Corner(int x, int y) const {
    return {area_.x + x * cell_.width, area_.y + (chart_.y.cells - 1 - y) * cell_.height};
  }

  cv::Point At(ChartPoint point) const { return {x_.Pixel(point.x), y_.Pixel(point.y)}; }

  void DrawOutline(Picture& picture) const {
    const cv::Scalar colour = BgrOf(chart_.outline.colour);
    const auto in = [&](int x, int y) { return Of(chart_.outlined, x, y) != 0; };
    for (int y = 0; y < chart_.y.cells; ++y) {
      for (int x = 0; x < chart_.x.cells; ++x) {
        if (x > 0 && in(x, y) != in(x - 1, y)) {
          cv::line(picture, Corner(x, y), Corner(x, y - 1), colour, 2);
        }
        if (y > 0 && in(x, y) != in(x, y - 1)) {
          cv::line(picture, Corner(x, y - 1), Corner(x + 1, y - 1), colour, 2);
        }
      }
    }
  }

  void DrawPath(Picture& picture) const {
    const cv::Scalar colour = BgrOf(palette::kPath);
    for (const std::vector<ChartPoint>& line : chart_.path) {
      for (size_t i = 0; i < line.size(); ++i) {
        if (i > 0) cv::line(picture, At(line[i - 1]), At(line[i]), colour, 2, cv::LINE_AA);
        cv::circle(picture, At(line[i]), 2, colour, cv::FILLED, cv::LINE_AA);
      }
    }
    constexpr int kRadius = 7;
    constexpr size_t kRound = 0;
    constexpr size_t kSquare = 1;
    if (chart_.start) {
      DrawMark(picture, At(*chart_.start), kRadius + 1, kRound, palette::kInk);
      DrawMark(picture, At(*chart_.start), kRadius, kRound, palette::kStart);
    }
    if (chart_.goal) {
      DrawMark(picture, At(*chart_.goal), kRadius + 3, kSquare, palette::kInk);
      DrawMark(picture, At(*chart_.goal), kRadius + 2, kSquare, palette::kGoal);
    }
  }

  const ConfigurationChart& chart_;
  const cv::Size cell_;
  Axis x_;
  Axis y_;
  const cv::Rect area_;
};

std::vector<LegendEntry> LegendOf(const ConfigurationChart& chart) {
  std::vector<LegendEntry> legend;
  for (size_t i = 0; i < chart.classes.size(); ++i) {
    if (std::ranges::find(chart.cells, i) != chart.cells.end()) legend.push_back(chart.classes[i]);
  }
  if (!chart.outlined.empty()) legend.push_back(chart.outline);
  if (!chart.path.empty()) legend.push_back({palette::kPath, "path"});
  if (chart.start) legend.push_back({palette::kStart, "start (round)"});
  if (chart.goal) legend.push_back({palette::kGoal, "goal (square)"});
  return legend;
}

// The axis over one coordinate of all points, with about `ticks` ticks.
Axis AxisOver(const LineChart& chart, const std::string& title, double ChartPoint::*coordinate,
              int ticks, bool from_zero) {
  std::vector<double> values;
  for (const LineSeries& series : chart.series) {
    for (const ChartPoint& point : series.points) values.push_back(point.*coordinate);
  }
  if (!std::ranges::all_of(values, [](double value) { return std::isfinite(value); })) {
    throw std::invalid_argument("a chart's value is not finite");
  }
  Axis axis{.title = title};
  if (!values.empty()) {
    axis.from = std::ranges::min(values);
    axis.to = std::ranges::max(values);
  }
  if (from_zero) axis.from = std::min(axis.from, 0.0);
  if (!(axis.to > axis.from)) axis.to = axis.from + 1;
  axis.step = RoundStep((axis.to - axis.from) / ticks);
  if (std::ranges::all_of(values, [](double value) { return value == std::round(value); })) {
    axis.step = std::max(axis.step, 1.0);
  }
  if (from_zero) {
    axis.from = std::floor(axis.from / axis.step + 1e-9) * axis.step;
    axis.to = std::ceil(axis.to / axis.step - 1e-9) * axis.step;
  }
  return axis;
}

Picture DrawPanel(const LineChart& chart, const LineChartOptions& options) {
  Axis x = AxisOver(chart, chart.x_label, &ChartPoint::x, 8, false);
  Axis y = AxisOver(chart, chart.y_label, &ChartPoint::y, 5, true);
  const cv::Rect area(LeftOfPlot(y) + 4, chart.title.empty() ? kChartText / 2 : kChartText + 12,
                      options.width, options.height);
  x.at_from = area.x + kRoom * area.width;
  x.at_to = area.x + (1 - kRoom) * area.width;
  y.at_from = area.y + area.height;
  y.at_to = area.y;
  Picture picture = BlankPicture(area.x + area.width + 12, area.y + area.height + kBelowPlot - 6);
  DrawText(picture, chart.title, {area.x, kChartText / 2}, {.height = kChartText + 1});
  for (double value : y.Ticks()) {
    cv::line(picture, {area.x, y.Pixel(value)}, {area.x + area.width, y.Pixel(value)},
             BgrOf(palette::kBackground));
  }
  DrawAxes(picture, area, x, y);
  for (size_t number = 0; number < chart.series.size(); ++number) {
    const LineSeries& series = chart.series[number];
    // Larger marks lie below smaller ones.
    const size_t later = chart.series.size() - 1 - number;
    const int radius = 5 + static_cast<int>(std::min<size_t>(later, 5));
    std::optional<cv::Point> before;
    for (const ChartPoint& point : series.points) {
      const cv::Point here(x.Pixel(point.x), y.Pixel(point.y));
      if (before) cv::line(picture, *before, here, BgrOf(series.colour), 2, cv::LINE_AA);
      DrawMark(picture, here, radius, number, series.colour);
      before = here;
    }
  }
  return picture;
}

}  // namespace

std::vector<LegendEntry> ConfigurationClasses() {
  return {
      {palette::kUnknown, "unknown"}, {palette::kFree, "free"}, {palette::kOccupied, "occupied"}};
}

Picture Draw(const ConfigurationChart& chart) {
  RequireValid(chart);
  const Plot plot(chart);
  const cv::Rect& area = plot.area();
  const std::vector<LegendEntry> legend = LegendOf(chart);
  const int width = std::max(area.width, TextWidth(chart.title, kChartTitle));
  const int below = area.y + area.height + kBelowPlot;
  Picture picture = BlankPicture(area.x + width + kChartMargin + 8,
                                 below + LegendHeight(legend, width) + kChartMargin / 2);
  DrawText(picture, chart.title, {area.x, kChartMargin + kChartTitle / 2}, {.height = kChartTitle});
  plot.Draw(picture);
  DrawLegend(picture, legend, area.x, below, width);
  return picture;
}

Colour SeriesColour(size_t number) {
  static constexpr std::array<Colour, 8> kColours = {
      Colour{0, 0, 0},       Colour{0, 114, 178},  Colour{213, 94, 0},  Colour{0, 158, 115},
      Colour{204, 121, 167}, Colour{86, 180, 233}, Colour{230, 159, 0}, Colour{140, 140, 140}};
  return kColours[number % kColours.size()];
}

Picture Draw(const std::vector<LineChart>& panels, const LineChartOptions& options) {
  if (panels.empty() || options.columns < 1 || options.width < 1 || options.height < 1) {
    throw std::invalid_argument("a chart needs panels, columns and a size");
  }
  SheetOptions sheet{.title = options.title,
                     .columns = std::min(options.columns, static_cast<int>(panels.size())),
                     .legend = {}};
  std::vector<CaptionedPicture> pictures;
  for (const LineChart& panel : panels) {
    pictures.push_back({DrawPanel(panel, options), ""});
    for (size_t i = 0; i < panel.series.size(); ++i) {
      const LineSeries& series = panel.series[i];
      const bool known = std::ranges::any_of(
          sheet.legend, [&](const LegendEntry& entry) { return entry.text == series.name; });
      if (!known) sheet.legend.push_back({series.colour, series.name, i});
    }
  }
  return ContactSheet(pictures, sheet);
}

}  // namespace silhouette
