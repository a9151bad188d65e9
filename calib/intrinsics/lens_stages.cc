// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/lens_stages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Median of the length of a normally distributed pair over its standard deviation per axis.
constexpr double kMedianLength = 1.1774;
// Corners are hardly ever found better, pixels: residuals that are shorter contradict nothing.
constexpr double kLeastNoise = 0.01;

// Other lens models keep the regularisation to the end: the terms of a rational lens can stand for
// each other (k1 and k4 grow into the thousands, the focal length becomes uncertain by a per cent,
// and the solve takes ten times as long), as can those of LENSMODEL_CAHVOR, and knots of a spline
// without any observation are not determined at all. It moves projections by some 0.001 px.
bool IsWellDetermined(const LensProblem& problem) {
  const size_t parameters = problem.intrinsics[0].size();
  return problem.lens_model.starts_with("LENSMODEL_OPENCV") ? parameters <= 9 : parameters == 4;
}

// Lengths of the residuals, weighted by `weights`; negative where there is no corner.
std::vector<double> Lengths(const LensProblem& problem, const std::vector<double>& weights) {
  const std::vector<Eigen::Vector2d> residuals = Residuals(problem);
  std::vector<double> lengths(residuals.size(), -1);
  for (size_t i = 0; i < residuals.size(); ++i) {
    if (weights[i] > 0) lengths[i] = residuals[i].norm() * weights[i];
  }
  return lengths;
}

// Which part of its camera's image a corner is in.
constexpr size_t kPartsX = 4;
constexpr size_t kPartsY = 3;
constexpr size_t kParts = kPartsX * kPartsY;

size_t PartOf(const Eigen::Vector3d& corner, const std::array<int, 2>& size) {
  const auto part = [](double at, int length, size_t count) {
    const double last = static_cast<double>(count) - 1;
    return static_cast<size_t>(std::clamp(std::floor(at / length * (last + 1)), 0.0, last));
  };
  return part(corner.y(), size[1], kPartsY) * kPartsX + part(corner.x(), size[0], kPartsX);
}

// Marks the outliers again. Returns whether that changed anything.
bool MarkOutliers(LensProblem& problem, const std::vector<double>& weights,
                  const OutlierRule& rule) {
  constexpr size_t kEnough = 30;  // corners for a median
  const std::vector<double> lengths = Lengths(problem, weights);
  const size_t corners = problem.CornersPerBoard();
  std::vector<std::vector<double>> of_camera(problem.intrinsics.size());
  std::vector<std::vector<double>> of_part(of_camera.size() * kParts);
  std::vector<size_t> parts(lengths.size());
  for (size_t i = 0; i < lengths.size(); ++i) {
    if (lengths[i] < 0) continue;
    const auto camera = static_cast<size_t>(problem.observations[i / corners].camera);
    parts[i] = camera * kParts + PartOf(problem.corners[i], problem.image_sizes[camera]);
    of_camera[camera].push_back(lengths[i]);
    of_part[parts[i]].push_back(lengths[i]);
  }
  std::vector<double> limits;
  for (size_t part = 0; part < of_part.size(); ++part) {
    const double of_all = Median(of_camera[part / kParts]);
    const bool known = rule.by_part && of_part[part].size() >= kEnough;
    const double here = known ? Median(of_part[part]) : 0;
    limits.push_back(rule.sigmas * std::max(kLeastNoise, std::max(of_all, here) / kMedianLength));
  }
  bool changed = false;
  for (size_t i = 0; i < lengths.size(); ++i) {
    if (lengths[i] < 0) continue;
    // Also what is not a number is an outlier.
    const double weight = lengths[i] <= limits[parts[i]] ? weights[i] : kOutlier;
    changed = changed || weight != problem.corners[i].z();
    problem.corners[i].z() = weight;
  }
  return changed;
}

// A splined lens starts from the stereographic one that it bends.
absl::Status SolveForSplineSeed(LensProblem& problem) {
  LensProblem plain = problem;
  plain.lens_model = "LENSMODEL_STEREOGRAPHIC";
  for (auto& each : plain.intrinsics) each.resize(4);
  for (const bool core : {false, true}) {
    RETURN_IF_ERROR(Solve(plain, {.core = core}));
  }
  for (size_t i = 0; i < problem.intrinsics.size(); ++i) {
    std::copy(plain.intrinsics[i].begin(), plain.intrinsics[i].end(),
              problem.intrinsics[i].begin());
  }
  problem.camera_from_reference = plain.camera_from_reference;
  problem.reference_from_board = plain.reference_from_board;
  return absl::OkStatus();
}

}  // namespace

