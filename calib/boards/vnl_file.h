// SPDX-License-Identifier: Apache-2.0
// mrcal's table of a board's corners (corners.vnl): for each image a line per point of the board's
// lattice, row by row from the board's origin, `-` where nothing was seen.
//
//   # filename x y level
//   left/0007.png 311.06 208.94 0
//   left/0007.png - - -
//
// A level stands for a sigma of kVnlSigma * 2^level pixels, 0 also for less; a column `weight`
// instead for kVnlSigma / weight.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"

namespace silhouette {

inline constexpr double kVnlSigma = 0.2;  // pixels

// `file_of`: the image of a sighting. Sightings of other boards are skipped. InvalidArgument: the
// board has no lattice, or an image's name has blanks.
absl::StatusOr<std::string> VnlFileText(
    std::span<const TagSighting> sightings, const Board& board,
    const std::function<std::string(const TagSighting&)>& file_of);

// The sightings of each image by its name, without frame and view. Marks that lack a corner are
// skipped. `file`: what messages call it. InvalidArgument with file and line: not such a table, an
// image with another number of lines than the board's lattice has points; or the board has none.
absl::StatusOr<std::map<std::string, std::vector<TagSighting>>> SightingsFromVnl(
    const std::string& text, const std::string& file, const Board& board);

}  // namespace silhouette
