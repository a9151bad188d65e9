// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/solve_lenses.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/files/camera_file.h"
#include "calib/intrinsics/board_views.h"
#include "calib/intrinsics/lens_stages.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

absl::Status CheckCameras(const std::vector<LensCamera>& cameras) {
  if (cameras.empty()) return InvalidArgument("there is no camera to solve for");
  std::set<std::string> names;
  for (const LensCamera& camera : cameras) {
    if (!names.insert(camera.name).second) {
      return InvalidArgument("the view '", camera.name, "' is given twice");
    }
    if (camera.width <= 0 || camera.height <= 0) {
      return InvalidArgument("view '", camera.name, "': its images need a size");
    }
    if (camera.fixed.has_value() != cameras[0].fixed.has_value()) {
      return InvalidArgument("the lens of '", camera.fixed ? cameras[0].name : camera.name,
                             "' is not given; fix the lenses of all views or of none");
    }
    if (camera.fixed &&
        (camera.fixed->width != camera.width || camera.fixed->height != camera.height)) {
      return InvalidArgument("view '", camera.name, "': its lens is given for images of ",
                             camera.fixed->width, "x", camera.fixed->height, " pixels, not of ",
                             camera.width, "x", camera.height);
    }
  }
  return absl::OkStatus();
}

// All that a group's solve needs to know of where its parts come from.
struct GroupProblem {
  LensProblem problem;
  std::vector<const BoardView*> views;  // of each observation
};

GroupProblem GroupProblemOf(size_t group, const std::vector<LensCamera>& cameras,
                            const std::vector<SingleCamera>& singles,
                            const std::vector<PosedView>& views, const CameraTies& ties,
                            const Lattice& lattice, double sigma, const LensSettings& settings) {
  GroupProblem out;
  LensProblem& problem = out.problem;
  const std::vector<size_t>& members = ties.groups[group];
  problem.lens_model = LensModelOf(cameras[0], settings);
  problem.lattice = lattice;
  for (const size_t camera : members) {
    problem.image_sizes.push_back({cameras[camera].width, cameras[camera].height});
    problem.intrinsics.push_back(singles[camera].intrinsics);
    problem.camera_from_reference.push_back(ties.camera_from_reference[camera]);
  }
  for (const Placing& placing : ties.placings) {
    if (placing.group != group) continue;
    for (const size_t i : placing.views) {
      const BoardView& view = *views[i].view;
      const auto place = std::ranges::find(members, view.camera) - members.begin();
      problem.observations.push_back(
          {.camera = static_cast<int>(place),
           .board = static_cast<int>(problem.reference_from_board.size())});
      for (const Eigen::Vector3d& corner : view.corners) {
        problem.corners.emplace_back(corner.x(), corner.y(),
                                     corner.z() > 0 ? sigma * corner.z() : kNoCorner);
      }
      out.views.push_back(&view);
    }
    problem.reference_from_board.push_back(placing.reference_from_board);
  }
  return out;
}

void AddResiduals(const GroupProblem& group, const std::vector<Board>& boards,
                  LensSolution& solution) {
  const LensProblem& problem = group.problem;
  const std::vector<Eigen::Vector2d> residuals = Residuals(problem);
  for (size_t o = 0; o < group.views.size(); ++o) {
    const BoardView& view = *group.views[o];
    const Board& board = boards[view.board];
    for (int place = 0; place < board.tags(); ++place) {
      const int mark = board.first_mark() + place;
      for (int corner = 0; corner < board.corners_per_mark(); ++corner) {
        const size_t at = o * problem.CornersPerBoard() + LatticeIndex(board, mark, corner);
        if (problem.corners[at].z() == kNoCorner) continue;
        solution.residuals.push_back({.frame = view.frame,
                                      .camera = view.camera,
                                      .board = board.description().name,
                                      .tag = mark,
                                      .corner = corner,
                                      .seen = problem.corners[at].head<2>() -
                                              view.ShiftOf(LatticeIndex(board, mark, corner)),
                                      .residual = residuals[at],
                                      .outlier = problem.corners[at].z() == kOutlier});
      }
    }
  }
}

SolvedCamera SolvedCameraOf(const LensCamera& camera, const LensProblem& problem, size_t place,
                            size_t group) {
  SolvedCamera solved{.name = camera.name,
                      .width = camera.width,
                      .height = camera.height,
                      .lens_model = problem.lens_model,
                      .intrinsics = problem.intrinsics[place],
                      .group = group,
                      .camera_from_reference = problem.camera_from_reference[place]};
  const auto& p = solved.intrinsics;
  const bool held = solved.lens_model == "LENSMODEL_PINHOLE" ||
                    (solved.lens_model.starts_with("LENSMODEL_OPENCV") && p.size() <= 12);
  if (held) {
    CameraIntrinsics intrinsics{.width = camera.width,
                                .height = camera.height,
                                .fx = p[0],
                                .fy = p[1],
                                .cx = p[2],
                                .cy = p[3]};
    std::copy(p.begin() + 4, p.end(), intrinsics.distortion.begin());
    solved.model.emplace(intrinsics, solved.camera_from_reference);
  }
  return solved;
}

