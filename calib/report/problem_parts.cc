// SPDX-License-Identifier: Apache-2.0
#include "calib/report/problem_parts.h"

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/poses/pose_calibration.h"

namespace silhouette {
namespace {

constexpr int kLeast = 4;  // of what is left out in turn

PoseProblem Kept(const PoseProblem& problem, const std::function<bool(size_t)>& keep) {
  PoseProblem part = problem;
  part.sightings.clear();
  for (size_t i = 0; i < problem.sightings.size(); ++i) {
    if (keep(i)) part.sightings.push_back(problem.sightings[i]);
  }
  return part;
}

// Per sighting the place of its surveyed board among these; -1: it is of none.
std::vector<int> SurveyedBoardsOf(const PoseProblem& problem) {
  std::vector<int> boards;
  for (const TagSighting& seen : problem.sightings) {
    int place = 0;
    int found = -1;
    for (const PoseBoard& board : problem.boards) {
      if (board.place != BoardPlace::kSurveyed) continue;
      if (board.board.description().family == seen.family && board.board.HasTag(seen.tag)) {
        found = place;
      }
      ++place;
    }
    boards.push_back(found);
  }
  return boards;
}

std::map<std::string, int> PlacesOf(const std::vector<std::string>& frames) {
  std::map<std::string, int> places;
  for (const std::string& frame : frames) places.emplace(frame, static_cast<int>(places.size()));
  return places;
}

}  // namespace

std::vector<std::string> FramesInOrder(const PoseProblem& problem) {
  std::set<std::string> seen;
  for (const TagSighting& sighting : problem.sightings) seen.insert(sighting.frame);
  std::vector<std::string> frames;
  const auto take = [&](const std::string& frame) {
    if (seen.erase(frame) > 0) frames.push_back(frame);
  };
  for (const RobotPose& pose : problem.robot_poses) take(pose.frame);
  for (const TagSighting& sighting : problem.sightings) take(sighting.frame);
  return frames;
}

SightingGroups GroupsOf(const PoseProblem& problem, int groups) {
  SightingGroups result;
  const std::vector<std::string> frames = FramesInOrder(problem);
  if (static_cast<int>(frames.size()) >= kLeast) {
    result.by = HeldOutBy::kFrames;
    result.count = std::min(groups, static_cast<int>(frames.size()));
    const std::map<std::string, int> places = PlacesOf(frames);
    for (const TagSighting& seen : problem.sightings) {
      result.group.push_back(places.at(seen.frame) % result.count);
    }
    return result;
  }
  std::vector<int> boards = SurveyedBoardsOf(problem);
  const int count = static_cast<int>(
      std::set<int>(boards.begin(), boards.end()).size() -
      static_cast<size_t>(std::count(boards.begin(), boards.end(), -1) > 0 ? 1 : 0));
  if (count < kLeast) return result;
  result.by = HeldOutBy::kBoards;
  result.count = std::min(groups, count);
  for (const int board : boards) result.group.push_back(board < 0 ? -1 : board % result.count);
  return result;
}

SightingGroups HalvesOf(const PoseProblem& problem) {
  SightingGroups result;
  std::set<std::string> driven;
  for (const RobotPose& pose : problem.robot_poses) driven.insert(pose.frame);
  std::array<std::vector<std::string>, 2> kinds;
  for (const std::string& frame : FramesInOrder(problem)) {
    kinds[driven.contains(frame) ? 0 : 1].push_back(frame);
  }
  if (static_cast<int>(kinds[0].size() + kinds[1].size()) < kLeast) return result;
  result.by = HeldOutBy::kFrames;
  result.count = 2;
  std::map<std::string, int> half;
  for (const std::vector<std::string>& frames : kinds) {
    for (size_t i = 0; i < frames.size(); ++i) half[frames[i]] = 2 * i < frames.size() ? 0 : 1;
  }
  for (const TagSighting& seen : problem.sightings) result.group.push_back(half.at(seen.frame));
  return result;
}

PoseProblem Only(const PoseProblem& problem, const SightingGroups& groups, int group) {
  return Kept(problem, [&](size_t sighting) { return groups.group[sighting] == group; });
}

PoseProblem Without(const PoseProblem& problem, const SightingGroups& groups, int group) {
  return Kept(problem, [&](size_t sighting) { return groups.group[sighting] != group; });
}

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
