// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/vnl_file.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "calib/boards/csv.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

struct VnlPoint {
  Eigen::Vector2d at;
  double sigma = 0;
};

using VnlPoints = std::vector<std::optional<VnlPoint>>;  // of the lattice, row by row

size_t PointOf(const Lattice& lattice, const GridPlace& place) {
  return static_cast<size_t>(place.row) * static_cast<size_t>(lattice.width) +
         static_cast<size_t>(place.column);
}

absl::StatusOr<Lattice> LatticeOf(const Board& board) {
  const std::optional<Lattice> lattice = board.lattice();
  if (lattice && lattice->exact) return *lattice;
  return InvalidArgument("board '", board.description().name,
                         "': its corners are on no regular lattice, which corners.vnl needs");
}

// Nothing: the point was not seen. `weights`: the last field is a weight, not a level.
absl::StatusOr<std::optional<VnlPoint>> ReadPoint(const std::vector<std::string>& fields,
                                                  bool weights, const std::string& place) {
  if (fields.size() < 3 || fields.size() > 4) {
    return InvalidArgument(place, ": a line is filename, x, y, and a level or weight");
  }
  if (fields[1] == "-" || fields[2] == "-") return std::nullopt;
  if (fields.size() == 4 && fields[3] == "-") return std::nullopt;
  VnlPoint point{.at{}, .sigma = kVnlSigma};
  double quality = weights ? 1 : 0;
  if (!absl::SimpleAtod(fields[1], &point.at.x()) || !absl::SimpleAtod(fields[2], &point.at.y()) ||
      (fields.size() == 4 && !absl::SimpleAtod(fields[3], &quality)) || !point.at.allFinite()) {
    return InvalidArgument(place, ": x, y, and level or weight must be numbers or -");
  }
  if (quality < 0 || (weights && quality == 0)) return std::nullopt;
  point.sigma = weights ? kVnlSigma / quality : kVnlSigma * std::exp2(quality);
  return point;
}

absl::StatusOr<std::map<std::string, VnlPoints>> ReadPoints(const std::string& text,
                                                            const std::string& file) {
  std::map<std::string, VnlPoints> images;
  bool weights = false;
  int number = 0;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    const std::string place = absl::StrCat(file, ":", ++number);
    if (absl::StartsWith(line, "#")) {
      weights = weights || absl::StrContains(line, "weight");
      continue;
    }
    const std::vector<std::string> fields =
        absl::StrSplit(line, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    if (fields.empty()) continue;
    ASSIGN_OR_RETURN(const std::optional<VnlPoint> point, ReadPoint(fields, weights, place));
    images[fields.front()].push_back(point);
  }
  if (images.empty()) return InvalidArgument(file, ": there is no corner");
  return images;
}

// An image without any corner has one line.
bool IsEmpty(const VnlPoints& points) { return points.size() == 1 && !points.front(); }

std::vector<TagSighting> SightingsOfPoints(const VnlPoints& points, const Board& board,
                                           const Lattice& lattice) {
  std::vector<TagSighting> sightings;
  for (int id = board.first_mark(); board.HasTag(id); ++id) {
    TagSighting sighting{.frame = "", .view = "", .family = board.family(), .tag = id};
    for (int corner = 0; corner < board.corners_per_mark(); ++corner) {
      const auto& point = points[PointOf(lattice, board.LatticePlaceOf(id, corner))];
      if (!point) break;
      sighting.corners.push_back(point->at);
      sighting.sigma = std::max(sighting.sigma, point->sigma);
    }
    if (sighting.corners.size() == static_cast<size_t>(board.corners_per_mark())) {
      sightings.push_back(std::move(sighting));
    }
  }
  return sightings;
}

}  // namespace

absl::StatusOr<std::string> VnlFileText(
    std::span<const TagSighting> sightings, const Board& board,
    const std::function<std::string(const TagSighting&)>& file_of) {
  ASSIGN_OR_RETURN(const Lattice lattice, LatticeOf(board));
  std::map<std::string, VnlPoints> images;
  for (const TagSighting& sighting : sightings) {
    if (!board.HasTag(sighting.family, sighting.tag)) continue;
    const std::string file = file_of(sighting);
    if (file.find_first_of(" \t\r\n#") != std::string::npos) {
      return InvalidArgument("'", file, "': a name in corners.vnl has no blanks; rename the image");
    }
    VnlPoints& points = images[file];
    points.resize(static_cast<size_t>(lattice.width) * static_cast<size_t>(lattice.height));
    for (size_t i = 0; i < sighting.corners.size(); ++i) {
      const GridPlace place = board.LatticePlaceOf(sighting.tag, static_cast<int>(i));
      points[PointOf(lattice, place)] = {sighting.corners[i], sighting.sigma};
    }
  }
  std::string text = "# filename x y level\n";
  for (const auto& [file, points] : images) {
    for (const std::optional<VnlPoint>& point : points) {
      absl::StrAppend(&text, file, " ");
      if (point) {
        absl::StrAppend(&text, CsvNumber(point->at.x()), " ", CsvNumber(point->at.y()), " ",
                        CsvNumber(std::max(0.0, std::log2(point->sigma / kVnlSigma))), "\n");
      } else {
        absl::StrAppend(&text, "- - -\n");
      }
    }
  }
  return text;
}

absl::StatusOr<std::map<std::string, std::vector<TagSighting>>> SightingsFromVnl(
    const std::string& text, const std::string& file, const Board& board) {
  ASSIGN_OR_RETURN(const Lattice lattice, LatticeOf(board));
  const auto count = static_cast<size_t>(lattice.width) * static_cast<size_t>(lattice.height);
  ASSIGN_OR_RETURN(const auto images, ReadPoints(text, file));
  std::map<std::string, std::vector<TagSighting>> sightings;
  for (const auto& [image, points] : images) {
    if (IsEmpty(points)) continue;
    if (points.size() != count) {
      return InvalidArgument(file, ": '", image, "' has ", points.size(), " lines, but board '",
                             board.description().name, "' has ", lattice.width, "x", lattice.height,
                             " corners; describe the board (columns x rows) as it was detected");
    }
    sightings[image] = SightingsOfPoints(points, board, lattice);
  }
  return sightings;
}

}  // namespace silhouette
