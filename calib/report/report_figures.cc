// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/report/report_page.h"
#include "calib/report/view_errors.h"
#include "common/numbers/numbers.h"
#include "common/result/page.h"

namespace silhouette {
namespace {

constexpr double kWidth = 360;       // of a view's map, in units of the figure
constexpr double kLegend = 26;       // height below it
constexpr double kTypical = 13;      // length of a root-mean-square residual
constexpr size_t kMostArrows = 700;  // that are drawn

double HeightOf(const ReportView& view) { return kWidth * view.height / view.width; }

// `rest`: what follows the attributes of its place, with the element's end.
std::string Rect(double x, double y, double width, double height, const std::string& rest) {
  return absl::StrFormat("<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\" %s\n", x, y,
                         width, height, rest);
}

// `more`: attributes.
std::string Text(double x, double y, const std::string& text, const char* more = "") {
  return absl::StrFormat("<text x=\"%.1f\" y=\"%.1f\" %s>%s</text>\n", x, y, more, text);
}

std::string Begin(const ReportView& view, const std::string& says) {
  return absl::StrFormat(
      "<svg class=\"map\" viewBox=\"0 0 %.0f %.1f\" role=\"img\" aria-label=\"%s\">\n%s", kWidth,
      HeightOf(view) + kLegend, Escaped(says),
      Rect(0, 0, kWidth, HeightOf(view), "class=\"field\"/>"));
}

std::string Frame(const ReportView& view) {
  return Rect(0.5, 0.5, kWidth - 1, HeightOf(view) - 1, "class=\"frame\"/>");
}

// From a light to a dark shade of a colour.
std::string Shade(double share, const std::array<int, 3>& dark) {
  const double s = 0.08 + 0.92 * std::clamp(share, 0.0, 1.0);
  const auto mix = [&](int colour) {
    return static_cast<int>(std::lround(255 + s * (colour - 255)));
  };
  return absl::StrFormat("#%02x%02x%02x", mix(dark[0]), mix(dark[1]), mix(dark[2]));
}
constexpr std::array<int, 3> kBlue = {0, 88, 150};
constexpr std::array<int, 3> kRed = {178, 58, 20};

// The fields of a map, each as `fill` paints it; empty: not at all.
template <typename Fill>
std::string Fields(const ReportView& view, const Fill& fill) {
  std::string svg;
  const double width = kWidth / view.map.columns;
  const double height = HeightOf(view) / view.map.rows;
  for (size_t i = 0; i < view.map.cells.size(); ++i) {
    const std::string paint = fill(view.map.cells[i]);
    if (paint.empty()) continue;
    const auto column = static_cast<int>(i) % view.map.columns;
    const auto row = static_cast<int>(i) / view.map.columns;
    svg += Rect(column * width, row * height, width, height, paint + "</rect>");
  }
  return svg;
}

// A row of shades with what the lightest and the darkest mean.
std::string ShadeLegend(const ReportView& view, const std::array<int, 3>& dark,
                        const std::string& least, const std::string& most) {
  const double y = HeightOf(view) + 9;
  std::string svg = Text(0, y + 11, least);
  for (int i = 0; i < 10; ++i) {
    svg += Rect(62 + 10 * i, y, 10, 13, absl::StrCat("fill=\"", Shade(i / 9.0, dark), "\"/>"));
  }
  return svg + Text(168, y + 11, most);
}

std::string Arrow(const ReportView& view, const ReportCorner& corner, double magnify) {
  const double shrink = kWidth / view.width;
  const Eigen::Vector2d from = shrink * (corner.pixel.array() + 0.5).matrix();
  Eigen::Vector2d line = magnify * corner.held_out.value_or(corner.fit);
  if (!line.allFinite()) line.setZero();
  line *= std::min(1.0, 6 * kTypical / std::max(1e-9, line.norm()));
  const char* kind = corner.outlier ? " class=\"out\"" : "";
  return absl::StrFormat(
      "<path%s d=\"M%.1f %.1fl%.1f %.1f\"/><circle%s cx=\"%.1f\" cy=\"%.1f\" r=\"1.4\"/>\n", kind,
      from.x(), from.y(), line.x(), line.y(), kind, from.x(), from.y());
}

}  // namespace

std::string ResidualFigure(const ReportView& view) {
  PixelSum sum;
  for (const ReportCorner& corner : view.points) {
    if (!corner.outlier) sum.Add(corner.held_out.value_or(corner.fit));
  }
  const double magnify = kTypical / std::max(1e-4, sum.Rms());
  std::string svg = Begin(view, "residuals of corners");
  absl::StrAppend(&svg, "<g class=\"arrows\">\n");
  const size_t step = view.points.size() / kMostArrows + 1;
  for (size_t i = 0; i < view.points.size(); ++i) {
    if (i % step == 0 || view.points[i].outlier) {
      absl::StrAppend(&svg, Arrow(view, view.points[i], magnify));
    }
  }
  const double bar = RoundBelow(70 / magnify);
  const double y = HeightOf(view) + 16;
  absl::StrAppendFormat(&svg, "</g>\n%s<path class=\"bar\" d=\"M1 %.1fh%.1f\"/>%s", Frame(view), y,
                        bar * magnify,
                        Text(bar * magnify + 9, y + 4, absl::StrFormat("%g px", bar)));
  if (step > 1) {
    svg += Text(kWidth, y + 4, absl::StrCat("1 of ", step, " corners"), "class=\"right\"");
  }
  return absl::StrCat(svg, "</svg>\n");
}

std::string CoverageFigure(const ReportView& view) {
  int most = 1;
  bool missed = false;
  for (const MapCell& cell : view.map.cells) {
    most = std::max(most, cell.corners);
    missed = missed || (cell.points > 0 && cell.corners == 0);
  }
  std::string svg = Begin(view, "where corners were seen");
  absl::StrAppend(&svg, Fields(view, [&](const MapCell& cell) -> std::string {
    if (cell.corners > 0) {
      return absl::StrFormat("fill=\"%s\"><title>%d corners</title>",
                             Shade(std::log(1.0 + cell.corners) / std::log(1.0 + most), kBlue),
                             cell.corners);
    }
    if (cell.points > 0) return "class=\"missed\"><title>workspace, no corners</title>";
    return "";
  }));
  absl::StrAppend(&svg, Frame(view), ShadeLegend(view, kBlue, "1 corner", absl::StrCat(most)));
  if (missed) {
    const double y = HeightOf(view) + 9;
    svg += Rect(214, y, 13, 13, "class=\"missed\"/>") + Text(232, y + 11, "workspace only");
  }
  return absl::StrCat(svg, "</svg>\n");
}

std::string PredictionFigure(const ReportView& view) {
  double least = 1e9;
  double most = 0;
  for (const MapCell& cell : view.map.cells) {
    if (cell.points == 0) continue;
    least = std::min(least, cell.predicted_px);
    most = std::max(most, cell.predicted_px);
  }
  if (most == 0) return "";
  std::string svg = Begin(view, "predicted error of points of the workspace");
  absl::StrAppend(&svg, Fields(view, [&](const MapCell& cell) -> std::string {
    if (cell.points == 0) return "";
    return absl::StrFormat("fill=\"%s\"><title>%s px</title>",
                           Shade((cell.predicted_px - least) / std::max(1e-9, most - least), kRed),
                           PixelText(cell.predicted_px));
  }));
  return absl::StrCat(svg, Frame(view),
                      ShadeLegend(view, kRed, absl::StrCat(PixelText(least), " px"),
                                  absl::StrCat(PixelText(most), " px")),
                      "</svg>\n");
}

std::string ImageFigure(const QualityReport& report) {
  constexpr double kLeft = 110;
  constexpr double kRow = 20;
  const double column =
      std::clamp(900.0 / std::max(1.0, static_cast<double>(report.frames.size())), 4.0, 26.0);
  std::map<std::string, size_t> rows;
  std::map<std::string, size_t> columns;
  for (const ReportView& view : report.views) rows.emplace(view.name, rows.size());
  for (const ReportFrame& frame : report.frames) columns.emplace(frame.name, columns.size());
  const double width = kLeft + column * static_cast<double>(columns.size()) + 2;
  const double height = kRow * static_cast<double>(rows.size() + 1) + 22;
  std::string svg = absl::StrFormat(
      "<svg class=\"images\" viewBox=\"0 0 %.0f %.0f\" style=\"max-width:%.0fpx\" role=\"img\" "
      "aria-label=\"all images\">\n",
      width, height, width);
  for (const auto& [name, row] : rows) {
    svg += Text(0, kRow * static_cast<double>(row) + 14, Escaped(name));
  }
  const auto cell = [&](size_t row, size_t place, const std::string& kind, bool left_out,
                        const std::string& says) {
    const double x = kLeft + column * static_cast<double>(place);
    const double y = kRow * static_cast<double>(row);
    absl::StrAppend(&svg, "<g><title>", Escaped(says), "</title>",
                    Rect(x, y + 1, column - 1, kRow - 3, "class=\"" + kind + "\"/>"));
    if (left_out) {
      absl::StrAppendFormat(&svg, "<circle class=\"mark\" cx=\"%.1f\" cy=\"%.1f\" r=\"3\"/>",
                            x + (column - 1) / 2, y + kRow / 2);
    }
    absl::StrAppend(&svg, "</g>\n");
  };
  for (const ReportImage& image : report.images) {
    std::string says =
        absl::StrFormat("frame %s, view %s: %d corners, %d left out, fit %s px", image.frame,
                        image.view, image.corners, image.outliers, PixelText(image.fit_px));
    if (image.held_out.corners > 0) {
      absl::StrAppend(&says, ", held out ", PixelText(image.held_out.px), " px where ",
                      PixelText(image.held_out.expected_px), " were to be expected");
    }
    cell(rows.at(image.view), columns.at(image.frame), NameOf(GradeOf(image.held_out)),
         image.outliers > 0, says);
  }
  bool robot = false;
  for (const ReportFrame& frame : report.frames) {
    if (!frame.robot) continue;
    robot = true;
    cell(
        rows.size(), columns.at(frame.name), frame.robot_outlier ? "bad" : "good",
        frame.robot_outlier,
        absl::StrFormat("frame %s: the flange stood %.2f mm and %.3f deg from where the robot said",
                        frame.name, frame.robot_mm, frame.robot_deg));
  }
  if (robot) {
    svg += Text(0, kRow * static_cast<double>(rows.size()) + 14, "robot pose");
  }
  if (!report.frames.empty()) {
    svg += Text(kLeft, height - 5, "frame " + Escaped(report.frames.front().name)) +
           Text(width, height - 5, Escaped(report.frames.back().name), "class=\"right\"");
  }
  return absl::StrCat(svg, "</svg>\n");
}

}  // namespace silhouette
