#include "common/picture/line_chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "absl/strings/str_format.h"
#include "common/picture/text.h"

namespace silhouette {
namespace {

constexpr int kLineChartMargin = 18;
constexpr int kLineChartTitle = 20;
constexpr int kLineChartText = 15;
constexpr int kLineChartTick = 5;
constexpr int kMark = 5;  // half a mark's size
constexpr int kLineChartLegendLine = 24;
constexpr int kLegendSample = 34;
constexpr int kLineChartLegendGap = 24;
constexpr int kMarks = 4;
constexpr double kRoom = 0.06;  // beyond the outer points, as a share of the plot's width

cv::Scalar LineChartBgr(Colour colour) {
  return {double(colour.blue), double(colour.green), double(colour.red)};
}

// A round number such that `span` has about `wanted` of it.
double RoundStep(double span, int wanted) {
  const double least = span / wanted;
  const double decade = std::pow(10, std::floor(std::log10(least)));
  for (double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= least * (1 - 1e-9)) return factor * decade;
  }
  return 10 * decade;
}

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
  range.step = RoundStep(range.to - range.from, ticks);
  if (whole) range.step = std::max(range.step, 1.0);
  if (from_zero) {
    range.from = std::floor(range.from / range.step + 1e-9) * range.step;
    range.to = std::ceil(range.to / range.step - 1e-9) * range.step;
  }
  return range;
}

// The marks of series, told apart without colour.
void LineChartDrawMark(Picture& picture, cv::Point at, size_t series, size_t later, Colour colour) {
  const cv::Scalar ink = LineChartBgr(colour);
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
    const int left = kLineChartText + 12 + LabelWidth() + kLineChartTick + 4;
    const int top = chart_.title.empty() ? kLineChartText / 2 : kLineChartText + 12;
    Picture picture =
        BlankPicture(left + options_.width + 12,
                     top + options_.height + kLineChartTick + 2 * kLineChartText + 16);
    area_ = {left, top, options_.width, options_.height};
    DrawText(picture, chart_.title, {left, kLineChartText / 2}, {.height = kLineChartText + 1});
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
      width = std::max(width, TextWidth(Label(v, y_.step), kLineChartText));
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
      cv::line(picture, {area_.x, y}, {area_.x + area_.width, y},
               LineChartBgr(palette::kBackground));
      cv::line(picture, {area_.x - kLineChartTick, y}, {area_.x, y}, LineChartBgr(palette::kInk));
      DrawText(picture, Label(v, y_.step), {area_.x - kLineChartTick - 4, y},
               {.height = kLineChartText, .across = Align::kEnd});
    }
    for (double v = std::ceil(x_.from / x_.step - 1e-9) * x_.step; v <= x_.to + x_.step * 1e-6;
         v += x_.step) {
      const int x = PixelX(v);
      cv::line(picture, {x, bottom}, {x, bottom + kLineChartTick}, LineChartBgr(palette::kInk));
      DrawText(picture, Label(v, x_.step), {x, bottom + kLineChartTick + 3 + kLineChartText / 2},
               {.height = kLineChartText, .across = Align::kMiddle});
    }
    cv::rectangle(picture, area_, LineChartBgr(palette::kInk), 1);
    DrawText(picture, chart_.x_label,
             {area_.x + area_.width / 2,
              bottom + kLineChartTick + kLineChartText + 6 + kLineChartText / 2},
             {.height = kLineChartText, .across = Align::kMiddle});
    DrawText(picture, chart_.y_label, {kLineChartText / 2 + 2, area_.y + area_.height / 2},
             {.height = kLineChartText, .across = Align::kMiddle, .upwards = true});
  }

  void DrawSeries(Picture& picture, size_t number) const {
    const LineSeries& series = chart_.series[number];
    for (size_t i = 0; i < series.points.size(); ++i) {
      const cv::Point here(PixelX(series.points[i].x), PixelY(series.points[i].y));
      if (i > 0) {
        const ChartPoint& before = series.points[i - 1];
        cv::line(picture, {PixelX(before.x), PixelY(before.y)}, here, LineChartBgr(series.colour),
                 2, cv::LINE_AA);
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
    const int needed = kLegendSample + 6 + TextWidth(entry.name, kLineChartText);
    if (x > 0 && x + needed > width) {
      x = 0;
      ++line;
    }
    if (picture != nullptr) {
      const cv::Point start(left + x, top + line * kLineChartLegendLine + kLineChartLegendLine / 2);
      cv::line(*picture, start, start + cv::Point(kLegendSample, 0), LineChartBgr(entry.colour), 2,
               cv::LINE_AA);
      LineChartDrawMark(*picture, start + cv::Point(kLegendSample / 2, 0), entry.number, 2,
                        entry.colour);
      DrawText(*picture, entry.name, start + cv::Point(kLegendSample + 6, 0),
               {.height = kLineChartText});
    }
    x += needed + kLineChartLegendGap;
  }
  return legend.empty() ? 0 : line + 1;
}

}  // namespace

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
  const int inner = std::max(columns * (width + kLineChartMargin) - kLineChartMargin,
                             TextWidth(options.title, kLineChartTitle));
  const int head = options.title.empty() ? 0 : kLineChartTitle + 14;
  const std::vector<LegendLine> legend = LineChartLegendOf(panels);
  const int legend_height = kLineChartLegendLine * LegendLines(legend, 0, 0, inner, nullptr);
  Picture sheet = BlankPicture(
      inner + 2 * kLineChartMargin,
      2 * kLineChartMargin + head + rows * (height + kLineChartMargin) + legend_height);
  DrawText(sheet, options.title, {kLineChartMargin, kLineChartMargin + kLineChartTitle / 2},
           {.height = kLineChartTitle});
  for (size_t i = 0; i < pictures.size(); ++i) {
    const int column = static_cast<int>(i) % columns;
    const int row = static_cast<int>(i) / columns;
    const cv::Rect place(kLineChartMargin + column * (width + kLineChartMargin),
                         kLineChartMargin + head + row * (height + kLineChartMargin),
                         pictures[i].cols, pictures[i].rows);
    pictures[i].copyTo(sheet(place));
  }
  LegendLines(legend, kLineChartMargin,
              kLineChartMargin + head + rows * (height + kLineChartMargin), inner, &sheet);
  return sheet;
}

}  // namespace silhouette
