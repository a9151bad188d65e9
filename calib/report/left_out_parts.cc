#include "calib/report/left_out_parts.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/poses/pose_calibration.h"

namespace silhouette {

std::vector<LeftOutPart> SolveWithoutEach(const PoseProblem& problem, const SightingGroups& groups,
                                          QualityReport& report) {
  std::vector<LeftOutPart> parts;
  std::vector<std::string> failed;
  for (int group = 0; group < groups.count; ++group) {
    absl::StatusOr<PoseSolution> solution = CalibratePoses(Without(problem, groups, group));
    if (!solution.ok()) {
      failed.emplace_back(solution.status().message());
      continue;
    }
    LeftOutPart part{.solution = *std::move(solution), .left_out{}};
    for (size_t i = 0; i < groups.group.size(); ++i) {
      if (groups.group[i] == group) part.left_out.push_back(i);
    }
    parts.push_back(std::move(part));
  }
  if (!failed.empty()) {
    report.warnings.push_back(absl::StrCat(
        "there is no calibration if ", failed.size() == 1 ? "one" : absl::StrCat(failed.size()),
        " of ", groups.count, " groups of ", groups.by == HeldOutBy::kFrames ? "frames" : "boards",
        " is left out: ", failed.front()));
  }
  report.held_out_by = parts.empty() ? HeldOutBy::kNothing : groups.by;
  report.groups = static_cast<int>(parts.size());
  return parts;
}

}  // namespace silhouette