std::vector<double> PlainLens(int parameters, double focal_length, const Eigen::Vector2d& centre) {
  std::vector<double> intrinsics(static_cast<size_t>(parameters), 0.0);
  intrinsics[0] = intrinsics[1] = focal_length;
  intrinsics[2] = centre.x();
  intrinsics[3] = centre.y();
  return intrinsics;
}

absl::Status SolveRoughly(LensProblem& problem) {
  if (IsSplined(problem.lens_model)) {
    RETURN_IF_ERROR(SolveForSplineSeed(problem));
  }
  for (const FreeParts& step :
       {FreeParts{}, FreeParts{.core = true, .regularisation = true},
        FreeParts{.core = true, .distortion = true, .regularisation = true}}) {
    RETURN_IF_ERROR(Solve(problem, step));
  }
  return absl::OkStatus();
}

FreeParts LastStep(const LensProblem& problem, bool fixed_lenses, bool warp) {
  return {.core = !fixed_lenses,
          .distortion = !fixed_lenses,
          .warp = warp,
          .regularisation = !fixed_lenses && !IsWellDetermined(problem)};
}

absl::Status SolveExactly(LensProblem& problem, bool fixed_lenses, bool warp,
                          const OutlierRule& rule) {
  constexpr int kMostPasses = 8;
  std::vector<double> weights;
  for (const Eigen::Vector3d& corner : problem.corners) weights.push_back(corner.z());
  absl::Status solved = Solve(problem, {.regularisation = false});
  const FreeParts regularised{
      .core = !fixed_lenses, .distortion = !fixed_lenses, .regularisation = !fixed_lenses};
  if (solved.ok() && !fixed_lenses) solved = Solve(problem, regularised);
  const FreeParts last = LastStep(problem, fixed_lenses, warp);
  for (int pass = 0; solved.ok() && pass < kMostPasses; ++pass) {
    const bool changed = MarkOutliers(problem, weights, rule);
    if (!changed && pass > 0) break;
    solved = Solve(problem, last);
  }
  return solved;
}

std::vector<double> MedianResiduals(const LensProblem& problem) {
  std::vector<double> weights;
  for (const Eigen::Vector3d& corner : problem.corners) weights.push_back(corner.z());
  const std::vector<double> lengths = Lengths(problem, weights);
  const size_t corners = problem.CornersPerBoard();
  std::vector<double> medians;
  for (size_t o = 0; o < problem.observations.size(); ++o) {
    std::vector<double> of_view;
    for (size_t i = o * corners; i < (o + 1) * corners; ++i) {
      if (lengths[i] >= 0) of_view.push_back(lengths[i]);
    }
    medians.push_back(Median(std::move(of_view)));
  }
  return medians;
}

