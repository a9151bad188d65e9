#include "calib/intrinsics/lens_stages.h"

#include <algorithm>
#include <cmath>

#include "calib/intrinsics/median.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Median of the length of a normally distributed pair over its standard deviation per axis.
constexpr double kMedianLength = 1.1774;

// Other lens models keep the regularisation to the end: the terms of a rational lens can stand for
// each other (k1 and k4 grow into the thousands, the focal length becomes uncertain by a per cent,
// and the solve takes ten times as long), as can those of LENSMODEL_CAHVOR, and knots of a spline
// that nobody looked through are not determined at all. It moves projections by some 0.001 px.
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

// Marks the outliers anew; whether that changed anything.
bool MarkOutliers(LensProblem& problem, const std::vector<double>& weights, double sigma,
                  double sigmas) {
  const std::vector<double> lengths = Lengths(problem, weights);
  const size_t corners = problem.CornersPerBoard();
  std::vector<std::vector<double>> of_camera(problem.intrinsics.size());
  for (size_t i = 0; i < lengths.size(); ++i) {
    const auto camera = static_cast<size_t>(problem.observations[i / corners].camera);
    if (lengths[i] >= 0) of_camera[camera].push_back(lengths[i]);
  }
  std::vector<double> limits;
  for (auto& each : of_camera) {
    limits.push_back(sigmas * std::max(sigma, Median(std::move(each)) / kMedianLength));
  }
  bool changed = false;
  for (size_t i = 0; i < lengths.size(); ++i) {
    if (lengths[i] < 0) continue;
    const auto camera = static_cast<size_t>(problem.observations[i / corners].camera);
    // Also what is not a number is an outlier.
    const double weight = lengths[i] <= limits[camera] ? weights[i] : kOutlier;
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

absl::Status SolveExactly(LensProblem& problem, bool fixed_lenses, bool warp, double sigma,
                          const LensSettings& settings) {
  constexpr int kMostPasses = 8;
  std::vector<double> weights;
  for (const Eigen::Vector3d& corner : problem.corners) weights.push_back(corner.z());
  absl::Status solved = Solve(problem, {.regularisation = false});
  const FreeParts regularised{
      .core = !fixed_lenses, .distortion = !fixed_lenses, .regularisation = !fixed_lenses};
  if (solved.ok() && !fixed_lenses) solved = Solve(problem, regularised);
  const FreeParts last = LastStep(problem, fixed_lenses, warp);
  for (int pass = 0; solved.ok() && pass < kMostPasses; ++pass) {
    const bool changed = MarkOutliers(problem, weights, sigma, settings.outlier_sigmas);
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

}  // namespace silhouette
