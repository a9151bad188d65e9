// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/whole_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// How many of an OBJ file's last vertices may be in no face: the greater of a share of all and a
// number.
constexpr double kMostLoose = 0.01;
constexpr double kFewLoose = 3;

// What is wrong with a file; empty: nothing.
using Fault = std::string;

// Whether a facet of a text STL file has more or fewer corners than three: the fourth would not be
// read.
bool HasOtherThanTriangles(absl::string_view text) {
  constexpr absl::string_view kVertex = "vertex";
  for (size_t end = text.find("endloop"); end != text.npos; end = text.find("endloop", end + 1)) {
    const size_t begin = text.rfind("outer", end);
    if (begin == text.npos) continue;
    int corners = 0;
    for (size_t at = text.find(kVertex, begin); at < end;
         at = text.find(kVertex, at + kVertex.size())) {
      ++corners;
    }
    if (corners != 3) return true;
  }
  return false;
}

// In a binary one 50 bytes a triangle follow 84 bytes, of which the last four are their number.
// Some begin with 'solid', too; those bytes of a text make a number that no file has triangles for.
Fault OfStl(const std::string& bytes) {
  uint32_t triangles = 0;
  if (bytes.size() >= 84) std::memcpy(&triangles, &bytes[80], 4);
  const uint64_t binary = 84 + 50 * uint64_t{triangles};
  if (bytes.size() == binary) return "";
  if (triangles > 0 && bytes.size() > binary) return "has bytes after its last triangle";
  const size_t end = bytes.find_last_not_of(" \t\r\n");
  const size_t line = bytes.find_last_of("\r\n", end);
  const size_t word = bytes.find_first_not_of(" \t", line == std::string::npos ? 0 : line + 1);
  if (word != std::string::npos &&
      absl::StartsWithIgnoreCase(absl::string_view(bytes).substr(word), "endsolid")) {
    return HasOtherThanTriangles(bytes)
               ? "has a facet of other than three corners; export it again "
                 "with triangles only"
               : "";
  }
  if (!absl::StartsWith(bytes, "solid") && bytes.size() >= 84) {
    return absl::StrCat("is cut off: its header counts ", triangles, " triangles, ",
                        (bytes.size() - 84) / 50, " are there");
  }
  return "is cut off: it does not end with 'endsolid'";
}

// Bytes of a number; 0: no type of PLY.
size_t SizeOf(absl::string_view type) {
  for (const char* one : {"char", "uchar", "int8", "uint8"}) {
    if (type == one) return 1;
  }
  for (const char* two : {"short", "ushort", "int16", "uint16"}) {
    if (type == two) return 2;
  }
  for (const char* four : {"int", "uint", "float", "int32", "uint32", "float32"}) {
    if (type == four) return 4;
  }
  return type == "double" || type == "float64" ? 8 : 0;
}

struct PlyElement {
  struct Property {
    size_t count = 0;  // bytes of a list's length; 0: no list
    size_t value = 0;
  };
  std::string name;
  uint64_t rows = 0;
  std::vector<Property> properties;
};

// What follows a PLY file's header: one number after another.
class PlyNumbers {
 public:
  PlyNumbers(absl::string_view bytes, bool text, bool big_endian)
      : bytes_(bytes), text_(text), big_endian_(big_endian) {}

  // False: there are not as many more.
  bool Skip(uint64_t numbers, size_t size) {
    if (!text_) {
      if ((bytes_.size() - at_) / size < numbers) return false;
      at_ += numbers * size;
      return true;
    }
    for (; numbers > 0; --numbers) {
      if (Word().empty()) return false;
    }
    return true;
  }
  std::optional<uint64_t> Read(size_t size) {
    uint64_t number = 0;
    if (text_) {
      if (!absl::SimpleAtoi(Word(), &number)) return std::nullopt;
      return number;
    }
    if (bytes_.size() - at_ < size) return std::nullopt;
    for (size_t i = 0; i < size; ++i) {
      const size_t place = big_endian_ ? i : size - 1 - i;
      number = number << 8 | static_cast<uint8_t>(bytes_[at_ + place]);
    }
    at_ += size;
    return number;
  }

 private:
  absl::string_view Word() {
    const size_t begin = std::min(bytes_.find_first_not_of(" \t\r\n", at_), bytes_.size());
    at_ = std::min(bytes_.find_first_of(" \t\r\n", begin), bytes_.size());
    return bytes_.substr(begin, at_ - begin);
  }

  absl::string_view bytes_;
  bool text_;
  bool big_endian_;
  size_t at_ = 0;
};