namespace {

// An image is none of the others if its residuals are this many times as long.
constexpr double kMisfit = 8;
// Shares of a camera's images that may misfit.
constexpr double kMostMisfits = 0.25;

// The corners as a lens without distortion of focal length 1 would see them.
std::vector<Eigen::Vector3d> Straightened(const std::vector<Eigen::Vector3d>& corners,
                                          const std::string& model,
                                          const std::vector<double>& intrinsics) {
  std::vector<Eigen::Vector3d> straight = corners;
  for (Eigen::Vector3d& corner : straight) {
    if (!(corner.z() > 0)) continue;
    const auto ray = UnprojectByLens(model, intrinsics, corner.head<2>());
    if (ray && ray->z() > 1e-3) {
      corner.head<2>() = ray->head<2>() / ray->z();
    } else {
      corner.z() = kNoCorner;
    }
  }
  return straight;
}

// The views that have a pose.
std::vector<PosedView> Posed(const LensCamera& camera, const std::vector<const BoardView*>& views,
                             const Lattice& lattice, const std::vector<double>& intrinsics) {
  std::vector<PosedView> posed;
  for (const BoardView* view : views) {
    std::optional<Eigen::Isometry3d> pose;
    if (camera.fixed) {
      pose = CameraFromBoard(Straightened(view->corners, "LENSMODEL_OPENCV8", intrinsics), lattice,
                             1, {0, 0});
    } else {
      pose = CameraFromBoard(view->corners, lattice, intrinsics[0], {intrinsics[2], intrinsics[3]});
    }
    if (pose) posed.push_back({view, *pose});
  }
  return posed;
}

LensProblem ProblemOfOne(const LensCamera& camera, const std::vector<PosedView>& views,
                         const Lattice& lattice, const std::vector<double>& intrinsics,
                         const LensSettings& settings) {
  LensProblem problem;
  problem.lens_model = LensModelOf(camera, settings);
  problem.image_sizes = {{camera.width, camera.height}};
  problem.intrinsics = {intrinsics};
  problem.camera_from_reference = {Eigen::Isometry3d::Identity()};
  problem.lattice = lattice;
  for (const PosedView& view : views) {
    problem.observations.push_back(
        {.camera = 0, .board = static_cast<int>(problem.reference_from_board.size())});
    problem.reference_from_board.push_back(view.camera_from_board);
    for (const Eigen::Vector3d& corner : view.view->corners) {
      problem.corners.emplace_back(corner.x(), corner.y(), corner.z() > 0 ? 1 : kNoCorner);
    }
  }
  return problem;
}

double LargestSigma(const BoardView& view) {
  double sigma = 0;
  for (const Eigen::Vector3d& corner : view.corners) {
    if (corner.z() > 0) sigma = std::max(sigma, 1 / corner.z());
  }
  return sigma;
}

absl::Status CheckCount(const LensCamera& camera, size_t images, const LensSettings& settings) {
  const auto least = static_cast<size_t>(camera.fixed ? 1 : settings.least_images);
  if (images >= least) return absl::OkStatus();
  return FailedPrecondition(
      absl::StrFormat("view '%s': only %d images show enough of a board, at least %d are needed; "
                      "take 20 to 40, with "
                      "the board tilted and moved all over the image",
                      camera.name, images, least));
}

}  // namespace

double MedianSigma(const std::vector<PosedView>& views) {
  std::vector<double> sigmas;
  for (const PosedView& view : views) {
    for (const Eigen::Vector3d& corner : view.view->corners) {
      if (corner.z() > 0) sigmas.push_back(1 / corner.z());
    }
  }
  return Median(std::move(sigmas));
}

std::string LensModelOf(const LensCamera& camera, const LensSettings& settings) {
  return camera.fixed ? "LENSMODEL_OPENCV8" : settings.lens_model;
}

absl::StatusOr<SingleCamera> SolveAlone(const LensCamera& camera,
                                        const std::vector<const BoardView*>& views,
                                        const Lattice& lattice, const LensSettings& settings) {
  SingleCamera result;
  ASSIGN_OR_RETURN(const int parameters, LensParameters(LensModelOf(camera, settings)));
  RETURN_IF_ERROR(CheckCount(camera, views.size(), settings));
  if (camera.fixed) {
    const CameraIntrinsics& k = *camera.fixed;
    result.intrinsics = {k.fx, k.fy, k.cx, k.cy};
    result.intrinsics.insert(result.intrinsics.end(), k.distortion.begin(), k.distortion.end());
    result.views = Posed(camera, views, lattice, result.intrinsics);
    RETURN_IF_ERROR(CheckCount(camera, result.views.size(), settings));
    return result;
  }
  const double focal_length = GuessFocalLength(views, lattice, camera.width, camera.height);
  const std::vector<double> seed =
      PlainLens(parameters, focal_length, {(camera.width - 1) / 2.0, (camera.height - 1) / 2.0});
  result.views = Posed(camera, views, lattice, seed);
  const size_t all = result.views.size();
  const double sigma = MedianSigma(result.views);
  size_t worst_count = 0;
  while (true) {
    RETURN_IF_ERROR(CheckCount(camera, result.views.size(), settings));
    LensProblem problem = ProblemOfOne(camera, result.views, lattice, seed, settings);
    RETURN_IF_ERROR(SolveRoughly(problem));
    result.intrinsics = problem.intrinsics[0];
    const std::vector<double> medians = MedianResiduals(problem);
    const auto worst = std::ranges::max_element(medians);
    const auto place = worst - medians.begin();
    for (size_t i = 0; i < result.views.size(); ++i) {
      result.views[i].camera_from_board = problem.reference_from_board[i];
    }
    const PosedView& view = result.views[static_cast<size_t>(place)];
    const double noise = std::max(kLeastNoise, Median(medians));
    // Images whose corners are said to be less exact than the others' may be.
    if (*worst <= kMisfit * noise * std::max(1.0, LargestSigma(*view.view) / sigma)) break;
    if (++worst_count > kMostMisfits * static_cast<double>(all)) {
      return InvalidArgument(
          "view '", camera.name,
          "': more than a quarter of its images do not fit the others; they "
          "may be of several sizes, zoom or focus settings, or of several cameras: "
          "take all with one camera, without touching it");
    }
    result.warnings.push_back(absl::StrFormat(
        "view '%s': the image of the frame '%s' fits far worse than the others (%.2g against %.2g "
        "px) and is left out; it may be blurred or of another size",
        camera.name, view.view->frame, *worst, Median(medians)));
    result.views.erase(result.views.begin() + place);
  }
  return result;
}

