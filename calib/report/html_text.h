// Numbers for the report's page.
#pragma once

#include <string>

namespace silhouette {

// With three decimals, fewer where the number is large.
std::string PixelText(double px);

}  // namespace silhouette
