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

// 1, 2 or 5 times a power of ten, at least `least`.
double RoundStep(double least) {
  const double decade = std::pow(10, std::floor(std::log10(least)));
  for (double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= least * (1 - 1e-9)) return factor * decade;
  }
  return 10 * decade;
}

// The distance between ticks: a round number of `unit` at least kLeastTickDistance pixels apart.
double TickStep(const ChartAxis& axis, int pixels) {
  const double least = (axis.last - axis.first) / std::max(1, pixels) * kLeastTickDistance;
  if (axis.unit == "deg" && least > 0.5) {
    for (double step : {1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0}) {
      if (step >= least) return step;
    }
    return 180;
  }
  return RoundStep(least);
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
                BgrOf(palette::kInk), 1);
  const int bottom = area.y + area.height;
  for (double value : Ticks(chart.x, area.width)) {
    const int x = static_cast<int>(std::lround(plot.PixelX(value)));
    cv::line(picture, {x, bottom + 1}, {x, bottom + kChartTick}, BgrOf(palette::kInk));
    DrawText(picture, TickLabel(value), {x, bottom + kChartTick + 3 + kChartText / 2},
             {.height = kChartText, .across = Align::kMiddle});
  }
  for (double value : Ticks(chart.y, area.height)) {
    const int y = static_cast<int>(std::lround(plot.PixelY(value)));
    cv::line(picture, {area.x - kChartTick - 1, y}, {area.x - 2, y}, BgrOf(palette::kInk));
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
      cv::rectangle(picture, plot.Cell(x, y), BgrOf(chart.classes[cell].colour), cv::FILLED);
    }
  }
}

void DrawOutline(Picture& picture, const ConfigurationChart& chart, const Plot& plot) {
  const auto in = [&](int x, int y) {
    return chart.outlined[static_cast<size_t>(y * chart.x.cells + x)] != 0;
  };
  const cv::Scalar colour = BgrOf(chart.outline.colour);
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
    cv::rectangle(picture, place - half, place + half, BgrOf(colour), cv::FILLED, cv::LINE_AA);
    cv::rectangle(picture, place - half, place + half, BgrOf(palette::kInk), 1, cv::LINE_AA);
  } else {
    cv::circle(picture, place, kRadius, BgrOf(colour), cv::FILLED, cv::LINE_AA);
    cv::circle(picture, place, kRadius, BgrOf(palette::kInk), 1, cv::LINE_AA);
  }
}

