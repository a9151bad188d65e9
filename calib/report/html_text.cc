#include "calib/report/html_text.h"

#include "absl/strings/str_format.h"

namespace silhouette {

std::string PixelText(double px) {
  return px < 1 ? absl::StrFormat("%.3f", px) : absl::StrFormat("%.2f", px);
}

}  // namespace silhouette
