// SPDX-License-Identifier: Apache-2.0
// The arguments of `run`, and the settings of a session that follow from them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/silhouette-calibrate/run_session.h"

namespace silhouette {

struct RunArguments {
  std::string cell;
  std::string boards;
  std::string out;
  std::string flange_board;
  std::string flange_link;
  std::string cameras;
  size_t frames = 30;
  std::vector<std::string> joints;  // name=lower:upper
  std::optional<double> floor;
  std::string poses;
  uint64_t seed = 1;
};

// InvalidArgument or NotFound in a sentence: files that are not there or wrong, boards, links or
// joints that there are not, a range that is none.
absl::StatusOr<SessionSettings> SettingsOf(const RunArguments& arguments, const Cell& cell,
                                           const RobotModel& robot);

}  // namespace silhouette
