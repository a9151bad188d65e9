// SPDX-License-Identifier: Apache-2.0
// Lenses that fit, but so badly that something was not as described.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/intrinsics/solve_lenses.h"

namespace silhouette {

// Boards whose tags are by the images farther apart, or nearer, than described: a sentence with the
// gap that was seen. Empty: none.
std::string WrongGaps(const std::vector<Board>& boards, const std::vector<TagSighting>& sightings);

// InvalidArgument: by the images the rows of a board's tags begin at other ids than described,
// as its first id is wrong; with the one that they say. Needs no lenses, and takes no time.
absl::Status CheckFirstIds(const std::vector<Board>& boards,
                           const std::vector<TagSighting>& sightings);

// FailedPrecondition with the reason: corners are off by more than a twentieth of a pixel (in
// images of 640 pixels' width), and another gap between tags, or two lenses, explain it; or they
// are off by more than a pixel. What their sigma says does not matter. Of lenses that are held
// fixed nothing is said.
absl::Status CheckFit(const std::vector<LensCamera>& cameras, const std::vector<Board>& boards,
                      const std::vector<TagSighting>& sightings, const LensSettings& settings,
                      const LensSolution& solution);

}  // namespace silhouette
