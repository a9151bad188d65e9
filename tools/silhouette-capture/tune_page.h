// SPDX-License-Identifier: Apache-2.0
// What silhouette-capture tune found, as a page and for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tools/silhouette-capture/tune_figures.h"

namespace silhouette {

// An image with its figures, by variant, and its sheet as a PNG file.
struct TuneEntry {
  std::string name;
  bool empty = false;
  std::vector<TuneFigures> figures;
  std::string sheet;  // the file's name in the folder
  std::string sheet_png;
};

struct TuneResult {
  std::vector<TuneVariant> variants;
  std::vector<TuneEntry> images;
  std::vector<TuneFigures> sums;    // by variant
  std::vector<std::string> advice;  // how to use what was tried, a line each
};

// A table over all images, as a text: a line per variant, under a line of headings.
std::string TuneTable(const TuneResult& result);

nlohmann::json TuneJson(const TuneResult& result);

// `origin`: names and values, as those of Page().
std::string TunePage(const TuneResult& result,
                     const std::vector<std::pair<std::string, std::string>>& origin);

}  // namespace silhouette
