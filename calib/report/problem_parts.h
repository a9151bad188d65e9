// SPDX-License-Identifier: Apache-2.0
// Parts of a problem, to be left out or to stand alone.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"
#include "calib/report/quality_report.h"

namespace silhouette {

// All frames with sightings: those with a pose of the robot in the order in which it drove, then
// the others as they come.
std::vector<std::string> FramesInOrder(const PoseProblem& problem);

struct SightingGroups {
  HeldOutBy by = HeldOutBy::kNothing;
  int count = 0;
  std::vector<int> group;  // per sighting
};

// Groups alike in size: of frames, one after the other into the next group; of surveyed boards
// where there are fewer than four frames; none where there are fewer than four of these too.
SightingGroups GroupsOf(const PoseProblem& problem, int groups);

// Per sighting 0 for the first half of the frames in order, else 1: of those with a pose of the
// robot and of the others by themselves. None of fewer than four frames.
SightingGroups HalvesOf(const PoseProblem& problem);

// The sightings of one group alone, or all others.
PoseProblem Only(const PoseProblem& problem, const SightingGroups& groups, int group);
PoseProblem Without(const PoseProblem& problem, const SightingGroups& groups, int group);

struct LeftOutPart {
  PoseSolution solution;
  std::vector<size_t> left_out;  // sightings
};

// One per group, but for those without which there is no calibration: of these `report` is warned.
// Fills what the report says of groups.
std::vector<LeftOutPart> SolveWithoutEach(const PoseProblem& problem, const SightingGroups& groups,
                                          QualityReport& report);

}  // namespace silhouette
