// Text and numbers for the report's page.
#pragma once

#include <string>

namespace silhouette {

// What a browser shows as `text`, in elements and attributes.
std::string Escaped(const std::string& text);

// With three decimals, fewer where the number is large.
std::string PixelText(double px);

}  // namespace silhouette