namespace {

struct PosedBoard {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  double error = 0;  // rms, pixels
};

std::optional<PosedBoard> Pose(const std::vector<Eigen::Vector3d>& corners, const Lattice& lattice,
                               double focal_length, const Eigen::Vector2d& centre) {
  std::vector<cv::Point3d> on_board;
  std::vector<cv::Point2d> seen;
  for (size_t i = 0; i < corners.size(); ++i) {
    if (!(corners[i].z() > 0)) continue;
    const auto width = static_cast<size_t>(lattice.width);
    const size_t row = i / width;
    const size_t column = i % width;
    on_board.emplace_back(lattice.spacing * static_cast<double>(column),
                          lattice.spacing * static_cast<double>(row), 0);
    seen.emplace_back(corners[i].x(), corners[i].y());
  }
  if (seen.size() < 4) return std::nullopt;
  const cv::Matx33d camera(focal_length, 0, centre.x(), 0, focal_length, centre.y(), 0, 0, 1);
  std::vector<cv::Vec3d> rotations;
  std::vector<cv::Vec3d> translations;
  std::vector<double> errors;
  try {
    cv::solvePnPGeneric(on_board, seen, camera, cv::noArray(), rotations, translations, false,
                        cv::SOLVEPNP_IPPE, cv::noArray(), cv::noArray(), errors);
  } catch (const cv::Exception&) {
    return std::nullopt;  // corners on one line, or otherwise of no plane
  }
  std::optional<PosedBoard> best;
  for (size_t i = 0; i < rotations.size(); ++i) {
    const cv::Vec3d& r = rotations[i];
    const cv::Vec3d& t = translations[i];
    if (!std::isfinite(errors[i]) || !(t[2] > 0) || (best && best->error <= errors[i])) continue;
    best = PosedBoard{PoseOf({r[0], r[1], r[2]}, {t[0], t[1], t[2]}), errors[i]};
  }
  return best;
}

}  // namespace

std::optional<Eigen::Isometry3d> CameraFromBoard(const std::vector<Eigen::Vector3d>& corners,
                                                 const Lattice& lattice, double focal_length,
                                                 const Eigen::Vector2d& centre) {
  const std::optional<PosedBoard> posed = Pose(corners, lattice, focal_length, centre);
  if (!posed) return std::nullopt;
  return posed->pose;
}

double GuessFocalLength(const std::vector<const BoardView*>& views, const Lattice& lattice,
                        int width, int height) {
  constexpr size_t kViews = 20;
  constexpr int kGuesses = 14;
  const double longer = std::max(width, height);
  const Eigen::Vector2d centre((width - 1) / 2.0, (height - 1) / 2.0);
  double best = longer;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kGuesses; ++i) {
    const double guess = 0.35 * longer * std::pow(1.22, i);  // up to 4.6 times the longer side
    double sum = 0;
    const size_t step = std::max<size_t>(1, views.size() / kViews);
    for (size_t k = 0; k < views.size(); k += step) {
      const auto posed = Pose(views[k]->corners, lattice, guess, centre);
      // Some images may be bad: they must not decide.
      sum += posed ? std::min(posed->error, 0.02 * longer) : 0.02 * longer;
    }
    if (sum < least) {
      least = sum;
      best = guess;
    }
  }
  return best;
}

}  // namespace silhouette
