#include "calib/report/html_text.h"

#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

namespace silhouette {

std::string Escaped(const std::string& text) {
  return absl::StrReplaceAll(
      text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

std::string PixelText(double px) {
  return px < 1 ? absl::StrFormat("%.3f", px) : absl::StrFormat("%.2f", px);
}

}  // namespace silhouette
