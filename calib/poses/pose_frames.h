// SPDX-License-Identifier: Apache-2.0
// Which pose of the robot belongs to which image, where files call them differently.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/sighting_file.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

// Whether a name is before another one as people count: img2 before img10.
bool IsBefore(const std::string& name, const std::string& other);

// What the pose of a row is called that has no frame; rows count from 1.
std::string NameOfRow(size_t row);

// Names the poses as the sightings' frames: by their order if they are of rows without frames;
// otherwise matched by file name, without folder and extension, by time stamp (the nearest within a
// tenth of the images' median spacing; with a warning unless equal), or, with a warning, by number.
// Returns the warning; empty if nothing had to be guessed. InvalidArgument: it is not certain which
// row or number belongs to which frame.
absl::StatusOr<std::string> NamePosesByFrames(std::span<const TagSighting> sightings,
                                              std::vector<RobotPose>& poses);

// The poses with the names of each other that they have if one list was sorted as people count and
// the other one as text (img1, img10, img2); empty if that is the same. `people`: the poses' list
// was.
std::vector<RobotPose> SortedOtherwise(const std::vector<RobotPose>& poses, bool people);

}  // namespace silhouette
