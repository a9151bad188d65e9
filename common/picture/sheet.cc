// SPDX-License-Identifier: Apache-2.0
#include "common/picture/sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "common/picture/text.h"

namespace silhouette {
namespace {

constexpr int kSheetMargin = 16;
constexpr int kGap = 14;
constexpr int kSheetTitle = 20;
constexpr int kCaption = 14;
constexpr int kSheetLine = 20;
constexpr int kSheetLegendLine = 22;
constexpr int kSheetLegendGap = 18;
constexpr int kSwatch = 14;
constexpr int kLineSample = 34;

int SampleWidth(const LegendEntry& entry) { return entry.mark ? kLineSample : kSwatch; }

int ColumnsFor(size_t pictures, const cv::Size& largest) {
  const double wanted = std::sqrt(static_cast<double>(pictures) * 1.4 *
                                  (largest.height + kCaption) / std::max(1, largest.width));
  return std::clamp(static_cast<int>(std::ceil(wanted)), 1,
                    std::max(1, static_cast<int>(pictures)));
}

// Calls `place(entry, x, line)` for every entry, breaking lines at `width`; returns the lines.
template <typename Place>
int LayOut(const std::vector<LegendEntry>& legend, int width, Place place) {
  int x = 0;
  int line = 0;
  for (const LegendEntry& entry : legend) {
    const int needed = SampleWidth(entry) + 6 + TextWidth(entry.text, kCaption);
    if (x > 0 && x + needed > width) {
      x = 0;
      ++line;
    }
    place(entry, x, line);
    x += needed + kSheetLegendGap;
  }
  return legend.empty() ? 0 : line + 1;
}

}  // namespace

void DrawMark(Picture& picture, cv::Point at, int radius, size_t number, Colour colour) {
  // The first corner's direction and the angle to the next, in degrees.
  constexpr std::array<std::pair<int, int>, 4> kShapes = {{{0, 12}, {45, 90}, {-90, 120}, {0, 90}}};
  const auto [first, step] = kShapes[number % kShapes.size()];
  std::vector<cv::Point> corners;
  cv::ellipse2Poly(at, {radius, radius}, first, 0, 360, step, corners);
  cv::fillConvexPoly(picture, corners, BgrOf(colour), cv::LINE_AA);
}

int LegendHeight(const std::vector<LegendEntry>& legend, int width) {
  return kSheetLegendLine * LayOut(legend, width, [](const LegendEntry&, int, int) {});
}

void DrawLegend(Picture& picture, const std::vector<LegendEntry>& legend, int left, int top,
                int width) {
  LayOut(legend, width, [&](const LegendEntry& entry, int x, int line) {
    const int middle = top + line * kSheetLegendLine + kSheetLegendLine / 2;
    if (entry.mark) {
      const cv::Point start(left + x, middle);
      cv::line(picture, start, start + cv::Point(kLineSample, 0), BgrOf(entry.colour), 2,
               cv::LINE_AA);
      DrawMark(picture, start + cv::Point(kLineSample / 2, 0), 7, *entry.mark, entry.colour);
    } else {
      const cv::Rect swatch(left + x, middle - kSwatch / 2, kSwatch, kSwatch);
      cv::rectangle(picture, swatch, BgrOf(entry.colour), cv::FILLED);
      cv::rectangle(picture, swatch, BgrOf(palette::kInk), 1);
    }
    DrawText(picture, entry.text, {left + x + SampleWidth(entry) + 6, middle},
             {.height = kCaption});
  });
}

Picture ContactSheet(const std::vector<CaptionedPicture>& pictures, const SheetOptions& options) {
  cv::Size largest(1, 1);
  for (const CaptionedPicture& each : pictures) {
    largest.width = std::max(largest.width, each.picture.cols);
    largest.height = std::max(largest.height, each.picture.rows);
  }
  const int columns = options.columns > 0 ? options.columns : ColumnsFor(pictures.size(), largest);
  const int rows = (static_cast<int>(pictures.size()) + columns - 1) / columns;
  std::vector<int> widths(static_cast<size_t>(columns), 0);
  std::vector<int> heights(static_cast<size_t>(rows), 0);
  for (size_t i = 0; i < pictures.size(); ++i) {
    int& width = widths[i % widths.size()];
    int& height = heights[i / widths.size()];
    width = std::max(width, pictures[i].picture.cols);
    height = std::max(height,
                      pictures[i].picture.rows + (pictures[i].caption.empty() ? 0 : kCaption + 6));
  }
  int inner = -kGap;
  for (int width : widths) inner += width + kGap;
  inner = std::max(inner, TextWidth(options.title, kSheetTitle));
  for (const std::string& line : options.lines) inner = std::max(inner, TextWidth(line, kCaption));
  const int title = options.title.empty() ? 0 : kSheetTitle + kGap;
  const int lines = static_cast<int>(options.lines.size()) * kSheetLine;
  const int head = title + lines + (lines > 0 ? kGap / 2 : 0);
  const int legend = LegendHeight(options.legend, inner);
  int total = 2 * kSheetMargin + head + (legend > 0 ? legend + kGap / 2 : 0) - kGap;
  for (int height : heights) total += height + kGap;

  Picture sheet = BlankPicture(inner + 2 * kSheetMargin, std::max(total, 1));
  DrawText(sheet, options.title, {kSheetMargin, kSheetMargin + kSheetTitle / 2},
           {.height = kSheetTitle});
  for (size_t i = 0; i < options.lines.size(); ++i) {
    const int middle = kSheetMargin + title + static_cast<int>(i) * kSheetLine + kCaption / 2;
    DrawText(sheet, options.lines[i], {kSheetMargin, middle}, {.height = kCaption});
  }
  int top = kSheetMargin + head;
  for (size_t row = 0; row < heights.size(); ++row) {
    int left = kSheetMargin;
    for (size_t column = 0; column < widths.size(); ++column) {
      const size_t i = row * widths.size() + column;
      if (i >= pictures.size()) break;
      const auto& [picture, caption] = pictures[i];
      if (!picture.empty()) {
        picture.copyTo(sheet(cv::Rect(left, top, picture.cols, picture.rows)));
        cv::rectangle(sheet, cv::Rect(left - 1, top - 1, picture.cols + 2, picture.rows + 2),
                      BgrOf(palette::kFaint), 1);
      }
      DrawText(sheet, Shortened(caption, widths[column] + kGap - 4, kCaption),
               {left, top + picture.rows + 5 + kCaption / 2}, {.height = kCaption});
      left += widths[column] + kGap;
    }
    top += heights[row] + kGap;
  }
  DrawLegend(sheet, options.legend, kSheetMargin, top - kGap / 2, inner);
  return sheet;
}

}  // namespace silhouette
