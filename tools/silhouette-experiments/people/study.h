// SPDX-License-Identifier: Apache-2.0
// Many episodes, on all processors; what is done is kept in a file, from which the same study goes
// on.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/silhouette-experiments/people/episode.h"

namespace silhouette::people_experiment {

struct Study {
  EpisodeSettings episode;
  int episodes = 0;
  std::vector<std::string> methods;
  // Where results are kept, a line of JSON each; empty: nowhere. It also says what they rest on.
  std::string file;
  // What the results rest on besides: the same for the same cell files, robot images and least
  // obstacle.
  std::string basis;
};

// How many of episodes and methods are done, of all, and how many of these an earlier run did.
using StudyProgress = std::function<void(size_t done, size_t kept)>;

// Sorted by episode, then in the order of the methods. FailedPrecondition: the file is of a study
// with other settings, or another study writes to its folder. Cancelled: `stop` said so; what is
// done is kept.
absl::StatusOr<std::vector<EpisodeResult>> RunStudy(const Stage& stage, const Study& study,
                                                    const StudyProgress& progress,
                                                    const std::function<bool()>& stop);

}  // namespace silhouette::people_experiment