// FailedPrecondition, or a warning, if images that are said to be taken at once disagree.
absl::Status JudgeJointFit(const GroupProblem& group, const JointFit& fit,
                           const std::vector<LensCamera>& cameras,
                           const std::vector<size_t>& members, std::vector<std::string>& warnings) {
  if (!fit.disagrees && fit.disagreeing.empty()) return absl::OkStatus();
  constexpr size_t kNamed = 5;
  std::vector<std::string> frames;
  std::set<std::string> known;
  for (const JointFit::Disagreeing& each : fit.disagreeing) {
    const auto& observations = group.problem.observations;
    const auto first = std::ranges::find(observations, static_cast<int>(each.placing),
                                         &LensProblem::Observation::board);
    const auto place = static_cast<size_t>(first - observations.begin());
    if (!known.insert(group.views[place]->frame).second || known.size() > kNamed) continue;
    frames.push_back(absl::StrFormat("'%s' (%.2g px)", group.views[place]->frame, each.pixels));
  }
  const std::string names = absl::StrJoin(members, ", ", [&](std::string* out, size_t camera) {
    absl::StrAppend(out, "'", cameras[camera].name, "'");
  });
  const std::string what = absl::StrFormat(
      "%d of %d boards that several of %s saw in one frame were not at one place: %s%s; were the "
      "images taken at once, with the boards at rest?",
      fit.disagreeing.size(), fit.placings, names, absl::StrJoin(frames, ", "),
      known.size() > kNamed ? " and others" : "");
  if (!fit.disagrees || cameras[0].fixed) {
    warnings.push_back(absl::StrCat(
        what, " If not, leave these frames out; else the lens model or the board does not fit"));
    return absl::OkStatus();
  }
  return FailedPrecondition(absl::StrFormat(
      "%s Solved together, the cameras' corners are off by %.3f px, apart by %.3f. Leave these "
      "frames out, or run `intrinsics --not-simultaneous`: each lens is then found by itself, and "
      "`poses` needs other images, with everything at rest",
      what, fit.together, fit.apart));
}

