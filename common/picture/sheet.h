// SPDX-License-Identifier: Apache-2.0
// Several pictures on one sheet, with captions, a title and a legend.
#pragma once

#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/picture/picture.h"

namespace silhouette {

struct LegendEntry {
  Colour colour;
  std::string text;
  // Nothing: a square of the colour; else a line with the mark of this number (DrawMark).
  std::optional<size_t> mark = std::nullopt;
};

struct CaptionedPicture {
  Picture picture;
  std::string caption;
};

struct SheetOptions {
  std::string title;                    // empty: none
  std::vector<std::string> lines = {};  // under the title
  int columns = 0;                      // 0: chosen so that the sheet is about as wide as a page
  std::vector<LegendEntry> legend;
};

// The pictures row by row; columns and rows are as large as their largest picture. ASCII texts.
Picture ContactSheet(const std::vector<CaptionedPicture>& pictures, const SheetOptions& options);

// Draws the mark of a number, of about `radius` pixels: round, square, triangle, diamond; then they
// come again.
void DrawMark(Picture& picture, cv::Point at, int radius, size_t number, Colour colour);

// Draws a legend in one or more lines into width pixels; the height it takes is LegendHeight.
int LegendHeight(const std::vector<LegendEntry>& legend, int width);
void DrawLegend(Picture& picture, const std::vector<LegendEntry>& legend, int left, int top,
                int width);

}  // namespace silhouette
