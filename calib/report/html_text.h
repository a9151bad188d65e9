// Text and numbers for the report's page.
#pragma once

#include <string>

#include "calib/report/report_judgement.h"

namespace silhouette {

// What a browser shows as `text`, in elements and attributes.
std::string Escaped(const std::string& text);

// With three decimals, fewer where the number is large.
std::string PixelText(double px);

// A class of the page's style: good, fair, bad or unknown.
const char* ClassOf(Grade grade);

}  // namespace silhouette
