// The boards of a calibration session as a YAML file: a list of
//
//   - name: wall                  # as messages call it
//     family: tagStandard41h12    # of its tags; this one if not said
//     rows: 4                     # of tags; 1 if not said
//     columns: 6
//     tag_size: 0.040             # metres, from corner to corner
//     gap: 0.040                  # metres, between the corners of neighbours
//     first_id: 0                 # ids go row by row from here; 0 if not said
#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/board.h"

namespace silhouette {

// A tag that is larger, in metres, is taken for one in other units.
inline constexpr double kLargestTag = 3;

// What keeps the boards from being used in one session: an unknown family, ids that the family does
// not have, prints of neighbouring tags that overlap, a tag_size above kLargestTag, two boards of
// one name, a tag on two boards. OK: nothing. InvalidArgument, naming the boards.
absl::Status CheckBoards(std::span<const Board> boards);

std::string BoardFileText(std::span<const Board> boards);

// `file`: what messages call it. InvalidArgument with file and line: not such a list, a key that is
// missing or unknown, what Board and CheckBoards refuse.
absl::StatusOr<std::vector<Board>> BoardsFromText(const std::string& text, const std::string& file);

}  // namespace silhouette
