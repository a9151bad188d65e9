#include "calib/boards/paper.h"

#include <regex>
#include <stdexcept>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

struct Size {
  const char* name;
  double width;
  double height;
};

constexpr Size kSizes[] = {{"A4", 210, 297},         {"A3", 297, 420},         {"A2", 420, 594},
                           {"A1", 594, 841},         {"A0", 841, 1189},        {"A5", 148, 210},
                           {"Letter", 215.9, 279.4}, {"Tabloid", 279.4, 431.8}};
constexpr size_t kAutomatic = 5;  // the first of kSizes
constexpr double kLeast = 50;     // mm, of a side
constexpr double kMost = 5000;

Paper Portrait(const Size& size) { return {size.name, size.width, size.height}; }
Paper Landscape(const Size& size) {
  return {absl::StrCat(size.name, " landscape"), size.height, size.width};
}

}  // namespace

std::vector<Paper> PapersFromText(const std::string& text) {
  static const std::regex sides(R"(\s*([0-9.]+)\s*[xX]\s*([0-9.]+)\s*(mm)?\s*)");
  std::smatch match;
  if (std::regex_match(text, match, sides)) {
    Paper paper;
    if (absl::SimpleAtod(match[1].str(), &paper.width) &&
        absl::SimpleAtod(match[2].str(), &paper.height) && paper.width >= kLeast &&
        paper.height >= kLeast && paper.width <= kMost && paper.height <= kMost) {
      paper.name = absl::StrCat(paper.width, "x", paper.height, " mm");
      return {paper};
    }
    throw std::invalid_argument(
        absl::StrCat("paper '", text, "': sides are in mm, from ", kLeast, " to ", kMost));
  }
  const std::string lower = absl::AsciiStrToLower(text);
  for (const Size& size : kSizes) {
    const std::string name = absl::AsciiStrToLower(size.name);
    if (lower == name) return {Portrait(size), Landscape(size)};
    if (lower == name + " portrait") return {Portrait(size)};
    if (lower == name + " landscape") return {Landscape(size)};
  }
  throw std::invalid_argument(absl::StrCat(
      "there is no paper '", text,
      "'; papers are A5, A4, A3, A2, A1, A0, Letter, Tabloid, each also with 'portrait' or "
      "'landscape' behind it, or width x height in mm, e.g. 600x400"));
}

std::vector<Paper> AutomaticPapers() {
  std::vector<Paper> papers;
  for (size_t i = 0; i < kAutomatic; ++i) {
    papers.push_back(Portrait(kSizes[i]));
    papers.push_back(Landscape(kSizes[i]));
  }
  return papers;
}

}  // namespace silhouette
