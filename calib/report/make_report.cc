// SPDX-License-Identifier: Apache-2.0
#include "calib/report/make_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_network.h"
#include "calib/poses/pose_problem.h"
#include "calib/report/held_out.h"
#include "calib/report/problem_parts.h"
#include "calib/report/view_errors.h"

namespace silhouette {
namespace {

class Maker {
 public:
  Maker(const PoseProblem& problem, const ReportSettings& settings)
      : problem_(problem), settings_(settings) {}

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
        for (int corner = 0; corner < 4; ++corner) AddCorner({i, corner, {0, 0}, false});
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
    const bool given = !settings_.workspace.empty();
    report_.workspace = given ? settings_.workspace_name : "the space in which boards were seen";
    for (size_t v = 0; v < report_.views.size(); ++v) {
      ReportView& view = report_.views[v];
      const CameraModel& lens = network.lenses[v];
      const SolvedView& solved = solution_.views[v];
      const std::vector<Eigen::Vector3d> all =
          given && !view.on_flange ? settings_.workspace
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
    const absl::StatusOr<PoseSolution> first = CalibratePoses(Only(problem_, halves, 0));
    const absl::StatusOr<PoseSolution> second = CalibratePoses(Only(problem_, halves, 1));
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

  const PoseProblem& problem_;
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
  return Maker(problem, settings).Make();
}

}  // namespace silhouette
