// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/sighting_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/boards/csv.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr int kOfTag = 4;  // corners

constexpr size_t kWidth = 8;  // the first column that a file may lack

const std::vector<std::string>& Columns() {
  static const std::vector<std::string> columns = {"frame", "view", "family", "tag",   "corner",
                                                   "x",     "y",    "sigma",  "width", "height"};
  return columns;
}

// Those that the file's first line names.
std::vector<std::string> ColumnsIn(const std::string& text) {
  const absl::string_view rows = absl::StripLeadingAsciiWhitespace(text);
  const absl::string_view header = rows.substr(0, rows.find('\n'));
  std::vector<std::string> columns = Columns();
  if (!absl::StrContains(header, "width") && !absl::StrContains(header, "height")) {
    columns.resize(kWidth);
  }
  return columns;
}

// A sighting whose corners are still being read.
struct Partial {
  std::string place;  // of its first line
  size_t index = 0;   // in the result
  std::array<bool, kOfTag> seen{};
};

struct CornerLine {
  TagSighting tag;  // without corners
  int corner = 0;
  Eigen::Vector2d at;
};

absl::Status Mistake(const CsvRow& row, const std::string& what) {
  return InvalidArgument(row.place(), ": ", what);
}

// As a row states it; columns that are not there are 0.
absl::StatusOr<PixelSize> SizeIn(const CsvRow& row, bool stated) {
  if (!stated) return PixelSize{};
  ASSIGN_OR_RETURN(const int width, row.Integer(kWidth));
  ASSIGN_OR_RETURN(const int height, row.Integer(kWidth + 1));
  if (width < 0 || height < 0 || (width == 0) != (height == 0)) {
    return Mistake(row, absl::StrCat("an image of ", width, "x", height,
                                     " pixels; if its size is not known, write 0 and 0"));
  }
  return PixelSize{width, height};
}

// `sized`: whether the row has the image's size.
absl::StatusOr<CornerLine> ReadLine(const CsvRow& row, bool sized) {
  const absl::StatusOr<int> tag = row.Integer(3);
  const absl::StatusOr<int> corner = row.Integer(4);
  const absl::StatusOr<double> x = row.Number(5);
  const absl::StatusOr<double> y = row.Number(6);
  const absl::StatusOr<double> sigma = row.Number(7);
  for (const absl::Status& status :
       {tag.status(), corner.status(), x.status(), y.status(), sigma.status()}) {
    if (!status.ok()) return status;
  }
  for (int column = 0; column < 3; ++column) {
    if (row.Text(column).empty()) return Mistake(row, "the " + Columns()[column] + " is empty");
  }
  ASSIGN_OR_RETURN(const PixelSize size, SizeIn(row, sized));
  if (*tag < 0) return Mistake(row, absl::StrCat("tag ", *tag, ": ids are not negative"));
  if (*corner < 0 || *corner >= kOfTag) {
    return Mistake(row, absl::StrCat("corner ", *corner, ": corners are 0 to 3"));
  }
  if (*sigma <= 0) {
    return Mistake(row, absl::StrCat("sigma ", *sigma, ": it must be positive, in pixels"));
  }
  return CornerLine{.tag = {.frame = row.Text(0),
                            .view = row.Text(1),
                            .family = row.Text(2),
                            .tag = *tag,
                            .sigma = *sigma,
                            .image = size},
                    .corner = *corner,
                    .at = {*x, *y}};
}

std::string Name(const TagSighting& s) {
  return absl::StrCat("tag ", s.tag, " of ", s.family, " in frame '", s.frame, "' of view '",
                      s.view, "'");
}

// What `sighting` has that a file cannot give back; empty if nothing.
std::string SightingFault(const TagSighting& sighting) {
  for (const std::string& name : {sighting.frame, sighting.view, sighting.family}) {
    if (name.empty()) return "a frame, view or family without a name";
    if (name.find_first_of("\r\n") != std::string::npos) return "a line break in a name";
  }
  if (sighting.tag < 0) return "a negative id";
  if (sighting.corners.size() != 1 && sighting.corners.size() != kOfTag) {
    return "neither one nor four corners";
  }
  for (const Eigen::Vector2d& corner : sighting.corners) {
    if (!corner.allFinite()) return "a corner that is not finite";
  }
  if (!std::isfinite(sighting.sigma) || sighting.sigma <= 0) return "a sigma that is not positive";
  return "";
}

