// SPDX-License-Identifier: Apache-2.0
// Several pictures on one sheet, with captions, a title and a legend.
#pragma once

#include <string>
#include <vector>

#include "common/picture/picture.h"

namespace silhouette {

struct LegendEntry {
  Colour colour;
  std::string text;
};

struct CaptionedPicture {
  Picture picture;
  std::string caption;
};

struct SheetOptions {
  std::string title;  // empty: none
  int columns = 0;    // 0: chosen so that the sheet is about as wide as a page
  std::vector<LegendEntry> legend;
};

// The pictures row by row; columns and rows are as large as their largest picture. ASCII texts.
Picture ContactSheet(const std::vector<CaptionedPicture>& pictures, const SheetOptions& options);

// Draws a legend in one or more lines into width pixels; the height it takes is LegendHeight.
int LegendHeight(const std::vector<LegendEntry>& legend, int width);
void DrawLegend(Picture& picture, const std::vector<LegendEntry>& legend, int left, int top,
                int width);

}  // namespace silhouette
