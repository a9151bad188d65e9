// SPDX-License-Identifier: Apache-2.0
// Text in pictures: UTF-8, in the system's sans-serif font, upright or turned.
#pragma once

#include <opencv2/core/types.hpp>
#include <string>

#include "common/picture/picture.h"

namespace silhouette {

// Where the text's anchor is in its box.
enum class Align { kStart, kMiddle, kEnd };

struct TextStyle {
  int height = 14;  // of a line, in pixels
  Colour colour = palette::kInk;
  Align across = Align::kStart;  // the anchor's place along the text
  bool upwards = false;          // turned by 90 degrees, to be read from below
};

// Width of `text` in pixels.
int TextWidth(const std::string& text, int height);

// `text` cut to `width` pixels, with "..." where something was left out.
std::string Shortened(const std::string& text, int width, int height);

// Draws a line of text; `anchor` is in the vertical middle of the line. What is beyond the
// picture's rim is cut off.
void DrawText(Picture& picture, const std::string& text, cv::Point anchor, const TextStyle& style);

}  // namespace silhouette