void DrawPath(Picture& picture, const ConfigurationChart& chart, const Plot& plot) {
  const cv::Scalar colour = BgrOf(palette::kPath);
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

constexpr int kMark = 5;  // half a mark's size
constexpr int kLineChartLegendLine = 24;
constexpr int kLegendSample = 34;
constexpr int kLineChartLegendGap = 24;
constexpr int kMarks = 4;
constexpr double kRoom = 0.06;  // beyond the outer points, as a share of the plot's width

struct Range {
  double from = 0;
  double to = 1;
  double step = 1;
};

template <typename Value>
Range RangeOf(const LineChart& chart, int ticks, bool from_zero, Value value) {
  bool any = false;
  bool whole = true;
  Range range;
  for (const LineSeries& series : chart.series) {
    for (const ChartPoint& point : series.points) {
      const double v = value(point);
      if (!std::isfinite(v)) throw std::invalid_argument("a chart's value is not finite");
      range.from = any ? std::min(range.from, v) : v;
      range.to = any ? std::max(range.to, v) : v;
      any = true;
      whole = whole && v == std::round(v);
    }
  }
  if (from_zero) range.from = std::min(range.from, 0.0);
  if (!any || !(range.to > range.from)) range.to = range.from + 1;
  range.step = RoundStep((range.to - range.from) / ticks);
  if (whole) range.step = std::max(range.step, 1.0);
  if (from_zero) {
    range.from = std::floor(range.from / range.step + 1e-9) * range.step;
    range.to = std::ceil(range.to / range.step - 1e-9) * range.step;
  }
  return range;
}

// The marks of series, which differ without colour, too.
void LineChartDrawMark(Picture& picture, cv::Point at, size_t series, size_t later, Colour colour) {
  const cv::Scalar ink = BgrOf(colour);
  const int r = kMark + static_cast<int>(std::min<size_t>(later, 5));
  switch (series % kMarks) {
    case 0:
      cv::circle(picture, at, r, ink, cv::FILLED, cv::LINE_AA);
      return;
    case 1:
      cv::rectangle(picture, at - cv::Point(r - 1, r - 1), at + cv::Point(r - 1, r - 1), ink,
                    cv::FILLED);
      return;
    case 2: {
      const std::array<cv::Point, 3> triangle = {
          at + cv::Point(0, -r - 1), at + cv::Point(r + 1, r), at + cv::Point(-r - 1, r)};
      cv::fillConvexPoly(picture, triangle.data(), 3, ink, cv::LINE_AA);
      return;
    }
    default: {
      const std::array<cv::Point, 4> diamond = {at + cv::Point(0, -r - 1), at + cv::Point(r + 1, 0),
                                                at + cv::Point(0, r + 1),
                                                at + cv::Point(-r - 1, 0)};
      cv::fillConvexPoly(picture, diamond.data(), 4, ink, cv::LINE_AA);
    }
  }
}

class Panel {
 public:
  Panel(const LineChart& chart, const LineChartOptions& options)
      : chart_(chart),
        options_(options),
        x_(RangeOf(chart, 8, false, [](const ChartPoint& p) { return p.x; })),
        y_(RangeOf(chart, 5, true, [](const ChartPoint& p) { return p.y; })) {}

  Picture Draw() const {
    const int left = kChartText + 12 + LabelWidth() + kChartTick + 4;
    const int top = chart_.title.empty() ? kChartText / 2 : kChartText + 12;
    Picture picture = BlankPicture(left + options_.width + 12,
                                   top + options_.height + kChartTick + 2 * kChartText + 16);
    area_ = {left, top, options_.width, options_.height};
    DrawText(picture, chart_.title, {left, kChartText / 2}, {.height = kChartText + 1});
    DrawAxes(picture);
    for (size_t i = 0; i < chart_.series.size(); ++i) DrawSeries(picture, i);
    return picture;
  }

 private:
  static std::string Label(double value, double step) {
    return absl::StrFormat("%.6g", std::abs(value) < step / 1000 ? 0 : value);
  }

  int LabelWidth() const {
    int width = 0;
    for (double v = y_.from; v <= y_.to + y_.step / 2; v += y_.step) {
      width = std::max(width, TextWidth(Label(v, y_.step), kChartText));
    }
    return width;
  }

  int PixelX(double x) const {
    const double share = kRoom + (1 - 2 * kRoom) * (x - x_.from) / (x_.to - x_.from);
    return area_.x + static_cast<int>(std::lround(share * area_.width));
  }
  int PixelY(double y) const {
    return area_.y + area_.height -
           static_cast<int>(std::lround((y - y_.from) / (y_.to - y_.from) * area_.height));
  }

  void DrawAxes(Picture& picture) const {
    const int bottom = area_.y + area_.height;
    for (double v = y_.from; v <= y_.to + y_.step / 2; v += y_.step) {
      const int y = PixelY(v);
      cv::line(picture, {area_.x, y}, {area_.x + area_.width, y}, BgrOf(palette::kBackground));
      cv::line(picture, {area_.x - kChartTick, y}, {area_.x, y}, BgrOf(palette::kInk));
      DrawText(picture, Label(v, y_.step), {area_.x - kChartTick - 4, y},
               {.height = kChartText, .across = Align::kEnd});
    }
    for (double v = std::ceil(x_.from / x_.step - 1e-9) * x_.step; v <= x_.to + x_.step * 1e-6;
         v += x_.step) {
      const int x = PixelX(v);
      cv::line(picture, {x, bottom}, {x, bottom + kChartTick}, BgrOf(palette::kInk));
      DrawText(picture, Label(v, x_.step), {x, bottom + kChartTick + 3 + kChartText / 2},
               {.height = kChartText, .across = Align::kMiddle});
    }
    cv::rectangle(picture, area_, BgrOf(palette::kInk), 1);
    DrawText(picture, chart_.x_label,
             {area_.x + area_.width / 2, bottom + kChartTick + kChartText + 6 + kChartText / 2},
             {.height = kChartText, .across = Align::kMiddle});
    DrawText(picture, chart_.y_label, {kChartText / 2 + 2, area_.y + area_.height / 2},
             {.height = kChartText, .across = Align::kMiddle, .upwards = true});
  }

  void DrawSeries(Picture& picture, size_t number) const {
    const LineSeries& series = chart_.series[number];
    for (size_t i = 0; i < series.points.size(); ++i) {
      const cv::Point here(PixelX(series.points[i].x), PixelY(series.points[i].y));
      if (i > 0) {
        const ChartPoint& before = series.points[i - 1];
        cv::line(picture, {PixelX(before.x), PixelY(before.y)}, here, BgrOf(series.colour), 2,
                 cv::LINE_AA);
      }
      LineChartDrawMark(picture, here, number, chart_.series.size() - 1 - number, series.colour);
    }
  }

  const LineChart& chart_;
  const LineChartOptions& options_;
  Range x_;
  Range y_;
  mutable cv::Rect area_;
};

struct LegendLine {
  std::string name;
  Colour colour;
  size_t number;
};

std::vector<LegendLine> LineChartLegendOf(const std::vector<LineChart>& panels) {
  std::vector<LegendLine> legend;
  for (const LineChart& panel : panels) {
    for (size_t i = 0; i < panel.series.size(); ++i) {
      const LineSeries& series = panel.series[i];
      const bool known = std::any_of(legend.begin(), legend.end(), [&](const LegendLine& line) {
        return line.name == series.name;
      });
      if (!known) legend.push_back({series.name, series.colour, i});
    }
  }
  return legend;
}

// Draws into `picture`, or only counts the lines it takes if there is none.
int LegendLines(const std::vector<LegendLine>& legend, int left, int top, int width,
                Picture* picture) {
  int x = 0;
  int line = 0;
  for (const LegendLine& entry : legend) {
    const int needed = kLegendSample + 6 + TextWidth(entry.name, kChartText);
    if (x > 0 && x + needed > width) {
      x = 0;
      ++line;
    }
    if (picture != nullptr) {
      const cv::Point start(left + x, top + line * kLineChartLegendLine + kLineChartLegendLine / 2);
      cv::line(*picture, start, start + cv::Point(kLegendSample, 0), BgrOf(entry.colour), 2,
               cv::LINE_AA);
      LineChartDrawMark(*picture, start + cv::Point(kLegendSample / 2, 0), entry.number, 2,
                        entry.colour);
      DrawText(*picture, entry.name, start + cv::Point(kLegendSample + 6, 0),
               {.height = kChartText});
    }
    x += needed + kLineChartLegendGap;
  }
  return legend.empty() ? 0 : line + 1;
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
  std::vector<Picture> pictures;
  int width = 0;
  int height = 0;
  for (const LineChart& panel : panels) {
    pictures.push_back(Panel(panel, options).Draw());
    width = std::max(width, pictures.back().cols);
    height = std::max(height, pictures.back().rows);
  }
  const int columns = std::min(options.columns, static_cast<int>(panels.size()));
  const int rows = (static_cast<int>(panels.size()) + columns - 1) / columns;
  const int inner = std::max(columns * (width + kChartMargin) - kChartMargin,
                             TextWidth(options.title, kChartTitle));
  const int head = options.title.empty() ? 0 : kChartTitle + 14;
  const std::vector<LegendLine> legend = LineChartLegendOf(panels);
  const int legend_height = kLineChartLegendLine * LegendLines(legend, 0, 0, inner, nullptr);
  Picture sheet =
      BlankPicture(inner + 2 * kChartMargin,
                   2 * kChartMargin + head + rows * (height + kChartMargin) + legend_height);
  DrawText(sheet, options.title, {kChartMargin, kChartMargin + kChartTitle / 2},
           {.height = kChartTitle});
  for (size_t i = 0; i < pictures.size(); ++i) {
    const int column = static_cast<int>(i) % columns;
    const int row = static_cast<int>(i) / columns;
    const cv::Rect place(kChartMargin + column * (width + kChartMargin),
                         kChartMargin + head + row * (height + kChartMargin), pictures[i].cols,
                         pictures[i].rows);
    pictures[i].copyTo(sheet(place));
  }
  LegendLines(legend, kChartMargin, kChartMargin + head + rows * (height + kChartMargin), inner,
              &sheet);
  return sheet;
}

}  // namespace silhouette
