// SPDX-License-Identifier: Apache-2.0
// Canvas: drawing in millimetres on pages of a PDF or on a PNG.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

struct _cairo;

namespace silhouette {

// Sheets of paper to print boards on.

struct Paper {
  std::string name;   // "A3", "A3 landscape", "600x400 mm"
  double width = 0;   // mm
  double height = 0;  // mm
};

// "A4", "a3 landscape", "A2 portrait", "Letter", "600x400" or "600x400 mm". Of a named size without
// a direction both are given, portrait first; else the one that is meant. Throws
// std::invalid_argument with the known names.
std::vector<Paper> PapersFromText(const std::string& text);

// The papers to try if none is specified: A4 to A0, the smallest first, portrait before landscape.
std::vector<Paper> AutomaticPapers();

// Millimetres from the paper's top left corner, x to the right, y down.
struct PagePoint {
  double x = 0;
  double y = 0;
};

struct PageBox {
  double left = 0;
  double top = 0;
  double width = 0;
  double height = 0;

  double right() const { return left + width; }
  double bottom() const { return top + height; }
};

enum class TextAlign { kLeft, kMiddle, kRight };

class Canvas {
 public:
  explicit Canvas(_cairo* context) : context_(context) {}

  // 0 is black, 1 white; for all that is drawn from then on.
  void SetGrey(double grey);

  void Line(PagePoint from, PagePoint to, double width);
  // A line with a head at `to`.
  void Arrow(PagePoint from, PagePoint to, double width);
  void Circle(PagePoint centre, double radius, double width);
  void Disc(PagePoint centre, double radius);
  // All boxes as one area, so that no seam shows where they touch.
  void Fill(const std::vector<PageBox>& boxes);

  // `at` is on the base line; `height` is the font's size. Text that is wider than `most` is made
  // smaller until it is not.
  void Text(PagePoint at, const std::string& text, double height,
            TextAlign align = TextAlign::kLeft, double most = 1e9);
  // The same, to be read from the right: it runs upwards from `at`.
  void TextUpwards(PagePoint at, const std::string& text, double height, TextAlign align);
  double TextWidth(const std::string& text, double height);

 private:
  void Stroke(double width);

  _cairo* context_;
};

using DrawPage = std::function<void(Canvas&)>;

struct Page {
  Paper paper;
  DrawPage draw;
};

// The bytes of a PDF file, vectors and true to scale. Throws std::runtime_error if Cairo fails.
std::string PdfOf(const std::vector<Page>& pages);

// The bytes of a PNG file that says its resolution. Throws std::invalid_argument if it would have
// more than 32767 pixels a side, std::runtime_error if Cairo fails.
std::string PngOf(const Page& page, double dpi);

}  // namespace silhouette
