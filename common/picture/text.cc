// SPDX-License-Identifier: Apache-2.0
#include "common/picture/text.h"

#include <cairo.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/imgproc.hpp>

namespace silhouette {
namespace {

constexpr double kSizePerLine = 0.84;  // of the font, as a share of a line's height
constexpr double kBaseline = 0.76;     // from the top of the line: capitals are in its middle

using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;
using Context = std::unique_ptr<cairo_t, decltype(&cairo_destroy)>;

Surface NewSurface(int width, int height) {
  return {cairo_image_surface_create(CAIRO_FORMAT_A8, width, height), cairo_surface_destroy};
}

Context NewContext(const Surface& surface, int height) {
  Context context(cairo_create(surface.get()), cairo_destroy);
  cairo_select_font_face(context.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                         CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context.get(), height * kSizePerLine);
  return context;
}

// The ink of a text, 0 to 255, as wide as it and as high as a line.
cv::Mat Ink(const std::string& text, int height) {
  const Surface surface = NewSurface(TextWidth(text, height), height);
  const Context context = NewContext(surface, height);
  cairo_move_to(context.get(), 1, height * kBaseline);
  cairo_show_text(context.get(), text.c_str());
  cairo_surface_flush(surface.get());
  return cv::Mat(height, cairo_image_surface_get_width(surface.get()), CV_8UC1,
                 cairo_image_surface_get_data(surface.get()),
                 static_cast<size_t>(cairo_image_surface_get_stride(surface.get())))
      .clone();
}

}  // namespace

int TextWidth(const std::string& text, int height) {
  const Surface surface = NewSurface(1, 1);
  const Context context = NewContext(surface, height);
  cairo_text_extents_t extents;
  cairo_text_extents(context.get(), text.c_str(), &extents);
  return static_cast<int>(std::ceil(extents.x_advance)) + 2;
}

std::string Shortened(const std::string& text, int width, int height) {
  if (TextWidth(text, height) <= width) return text;
  std::string kept = text;
  while (!kept.empty() && TextWidth(kept + "...", height) > width) {
    // A character is a first byte and others that begin with the bits 10.
    while (kept.size() > 1 && (static_cast<uint8_t>(kept.back()) & 0xC0) == 0x80) kept.pop_back();
    kept.pop_back();
  }
  return kept + "...";
}

void DrawText(Picture& picture, const std::string& text, cv::Point anchor, const TextStyle& style) {
  if (text.empty()) return;
  cv::Mat ink = Ink(text, style.height);
  const int length = ink.cols;
  if (style.upwards) cv::rotate(ink, ink, cv::ROTATE_90_COUNTERCLOCKWISE);
  int before = 0;
  if (style.across == Align::kMiddle) before = length / 2;
  if (style.across == Align::kEnd) before = length;
  const cv::Point corner =
      style.upwards ? cv::Point(anchor.x - style.height / 2, anchor.y - (length - before))
                    : cv::Point(anchor.x - before, anchor.y - style.height / 2);
  const cv::Rect seen = cv::Rect(corner, ink.size()) & cv::Rect({}, picture.size());
  if (seen.empty()) return;
  cv::Mat share;
  ink(seen - corner).convertTo(share, CV_32F, 1 / 255.0);
  cv::Mat place = picture(seen);
  cv::blendLinear(BlankPicture(seen.width, seen.height, style.colour), place, share, 1 - share,
                  place);
}

}  // namespace silhouette