Fault OfPly(const std::string& bytes) {
  std::vector<PlyElement> elements;
  std::string format;
  size_t at = 0;
  for (;;) {
    const size_t end = bytes.find('\n', at);
    if (end == std::string::npos) return "is cut off: its header does not end";
    const std::vector<std::string> words = absl::StrSplit(
        absl::string_view(bytes).substr(at, end - at), absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    at = end + 1;
    if (words.empty()) continue;
    if (words[0] == "end_header") break;
    if (words[0] == "format" && words.size() > 1) format = words[1];
    if (words[0] == "element" && words.size() > 2) {
      PlyElement& element = elements.emplace_back();
      element.name = words[1];
      if (!absl::SimpleAtoi(words[2], &element.rows)) return "has a header without numbers";
    }
    if (words[0] != "property" || elements.empty() || words.size() < 3) continue;
    PlyElement::Property property{.value = SizeOf(words[1])};
    if (words[1] == "list" && words.size() > 3) {
      property = {.count = SizeOf(words[2]), .value = SizeOf(words[3])};
      if (property.count == 0) property.value = 0;
    }
    if (property.value == 0) return "has a property of unknown type in its header";
    elements.back().properties.push_back(property);
  }
  PlyNumbers numbers(absl::string_view(bytes).substr(at), format == "ascii",
                     format == "binary_big_endian");
  for (const PlyElement& element : elements) {
    if (element.name == "tristrips" && element.rows > 0) {
      return "has triangle strips, which are not read; export it again with faces";
    }
    for (uint64_t row = 0; row < element.rows && !element.properties.empty(); ++row) {
      for (const PlyElement::Property& property : element.properties) {
        const auto count = property.count == 0 ? 1 : numbers.Read(property.count);
        if (count && numbers.Skip(*count, property.value)) continue;
        return absl::StrCat("is cut off: its header counts ", element.rows, " '", element.name,
                            "', ", row, " are there");
      }
    }
  }
  return "";
}

Fault OfObj(const std::string& bytes) {
  std::vector<bool> used;                          // by vertex
  size_t short_face = 0;                           // line of the last face, if it has two corners
  std::vector<std::pair<size_t, size_t>> corners;  // vertex and line
  const auto at = [](size_t line) {
    return absl::StrCat(" in line ", line, "; its end may be missing");
  };
  std::istringstream in(bytes);
  std::string text;
  for (size_t line = 1; std::getline(in, text); ++line) {
    // A line that goes on.
    std::string more;
    while (absl::EndsWith(absl::StripTrailingAsciiWhitespace(text), "\\") &&
           std::getline(in, more)) {
      text = absl::StrCat(text.substr(0, text.rfind('\\')), " ", more);
      ++line;
    }
    const std::vector<std::string> words =
        absl::StrSplit(text.substr(0, text.find('#')), absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    if (words.empty()) continue;
    if (words[0] == "v") {
      used.push_back(false);
      if (words.size() < 4) return "has a vertex of fewer than three numbers" + at(line);
    }
    const bool face = words[0] == "f" || words[0] == "fo";
    if (face) short_face = words.size() < 4 ? line : 0;
    if (!face && words[0] != "l" && words[0] != "p") continue;
    for (size_t i = 1; i < words.size(); ++i) {
      int64_t corner = 0;
      const bool number = absl::SimpleAtoi(words[i].substr(0, words[i].find('/')), &corner);
      // Those below 0 count from the last vertex so far.
      if (corner < 0) corner += static_cast<int64_t>(used.size()) + 1;
      if (!number || corner < 1) return "has a corner that is no vertex" + at(line);
      corners.emplace_back(corner - 1, line);
    }
  }
  if (short_face != 0) return "has a last face of fewer than three corners" + at(short_face);
  for (const auto& [corner, line] : corners) {
    if (corner >= used.size()) {
      return absl::StrCat("has ", used.size(), " vertices, but names number ", corner + 1,
                          at(line));
    }
    used[corner] = true;
  }
  const auto loose =
      static_cast<double>(std::find(used.rbegin(), used.rend(), true) - used.rbegin());
  const auto all = static_cast<double>(used.size());
  if (loose < all && loose <= std::max(kFewLoose, kMostLoose * all)) return "";
  return absl::StrCat("has ", used.size(), " vertices, of which the last ", loose,
                      " are in no face; its end may be missing");
}

Fault OfCollada(const std::string& bytes) {
  constexpr char kName[] = "bind_shape_matrix";
  constexpr double kMatrixRounding = 1e-5;
  if (!absl::StrContains(bytes, "instance_controller")) return "";
  for (size_t at = bytes.find(kName); at != std::string::npos; at = bytes.find(kName, at + 1)) {
    const size_t begin = bytes.find('>', at);
    // The element's beginning, with or without a prefix; no comment.
    const size_t tag = bytes.rfind('<', at);
    if (tag == std::string::npos || begin == std::string::npos) continue;
    if (bytes[tag + 1] == '/' || bytes[tag + 1] == '!') continue;
    std::istringstream numbers(bytes.substr(begin + 1, bytes.find('<', begin) - begin - 1));
    for (int i = 0; i < 16; ++i) {
      double number = 0;
      if (numbers >> number && std::abs(number - (i % 5 == 0)) < kMatrixRounding) continue;
      return "is placed by the bind_shape_matrix of a skin, which is not read; apply the skin (in "
             "Blender: the armature), and export it again";
    }
  }
  return "";
}

}  // namespace

absl::Status CheckWhole(const std::string& path) {
  const std::string extension =
      absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  Fault (*check)(const std::string&) = nullptr;
  if (extension == ".stl") check = OfStl;
  if (extension == ".ply") check = OfPly;
  if (extension == ".obj") check = OfObj;
  if (extension == ".dae") check = OfCollada;
  if (check == nullptr) return absl::OkStatus();
  std::ifstream in(path, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(in), {});
  Fault fault = check(bytes);
  // As programs of Windows write what is no number; it would be read as 1.
  for (const std::string no_number : {"1.#QNAN", "1.#IND", "1.#INF"}) {
    if (absl::StrContains(bytes, no_number)) {
      fault = "has " + no_number + ", which is no number; export it again";
    }
  }
  if (fault.empty()) return absl::OkStatus();
  return InvalidArgument("the mesh '", path, "' ", fault,
                         absl::StrContains(fault, "again") ? "" : "; copy or export it again");
}

}  // namespace silhouette