// Solves one group and adds it to the solution.
absl::Status AddGroup(GroupProblem& group, const std::vector<LensCamera>& cameras,
                      const std::vector<Board>& boards, const std::vector<size_t>& members,
                      double sigma, const LensSettings& settings, const OutlierRule& rule,
                      LensSolution& solution) {
  LensProblem& problem = group.problem;
  const bool fixed = cameras[0].fixed.has_value();
  std::set<size_t> used;
  for (const BoardView* view : group.views) used.insert(view->board);
  // A tag by itself can be bent in no way that one could see.
  const bool warp = settings.board_warp && used.size() == 1 && problem.CornersPerBoard() > 4;
  const LensProblem start = problem;
  // The judgement comes first.
  const std::string again = rule.by_part == kResultRule.by_part ? ", again for the result" : "";
  const std::string all =
      absl::StrCat(members.size(), " lenses and ", problem.reference_from_board.size(), " boards");
  settings.step(absl::StrCat(all, " together", again));
  RETURN_IF_ERROR(SolveExactly(problem, fixed, warp, rule));
  settings.step(absl::StrCat(all, " apart, to compare", again));
  ASSIGN_OR_RETURN(const JointFit fit, CompareJointFit(start, problem, fixed, warp, rule));
  RETURN_IF_ERROR(JudgeJointFit(group, fit, cameras, members, solution.warnings));
  settings.step(absl::StrCat("how exact they are", again));
  ASSIGN_OR_RETURN(LensCovariance covariance,
                   CovarianceOf(problem, LastStep(problem, fixed, warp)));
  const size_t place = solution.groups.size();
  LensGroup result{.cameras = members,
                   .noise = std::sqrt(covariance.chi_squared) / sigma,
                   .together = fit.together,
                   .apart = fit.apart,
                   .covariance = std::move(covariance)};
  if (warp) result.warp = problem.warp;
  solution.groups.push_back(std::move(result));
  for (size_t i = 0; i < members.size(); ++i) {
    solution.cameras[members[i]] = SolvedCameraOf(cameras[members[i]], problem, i, place);
  }
  std::set<int> listed;
  for (size_t o = 0; o < group.views.size(); ++o) {
    const int board = problem.observations[o].board;
    if (!listed.insert(board).second) continue;
    solution.boards.push_back(
        {.frame = group.views[o]->frame,
         .board = boards[group.views[o]->board].description().name,
         .group = place,
         .reference_from_board = problem.reference_from_board[static_cast<size_t>(board)]});
  }
  AddResiduals(group, boards, solution);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<LensSolution> SolveLenses(const std::vector<LensCamera>& cameras,
                                         const std::vector<Board>& boards,
                                         const std::vector<TagSighting>& sightings,
                                         const LensSettings& settings) {
  RETURN_IF_ERROR(CheckCameras(cameras));
  for (const LensCamera& camera : cameras) {
    RETURN_IF_ERROR(CheckImageSize(sightings, camera.name, {camera.width, camera.height},
                                   "the stated image size"));
  }
  RETURN_IF_ERROR(LensParameters(settings.lens_model).status());
  ASSIGN_OR_RETURN(BoardViews gathered, GatherBoardViews(cameras, boards, sightings));
  if (!settings.simultaneous) {  // then no two cameras see a board where it stood
    for (BoardView& view : gathered.views) {
      absl::StrAppend(&view.stand, " of ", cameras[view.camera].name);
    }
  }

  LensSolution solution;
  solution.warnings = gathered.warnings;
  std::vector<SingleCamera> singles;
  std::vector<PosedView> views;
  for (size_t i = 0; i < cameras.size(); ++i) {
    std::vector<const BoardView*> own;
    for (const BoardView& view : gathered.views) {
      if (view.camera == i) own.push_back(&view);
    }
    settings.step(absl::StrCat("the lens of '", cameras[i].name, "' by itself"));
    ASSIGN_OR_RETURN(SingleCamera single, SolveAlone(cameras[i], own, gathered.lattice, settings));
    views.insert(views.end(), single.views.begin(), single.views.end());
    solution.warnings.insert(solution.warnings.end(), single.warnings.begin(),
                             single.warnings.end());
    singles.push_back(std::move(single));
  }
  ASSIGN_OR_RETURN(const CameraTies ties, TieCameras(cameras, views));
  solution.warnings.insert(solution.warnings.end(), ties.warnings.begin(), ties.warnings.end());
  solution.cameras.resize(cameras.size());
  const double sigma = MedianSigma(views);
  const auto solve = [&](const OutlierRule& rule) -> absl::StatusOr<LensSolution> {
    LensSolution result = solution;
    for (size_t g = 0; g < ties.groups.size(); ++g) {
      GroupProblem group =
          GroupProblemOf(g, cameras, singles, views, ties, gathered.lattice, sigma, settings);
      RETURN_IF_ERROR(
          AddGroup(group, cameras, boards, ties.groups[g], sigma, settings, rule, result));
    }
    RETURN_IF_ERROR(JudgeLenses(cameras, settings, result));
    return result;
  };
  RETURN_IF_ERROR(solve(kJudgementRule).status());
  return solve(kResultRule);
}

std::optional<Eigen::Matrix2d> ProjectionCovariance(const LensSolution& solution, size_t camera,
                                                    const Eigen::Vector3d& point_in_reference) {
  const auto derivative = ProjectionDerivative(solution, camera, point_in_reference);
  if (!derivative) return std::nullopt;
  const LensGroup& group = solution.groups[solution.cameras[camera].group];
  return *derivative * group.covariance.covariance * derivative->transpose();
}

std::optional<Eigen::Matrix<double, 2, Eigen::Dynamic>> ProjectionDerivative(
    const LensSolution& solution, size_t camera, const Eigen::Vector3d& point_in_reference) {
  const SolvedCamera& solved = solution.cameras[camera];
  const LensGroup& group = solution.groups[solved.group];
  const auto place = std::ranges::find(group.cameras, camera) - group.cameras.begin();
  return DerivativeOfProjection(group.covariance, static_cast<size_t>(place), solved.lens_model,
                                solved.intrinsics, solved.camera_from_reference,
                                point_in_reference);
}

std::optional<double> ProjectionSigma(const LensSolution& solution, size_t camera,
                                      const Eigen::Vector2d& pixel, double distance) {
  const SolvedCamera& solved = solution.cameras[camera];
  const auto ray = UnprojectByLens(solved.lens_model, solved.intrinsics, pixel);
  if (!ray) return std::nullopt;
  const auto covariance = ProjectionCovariance(
      solution, camera, solved.camera_from_reference.inverse() * (distance * *ray));
  if (!covariance) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(*covariance);
  return std::sqrt(std::max(0.0, eigen.eigenvalues()[1]));
}

std::string LensFileText(const SolvedCamera& camera) {
  return CameraFileText(camera.lens_model, camera.intrinsics, camera.width, camera.height,
                        camera.camera_from_reference, camera.name, camera.known);
}

}  // namespace silhouette