// Of each view, the first image whose size is known.
class SizesOfViews {
 public:
  absl::Status Add(const CsvRow& row, const TagSighting& tag) {
    if (tag.image.width == 0) return absl::OkStatus();
    const auto& [frame, size] = first_.try_emplace(tag.view, tag.frame, tag.image).first->second;
    if (size == tag.image) return absl::OkStatus();
    return Mistake(
        row, absl::StrCat("view '", tag.view, "' has images of different sizes: frame '", frame,
                          "' ", SizeText(size), ", frame '", tag.frame, "' ", SizeText(tag.image),
                          "; a calibration holds for one size, so keep those of the "
                          "size that is used later"));
  }

 private:
  std::map<std::string, std::pair<std::string, PixelSize>> first_;
};

}  // namespace

std::optional<PixelSize> ImageSizeOf(std::span<const TagSighting> sightings,
                                     const std::string& view) {
  for (const TagSighting& seen : sightings) {
    if (seen.view == view && seen.image.width > 0) return seen.image;
  }
  return std::nullopt;
}

absl::Status CheckImageSize(std::span<const TagSighting> sightings, const std::string& view,
                            PixelSize stated, const std::string& what) {
  const std::optional<PixelSize> seen = ImageSizeOf(sightings, view);
  if (!seen || *seen == stated) return absl::OkStatus();
  return InvalidArgument("view '", view, "': ", what, " is ", SizeText(stated),
                         ", but its corners were found in images of ", SizeText(*seen),
                         "; correct it, or detect in images of its size");
}

std::string SightingFileText(std::span<const TagSighting> sightings) {
  std::string text = absl::StrJoin(Columns(), ",") + "\n";
  for (const TagSighting& s : sightings) {
    if (const std::string fault = SightingFault(s); !fault.empty()) {
      throw std::invalid_argument(Name(s) + " has " + fault);
    }
    for (size_t corner = 0; corner < s.corners.size(); ++corner) {
      absl::StrAppend(&text, CsvField(s.frame), ",", CsvField(s.view), ",", CsvField(s.family), ",",
                      s.tag, ",", corner, ",", CsvNumber(s.corners[corner].x()), ",",
                      CsvNumber(s.corners[corner].y()), ",", CsvNumber(s.sigma), ",", s.image.width,
                      ",", s.image.height, "\n");
    }
  }
  return text;
}

absl::StatusOr<std::vector<TagSighting>> SightingsFromText(const std::string& text,
                                                           const std::string& file) {
  const std::vector<std::string> columns = ColumnsIn(text);
  ASSIGN_OR_RETURN(const std::vector<CsvRow> rows, CsvRows(text, file, columns));
  SizesOfViews sizes;
  std::vector<TagSighting> sightings;
  std::map<std::tuple<std::string, std::string, std::string, int>, Partial> partials;
  for (const CsvRow& row : rows) {
    ASSIGN_OR_RETURN(const CornerLine line, ReadLine(row, columns.size() > kWidth));
    const TagSighting& tag = line.tag;
    RETURN_IF_ERROR(sizes.Add(row, tag));
    const auto [found, first] = partials.try_emplace({tag.frame, tag.view, tag.family, tag.tag},
                                                     Partial{row.place(), sightings.size(), {}});
    if (first) {
      sightings.push_back(tag);
      sightings.back().corners.resize(kOfTag);
    }
    Partial& partial = found->second;
    TagSighting& sighting = sightings[partial.index];
    if (partial.seen[line.corner]) {
      return Mistake(row, absl::StrCat("corner ", line.corner, " of ", Name(tag),
                                       " is there twice; the tag begins at ", partial.place));
    }
    if (sighting.sigma != tag.sigma) {
      return Mistake(row, Name(tag) + " has corners of different sigma; a tag has one");
    }
    partial.seen[line.corner] = true;
    sighting.corners[line.corner] = line.at;
  }
  std::map<std::string, int> marks;   // of each family
  std::map<std::string, int> single;  // those with one corner
  for (const auto& [key, partial] : partials) {
    ++marks[sightings[partial.index].family];
    const auto missing = std::ranges::find(partial.seen, false);
    if (missing == partial.seen.end()) continue;
    TagSighting& sighting = sightings[partial.index];
    if (partial.seen[0] && std::ranges::count(partial.seen, true) == 1) {
      sighting.corners.resize(1);
      ++single[sighting.family];
      continue;
    }
    return InvalidArgument(partial.place, ": ", Name(sighting), " has no corner ",
                           missing - partial.seen.begin());
  }
  for (const auto& [family, count] : single) {
    if (count == marks.at(family)) continue;
    return InvalidArgument(file, ": of ", family, ", ", count,
                           " marks have one corner and the others four; a tag has four");
  }
  return sightings;
}

}  // namespace silhouette
