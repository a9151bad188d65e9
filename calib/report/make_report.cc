// SPDX-License-Identifier: Apache-2.0
// MakeReport.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_network.h"
#include "calib/poses/pose_problem.h"
#include "calib/report/quality_report.h"
#include "calib/report/view_errors.h"

namespace silhouette {
namespace {

constexpr int kLeast = 4;  // of what is left out in turn

// Per sighting the place of its surveyed board among these; -1: it is of none.
std::vector<int> SurveyedBoardsOf(const PoseProblem& problem) {
  std::vector<int> boards;
  for (const TagSighting& seen : problem.sightings) {
    int place = 0;
    int found = -1;
    for (const PoseBoard& board : problem.boards) {
      if (board.place != BoardPlace::kSurveyed) continue;
      if (board.board.HasTag(seen.family, seen.tag)) found = place;
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

struct SightingGroups {
  HeldOutBy by = HeldOutBy::kNothing;
  int count = 0;
  std::vector<int> group;  // per sighting
};

struct LeftOutPart {
  PoseSolution solution;
  std::vector<size_t> left_out;  // sightings
};

// All frames with sightings: those with a pose of the robot in the order in which it drove, then
// the others as they come.
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

// Groups alike in size: of frames, one after the other into the next group; of surveyed boards
// where there are fewer than four frames; none where there are fewer than four of these too.
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
  const int count =
      static_cast<int>(std::set<int>(boards.begin(), boards.end()).size() -
                       static_cast<size_t>(std::ranges::count(boards, -1) > 0 ? 1 : 0));
  if (count < kLeast) return result;
  result.by = HeldOutBy::kBoards;
  result.count = std::min(groups, count);
  for (const int board : boards) result.group.push_back(board < 0 ? -1 : board % result.count);
  return result;
}

// Per sighting 0 for the first half of the frames in order, else 1: of those with a pose of the
// robot and of the others by themselves. None of fewer than four frames.
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

// The problem with the sightings of one group alone (`inside`), or with all others.
PoseProblem PartOf(const PoseProblem& problem, const SightingGroups& groups, int group,
                   bool inside) {
  PoseProblem part = problem;
  part.sightings.clear();
  part.step = PoseProblem().step;
  for (size_t i = 0; i < problem.sightings.size(); ++i) {
    if ((groups.group[i] == group) == inside) part.sightings.push_back(problem.sightings[i]);
  }
  return part;
}

// One per group, but for those without which there is no calibration: of these `report` is warned.
// Fills what the report says of groups.
std::vector<LeftOutPart> SolveWithoutEach(const PoseProblem& problem, const SightingGroups& groups,
                                          QualityReport& report) {
  std::vector<LeftOutPart> parts;
  std::vector<std::string> failed;
  for (int group = 0; group < groups.count; ++group) {
    problem.step(absl::StrCat("without group ", group + 1, " of ", groups.count));
    absl::StatusOr<PoseSolution> solution = CalibratePoses(PartOf(problem, groups, group, false));
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

class Maker {
 public:
  Maker(const PoseProblem& problem, const ReportSettings& settings)
      : problem_(problem), settings_(settings) {
    problem_.accept_doubts = true;  // the report shows what is doubted
  }

  absl::StatusOr<QualityReport> Make() {
    if (settings_.groups < 2) return absl::InvalidArgumentError("two groups are the least");
    absl::StatusOr<PoseSolution> solution = CalibratePoses(problem_);
    if (!solution.ok() && !absl::IsFailedPrecondition(solution.status())) return solution.status();
    absl::StatusOr<PoseNetwork> network = NetworkOf(problem_);
    if (network.ok()) FindCandidates(*network);
    if (solution.ok()) {
      solution_ = *std::move(solution);
    } else {
      report_.refusal = std::string(solution.status().message());
    }
    AddViews(network.ok() ? &*network : nullptr);
    AddImages();
    if (report_.refusal.empty()) {
      AddStatistics();
      FindWorkspace(*network);
      HoldOut();
      CompareHalves();
      WarnOfPairing(*network);
    }
    report_.pairs = distances_.Result();
    FillMaps();
    for (std::string& warning : WarningsOf(report_)) report_.warnings.push_back(std::move(warning));
    return std::move(report_);
  }

 private:
  size_t ViewOf(size_t sighting) const {
    return view_places_.at(problem_.sightings[sighting].view);
  }

  void AddViews(const PoseNetwork* network) {
    for (const PoseView& view : problem_.views) {
      ReportView entry{.name = view.name,
                       .on_flange = view.on_flange,
                       .width = view.lens.width,
                       .height = view.lens.height};
      const auto place = static_cast<int>(report_.views.size());
      if (network != nullptr) entry.tilt_deg = TiltOf(*network, place);
      view_places_.emplace(view.name, report_.views.size());
      report_.views.push_back(std::move(entry));
    }
    workspaces_.resize(report_.views.size());
  }

  // All corners of the sightings where there is no solution, else those of its residuals.
  void AddImages() {
    for (const std::string& frame : FramesInOrder(problem_)) {
      frame_places_.emplace(frame, report_.frames.size());
      report_.frames.push_back({.name = frame});
    }
    std::map<std::pair<size_t, size_t>, size_t> images;  // by frame and view
    for (size_t i = 0; i < problem_.sightings.size(); ++i) images.emplace(ImageOf(i), 0);
    for (auto& [place, index] : images) {
      index = report_.images.size();
      report_.images.push_back(
          {.frame = report_.frames[place.first].name, .view = report_.views[place.second].name});
    }
    images_ = std::move(images);
    if (!report_.refusal.empty()) {
      for (size_t i = 0; i < problem_.sightings.size(); ++i) {
        const auto corners = static_cast<int>(problem_.sightings[i].corners.size());
        for (int corner = 0; corner < corners; ++corner) AddCorner({i, corner, {0, 0}, false});
      }
    }
    for (const CornerResidual& corner : solution_.residuals) AddCorner(corner);
    for (const auto& [place, index] : images_) {
      const ReportImage& image = report_.images[index];
      if (image.corners + image.outliers > 0) ++report_.views[place.second].frames;
    }
    FinishFit();
  }

  std::pair<size_t, size_t> ImageOf(size_t sighting) const {
    return {frame_places_.at(problem_.sightings[sighting].frame), ViewOf(sighting)};
  }

  void AddCorner(const CornerResidual& corner) {
    ReportView& view = report_.views[ViewOf(corner.sighting)];
    ReportImage& image = report_.images[images_.at(ImageOf(corner.sighting))];
    const auto place = static_cast<size_t>(corner.corner);
    corner_places_.emplace(std::pair(corner.sighting, corner.corner), view.points.size());
    view.points.push_back({.pixel = problem_.sightings[corner.sighting].corners[place],
                           .fit = corner.residual,
                           .held_out{},
                           .outlier = corner.outlier});
    if (corner.outlier) {
      outliers_.emplace(corner.sighting, corner.corner);
      ++view.outliers;
      ++image.outliers;
      return;
    }
    ++view.corners;
    ++image.corners;
    fits_of_views_[view.name].Add(corner.residual);
    fits_of_images_[&image - report_.images.data()].Add(corner.residual);
  }

  void FinishFit() {
    for (ReportView& view : report_.views) view.fit_px = fits_of_views_[view.name].Rms();
    for (const auto& [image, sum] : fits_of_images_) {
      report_.images[static_cast<size_t>(image)].fit_px = sum.Rms();
    }
  }

  void AddStatistics() {
    report_.chi2_per_dof = solution_.chi2_per_dof;
    report_.dof = solution_.dof;
    report_.image_noise_factor = solution_.image_noise_factor;
    report_.robot_noise_factor = solution_.robot_noise_factor;
    report_.survey_noise_factor = solution_.survey_noise_factor;
    report_.warnings = solution_.warnings;
    report_.doubts = solution_.doubts;
    std::set<std::string> driven;
    for (const RobotPose& pose : problem_.robot_poses) driven.insert(pose.frame);
    for (const SolvedFrame& solved : solution_.frames) {
      ReportFrame& frame = report_.frames[frame_places_.at(solved.name)];
      frame.robot = driven.contains(solved.name) && solution_.robot_noise_factor > 0;
      frame.robot_mm = 1000 * solved.robot_offset;
      frame.robot_deg = solved.robot_rotation * 180 / std::numbers::pi;
      frame.robot_outlier = solved.robot_outlier;
    }
  }

  void FindWorkspace(const PoseNetwork& network) {
    const bool given = !problem_.workspace.empty();
    report_.workspace = given ? settings_.workspace_name : "the space in which boards were seen";
    for (size_t v = 0; v < report_.views.size(); ++v) {
      ReportView& view = report_.views[v];
      const CameraModel& lens = network.lenses[v];
      const SolvedView& solved = solution_.views[v];
      const std::vector<Eigen::Vector3d> all =
          given && !view.on_flange ? problem_.workspace
                                   : SpaceOfBoards(network, solution_, view.on_flange);
      workspaces_[v] = PointsInImage(lens, solved, all);
      PixelSum pixels;
      PixelSum metres;
      for (const Eigen::Vector3d& point : workspaces_[v]) {
        const double variance = PixelVariance(lens, solved, point).value_or(0);
        pixels.Add(variance);
        view.predicted.worst_px = std::max(view.predicted.worst_px, std::sqrt(variance));
        const double sigma = PointSigma(solved.covariance, point);
        metres.Add(sigma * sigma);
      }
      view.predicted.points = pixels.count();
      view.predicted.px = pixels.Rms();
      view.predicted.mm = 1000 * metres.Rms();
    }
  }

  void HoldOut() {
    const SightingGroups groups = GroupsOf(problem_, settings_.groups);
    std::vector<PoseSolution> solutions;
    std::vector<PixelSum> found(report_.images.size());
    std::vector<PixelSum> expected(report_.images.size());
    std::vector<PixelSum> found_by_view(report_.views.size());
    std::vector<PixelSum> expected_by_view(report_.views.size());
    for (const LeftOutPart& part : SolveWithoutEach(problem_, groups, report_)) {
      const HeldOutTask task{problem_, solution_, outliers_, part.solution, part.left_out};
      for (const HeldOutCorner& corner : PredictHeldOut(task)) {
        const size_t image = images_.at(ImageOf(corner.sighting));
        const size_t view = ViewOf(corner.sighting);
        found[image].Add(corner.residual);
        expected[image].Add(corner.expected);
        found_by_view[view].Add(corner.residual);
        expected_by_view[view].Add(corner.expected);
        const auto place = corner_places_.find({corner.sighting, corner.corner});
        if (place != corner_places_.end()) {
          report_.views[view].points[place->second].held_out = corner.residual;
        }
      }
      distances_.Add(task);
      solutions.push_back(part.solution);
    }
    const auto error = [](const PixelSum& px, const PixelSum& by_sigmas) {
      return HeldOutError{.corners = px.count(), .px = px.Rms(), .expected_px = by_sigmas.Rms()};
    };
    for (size_t i = 0; i < found.size(); ++i) {
      report_.images[i].held_out = error(found[i], expected[i]);
    }
    for (size_t v = 0; v < report_.views.size(); ++v) {
      report_.views[v].held_out = error(found_by_view[v], expected_by_view[v]);
      if (solutions.size() < 2 || workspaces_[v].empty()) continue;
      report_.views[v].repeatability = JackknifeOf(problem_, v, workspaces_[v], solutions);
    }
  }

  void CompareHalves() {
    const SightingGroups halves = HalvesOf(problem_);
    if (halves.count < 2) return;
    problem_.step("each half of the frames");
    const absl::StatusOr<PoseSolution> first = CalibratePoses(PartOf(problem_, halves, 0, true));
    const absl::StatusOr<PoseSolution> second = CalibratePoses(PartOf(problem_, halves, 1, true));
    if (!first.ok() || !second.ok()) {
      report_.warnings.push_back(absl::StrCat(
          "the ", first.ok() ? "second" : "first",
          " half of the frames alone gives no calibration, so it is unknown whether a camera "
          "moved: ",
          (first.ok() ? second : first).status().message()));
      return;
    }
    for (size_t v = 0; v < report_.views.size(); ++v) {
      if (workspaces_[v].empty()) continue;
      report_.views[v].halves = DifferenceOf(problem_, v, workspaces_[v], *first, *second);
    }
  }

  void WarnOfPairing(const PoseNetwork& network) {
    for (const int by : {1, -1}) {
      std::vector<std::string> frames = FramesThatFitAnother(network, solution_, by);
      if (frames.size() < 2) continue;
      for (std::string& frame : frames) frame = absl::StrCat("'", frame, "'");
      report_.warnings.push_back(
          absl::StrCat("the pairing of images and robot poses looks shifted by one: the frames ",
                       FewOf(frames), " fit the pose of the frame ", by > 0 ? "after" : "before",
                       " them; was an image lost or taken twice?"));
    }
  }

  void FillMaps() {
    for (size_t v = 0; v < report_.views.size(); ++v) {
      FillMap(CameraModel(problem_.views[v].lens, Eigen::Isometry3d::Identity()),
              report_.refusal.empty() ? &solution_.views[v] : nullptr, workspaces_[v],
              report_.views[v]);
    }
  }

  PoseProblem problem_;
  const ReportSettings& settings_;
  PoseSolution solution_;
  QualityReport report_;
  std::map<std::string, size_t> view_places_;
  std::map<std::string, size_t> frame_places_;
  std::map<std::pair<size_t, size_t>, size_t> images_;      // by frame and view
  std::map<std::pair<size_t, int>, size_t> corner_places_;  // in ReportView::points
  std::map<std::string, PixelSum> fits_of_views_;
  std::map<std::ptrdiff_t, PixelSum> fits_of_images_;
  CornerSet outliers_;
  std::vector<std::vector<Eigen::Vector3d>> workspaces_;  // per view, in its image
  PairDistances distances_{problem_};
};

}  // namespace

absl::StatusOr<QualityReport> MakeReport(const PoseProblem& problem,
                                         const ReportSettings& settings) {
  absl::StatusOr<QualityReport> report = Maker(problem, settings).Make();
  if (report.ok() && problem.accept_doubts) report->doubts.clear();
  return report;
}

}  // namespace silhouette
