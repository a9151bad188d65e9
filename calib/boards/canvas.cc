// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/canvas.h"

#include <cairo/cairo-pdf.h>
#include <cairo/cairo.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <stdexcept>

#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

constexpr double kMmPerInch = 25.4;
constexpr double kPointsPerMm = 72 / kMmPerInch;
constexpr int kMostPixels = 32767;  // Cairo's limit

using Surface = std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)>;
using Context = std::unique_ptr<cairo_t, void (*)(cairo_t*)>;

cairo_status_t Append(void* bytes, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

void Require(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS) {
    throw std::runtime_error(absl::StrCat("drawing failed: ", cairo_status_to_string(status)));
  }
}

void AppendBigEndian(std::string& bytes, uint32_t value) {
  for (const int shift : {24, 16, 8, 0}) bytes += static_cast<char>(value >> shift & 0xFF);
}

// The checksum of PNG's chunks.
uint32_t Crc32(const std::string& bytes) {
  uint32_t crc = 0xFFFFFFFF;
  for (const char byte : bytes) {
    crc ^= static_cast<uint8_t>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320 : 0);
  }
  return ~crc;
}

// Puts the resolution behind the header: Cairo does not, and programs would print at any size.
void StateResolution(std::string& png, double dpi) {
  constexpr size_t kHeaderEnd = 8 + 4 + 4 + 13 + 4;  // signature, then the chunk IHDR
  const auto per_metre = static_cast<uint32_t>(std::lround(dpi * 1000 / kMmPerInch));
  std::string chunk = "pHYs";
  AppendBigEndian(chunk, per_metre);
  AppendBigEndian(chunk, per_metre);
  chunk += '\1';  // metres
  std::string with_frame;
  AppendBigEndian(with_frame, static_cast<uint32_t>(chunk.size() - 4));
  with_frame += chunk;
  AppendBigEndian(with_frame, Crc32(chunk));
  png.insert(kHeaderEnd, with_frame);
}

}  // namespace

void Canvas::SetGrey(double grey) { cairo_set_source_rgb(context_, grey, grey, grey); }

void Canvas::Stroke(double width) {
  cairo_set_line_width(context_, width);
  cairo_stroke(context_);
}

void Canvas::Line(PagePoint from, PagePoint to, double width) {
  cairo_move_to(context_, from.x, from.y);
  cairo_line_to(context_, to.x, to.y);
  Stroke(width);
}

void Canvas::Arrow(PagePoint from, PagePoint to, double width) {
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  const double along_x = (to.x - from.x) / length;
  const double along_y = (to.y - from.y) / length;
  const double head = 8 * width;
  const PagePoint neck{to.x - head * along_x, to.y - head * along_y};
  Line(from, neck, width);
  cairo_move_to(context_, to.x, to.y);
  cairo_line_to(context_, neck.x - head / 3 * along_y, neck.y + head / 3 * along_x);
  cairo_line_to(context_, neck.x + head / 3 * along_y, neck.y - head / 3 * along_x);
  cairo_close_path(context_);
  cairo_fill(context_);
}

void Canvas::Circle(PagePoint centre, double radius, double width) {
  cairo_new_path(context_);
  cairo_arc(context_, centre.x, centre.y, radius, 0, 2 * std::numbers::pi);
  Stroke(width);
}

void Canvas::Disc(PagePoint centre, double radius) {
  cairo_new_path(context_);
  cairo_arc(context_, centre.x, centre.y, radius, 0, 2 * std::numbers::pi);
  cairo_fill(context_);
}

void Canvas::Fill(const std::vector<PageBox>& boxes) {
  for (const PageBox& box : boxes) {
    cairo_rectangle(context_, box.left, box.top, box.width, box.height);
  }
  cairo_fill(context_);
}

double Canvas::TextWidth(const std::string& text, double height) {
  cairo_set_font_size(context_, height);
  cairo_text_extents_t extents;
  cairo_text_extents(context_, text.c_str(), &extents);
  return extents.x_advance;
}

void Canvas::Text(PagePoint at, const std::string& text, double height, TextAlign align,
                  double most) {
  const double full = TextWidth(text, height);
  if (full > most) height *= most / full;
  const double width = TextWidth(text, height);
  const double shift = align == TextAlign::kLeft ? 0 : align == TextAlign::kMiddle ? 0.5 : 1;
  cairo_move_to(context_, at.x - shift * width, at.y);
  cairo_show_text(context_, text.c_str());
  cairo_new_path(context_);
}

void Canvas::TextUpwards(PagePoint at, const std::string& text, double height, TextAlign align) {
  cairo_save(context_);
  cairo_translate(context_, at.x, at.y);
  cairo_rotate(context_, -std::numbers::pi / 2);
  Text({0, 0}, text, height, align);
  cairo_restore(context_);
}

namespace {

// `scale`: units of the surface per millimetre.
void DrawOn(cairo_surface_t* surface, const Page& page, double scale) {
  const Context context(cairo_create(surface), cairo_destroy);
  cairo_scale(context.get(), scale, scale);
  cairo_select_font_face(context.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                         CAIRO_FONT_WEIGHT_NORMAL);
  cairo_font_options_t* options = cairo_font_options_create();
  cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
  cairo_font_options_set_hint_style(options, CAIRO_HINT_STYLE_NONE);
  cairo_set_font_options(context.get(), options);
  cairo_font_options_destroy(options);
  Canvas canvas(context.get());
  canvas.SetGrey(0);
  page.draw(canvas);
  Require(cairo_status(context.get()));
}

}  // namespace

std::string PdfOf(const std::vector<Page>& pages) {
  std::string bytes;
  const Surface surface(cairo_pdf_surface_create_for_stream(Append, &bytes, 1, 1),
                        cairo_surface_destroy);
  for (const Page& page : pages) {
    cairo_pdf_surface_set_size(surface.get(), page.paper.width * kPointsPerMm,
                               page.paper.height * kPointsPerMm);
    DrawOn(surface.get(), page, kPointsPerMm);
    cairo_surface_show_page(surface.get());
  }
  cairo_surface_finish(surface.get());
  Require(cairo_surface_status(surface.get()));
  return bytes;
}

std::string PngOf(const Page& page, double dpi) {
  const double scale = dpi / kMmPerInch;
  const double width = std::round(page.paper.width * scale);
  const double height = std::round(page.paper.height * scale);
  if (!(std::max(width, height) <= kMostPixels)) {
    throw std::invalid_argument(absl::StrCat(
        dpi, " dpi makes a picture of ", width, " x ", height, " pixels; at most ",
        std::floor(kMostPixels * kMmPerInch / std::max(page.paper.width, page.paper.height)),
        " dpi can be drawn on ", page.paper.name));
  }
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(width),
                                                   static_cast<int>(height)),
                        cairo_surface_destroy);
  Page on_white = page;
  on_white.draw = [&page](Canvas& canvas) {
    canvas.SetGrey(1);
    canvas.Fill({{0, 0, page.paper.width + 1, page.paper.height + 1}});
    canvas.SetGrey(0);
    page.draw(canvas);
  };
  DrawOn(surface.get(), on_white, scale);
  std::string bytes;
  Require(cairo_surface_write_to_png_stream(surface.get(), Append, &bytes));
  StateResolution(bytes, dpi);
  return bytes;
}

}  // namespace silhouette
