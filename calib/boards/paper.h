// Sheets of paper to print boards on.
#pragma once

#include <string>
#include <vector>

namespace silhouette {

struct Paper {
  std::string name;   // "A3", "A3 landscape", "600x400 mm"
  double width = 0;   // mm
  double height = 0;  // mm
};

// "A4", "a3 landscape", "A2 portrait", "Letter", "600x400" or "600x400 mm". Of a named size without
// a direction both are given, portrait first; else the one that is meant. Throws
// std::invalid_argument with the known names.
std::vector<Paper> PapersFromText(const std::string& text);

// What is tried when nobody names a paper: A4 to A0, the smallest first, portrait before landscape.
std::vector<Paper> AutomaticPapers();

}  // namespace silhouette
