// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <functional>

#include "calib/intrinsics/lens_stages.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Pixels: a solve's regularisation moves projections by less.
constexpr double kNegligible = 0.02;
// With fewer degrees of freedom, chance alone makes standard deviations differ.
constexpr int kLeastFreedom = 100;
// Chi squared per degree of freedom that chance does not reach.
constexpr double kNoChance = 4;

// One camera of a solve by itself; each board has the pose that the camera gives it.
struct Alone {
  LensProblem problem;
  std::vector<size_t> observations;  // of the solve, those of the camera
};

Alone AloneOf(const LensProblem& all, size_t camera) {
  Alone out;
  LensProblem& one = out.problem;
  one.lens_model = all.lens_model;
  one.image_sizes = {all.image_sizes[camera]};
  one.intrinsics = {all.intrinsics[camera]};
  one.camera_from_reference = {Eigen::Isometry3d::Identity()};
  one.lattice = all.lattice;
  const size_t corners = all.CornersPerBoard();
  for (size_t o = 0; o < all.observations.size(); ++o) {
    if (all.observations[o].camera != static_cast<int>(camera)) continue;
    const auto first = all.corners.begin() + static_cast<std::ptrdiff_t>(o * corners);
    one.corners.insert(one.corners.end(), first, first + static_cast<std::ptrdiff_t>(corners));
    one.observations.push_back({.camera = 0, .board = static_cast<int>(out.observations.size())});
    one.reference_from_board.push_back(
        all.camera_from_reference[camera] *
        all.reference_from_board[static_cast<size_t>(all.observations[o].board)]);
    out.observations.push_back(o);
  }
  return out;
}

// Of the residuals of one placing's corners.
struct Squares {
  int views = 0;
  int values = 0;
  double together = 0;
  double apart = 0;

  double Disagreement() const {
    return std::sqrt(std::max(0.0, together - apart) / std::max(1, values));
  }
};

}  // namespace

absl::StatusOr<JointFit> CompareJointFit(const LensProblem& start, const LensProblem& together,
                                         bool fixed_lenses, bool warp, const OutlierRule& rule) {
  std::vector<Squares> placings(start.reference_from_board.size());
  for (const auto& o : start.observations) ++placings[static_cast<size_t>(o.board)].views;
  const auto shared = [&](const Squares& placing) { return placing.views > 1; };
  if (std::ranges::none_of(placings, shared)) return JointFit{};

  const std::vector<Eigen::Vector2d> joint = Residuals(together);
  const size_t corners = start.CornersPerBoard();
  for (size_t camera = 0; camera < start.intrinsics.size(); ++camera) {
    Alone alone = AloneOf(start, camera);
    const std::vector<Eigen::Vector3d> weights = alone.problem.corners;
    // What cannot be solved by itself cannot be compared.
    if (!SolveExactly(alone.problem, fixed_lenses, warp, rule).ok()) return JointFit{};
    const std::vector<Eigen::Vector2d> single = Residuals(alone.problem);
    for (size_t i = 0; i < single.size(); ++i) {
      const size_t o = alone.observations[i / corners];
      Squares& placing = placings[static_cast<size_t>(start.observations[o].board)];
      if (!shared(placing) || !(alone.problem.corners[i].z() > 0)) continue;
      const double weight = std::pow(weights[i].z(), 2);
      placing.values += 2;
      placing.apart += weight * single[i].squaredNorm();
      placing.together += weight * joint[o * corners + i % corners].squaredNorm();
    }
  }

  Squares sum;
  int count = 0;
  for (const Squares& placing : placings) {
    if (!shared(placing)) continue;
    ++count;
    sum.views += placing.views;
    sum.values += placing.values;
    sum.together += placing.together;
    sum.apart += placing.apart;
  }
  const auto parameters =
      fixed_lenses ? 0 : static_cast<int>(start.intrinsics.size() * start.intrinsics[0].size());
  const int freedom_apart = sum.values - 6 * sum.views - parameters;
  JointFit fit;
  if (freedom_apart < kLeastFreedom) return fit;
  const int freedom_together = sum.values - 6 * count - parameters;
  fit.apart = std::sqrt(sum.apart / freedom_apart);
  fit.together = std::sqrt(sum.together / freedom_together);
  fit.placings = count;
  const double noise = std::pow(std::max(fit.apart, kNegligible), 2);
  fit.disagrees = !(std::pow(fit.together, 2) <= std::pow(kMostDisagreement, 2) * noise);
  // Single ones that disagree must do so by more than the noise.
  const double least = fit.disagrees ? std::pow(kMostDisagreement, 2) - 1 : 1;
  JointFit::Disagreeing worst;
  for (size_t i = 0; i < placings.size(); ++i) {
    const Squares& placing = placings[i];
    if (!shared(placing)) continue;
    const double more = (placing.together - placing.apart) / noise;
    const JointFit::Disagreeing here{.placing = i, .pixels = placing.Disagreement()};
    if (here.pixels >= worst.pixels) worst = here;
    if (more < kNoChance * 6 * (placing.views - 1)) continue;
    if (more < least * placing.values) continue;
    fit.disagreeing.push_back(here);
  }
  if (fit.disagrees && fit.disagreeing.empty()) fit.disagreeing.push_back(worst);
  std::ranges::sort(fit.disagreeing, std::greater<>(), &JointFit::Disagreeing::pixels);
  return fit;
}

}  // namespace silhouette
