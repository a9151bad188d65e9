// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_noise.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

// Pixels: what print, paper and lens often add. The solve begins with it.
constexpr double kFirstSigma = 0.1;
// Pixels: no corner of a real image is known better.
constexpr double kLeastSigma = 1e-3;
// With less, a part's noise is not known by itself; such parts are taken together.
constexpr double kLeastRedundancy = 16;
// The share by which a sigma must change for another solve.
constexpr double kSettled = 0.03;
// Noise of robot or survey that exceeds what was stated by this much is taken for what it is.
constexpr double kNoiseExcess = 1.3;
// The median lengths of two and of six normal values.
constexpr double kMedianOfTwo = 1.18;
constexpr double kMedianOfSix = 2.3;

double Square(double value) { return value * value; }

// A variance and how much is known of it.
struct Component {
  double squares = 0;  // pixels squared, with this expectation times the variance:
  double redundancy = 0;

  void Add(const Component& other) {
    squares += other.squares;
    redundancy += other.redundancy;
  }
  double Sigma() const { return std::max(kLeastSigma, std::sqrt(squares / redundancy)); }
};

Component ComponentBySquares(const BundlePart& part, double chi2, double redundancy) {
  return {chi2 * Square(part.sigma), redundancy};
}

// From the median length of the residuals, of which the unknowns take a share.
Component ComponentByMedian(const Bundle& bundle, size_t index, double redundancy) {
  std::vector<double> lengths;
  double used = 0;
  for (const BundleCorner& corner : bundle.corners) {
    if (corner.part != static_cast<int>(index) || !corner.residual.allFinite()) continue;
    lengths.push_back(corner.residual.norm() / corner.sigma);
    used += corner.used ? 2 : 0;
  }
  if (lengths.empty() || !(redundancy > 0)) return {};
  const double median = Median(std::move(lengths)) / kMedianOfTwo * bundle.parts[index].sigma;
  return {used * Square(median), redundancy};
}

// How many times the sigmas the priors' residuals are; 0: not known.
double FactorOfPriors(const std::vector<BundlePose>& poses, double chi2, double redundancy,
                      NoiseModel::By by) {
  if (!(redundancy > 1)) return 0;
  if (by == NoiseModel::By::kSquares) return std::sqrt(chi2 / redundancy);
  std::vector<double> lengths;
  double rows = 0;
  for (const BundlePose& pose : poses) {
    if (!pose.has_prior || pose.constant || pose.covariance.isZero(0)) continue;
    lengths.push_back(pose.PriorResidual().norm());
    rows += pose.left_out ? 0 : 6;
  }
  if (lengths.empty() || !(rows > 0)) return 0;
  return Median(std::move(lengths)) / kMedianOfSix / std::sqrt(redundancy / rows);
}

// Sets the poses' sigmas to `factor` times what they are, but not below what was stated.
bool Rescale(double factor, double& scale, std::vector<BundlePose>& poses) {
  double wanted = std::max(1.0, scale * factor);
  if (wanted < kNoiseExcess) wanted = 1;
  const double change = factor > 0 ? wanted / scale : 1;
  if (std::abs(change - 1) < kSettled) return false;
  scale *= change;
  for (BundlePose& pose : poses) {
    pose.position_sigma *= change;
    pose.rotation_sigma *= change;
  }
  return true;
}

}  // namespace

double CornerSigma(double stated, double part_stated, double part_sigma) {
  if (part_sigma <= part_stated) return stated * part_sigma / part_stated;
  return std::sqrt(Square(stated) + Square(part_sigma) - Square(part_stated));
}

void AddParts(Bundle& bundle) {
  std::map<std::pair<int, int>, int> places;
  std::vector<int> counts;
  for (BundleCorner& corner : bundle.corners) {
    const auto [place, added] = places.emplace(std::pair(corner.camera, corner.size),
                                               static_cast<int>(bundle.parts.size()));
    if (added) {
      bundle.parts.push_back({.camera = corner.camera, .size = corner.size, .sigma = kFirstSigma});
      counts.push_back(0);
    }
    corner.part = place->second;
    bundle.parts[corner.part].stated += Square(corner.stated);
    ++counts[corner.part];
  }
  for (size_t i = 0; i < bundle.parts.size(); ++i) {
    bundle.parts[i].stated = std::sqrt(bundle.parts[i].stated / counts[i]);
  }
  for (BundleCorner& corner : bundle.corners) {
    corner.sigma = CornerSigma(corner.stated, bundle.parts[corner.part].stated, kFirstSigma);
  }
}

bool NoiseModel::EstimateParts(const BundleStatistics& statistics, By by) {
  std::vector<Component> parts;
  Component weak;
  Component all;
  for (size_t i = 0; i < bundle_.parts.size(); ++i) {
    const double redundancy = statistics.part_redundancy[i];
    parts.push_back(by == By::kMedians ? ComponentByMedian(bundle_, i, redundancy)
                                       : ComponentBySquares(bundle_.parts[i],
                                                            statistics.part_chi2[i], redundancy));
    all.Add(parts.back());
    if (redundancy < kLeastRedundancy) weak.Add(parts.back());
  }
  if (weak.redundancy < kLeastRedundancy) weak = all;
  bool changed = false;
  for (size_t i = 0; i < parts.size(); ++i) {
    const Component& component = parts[i].redundancy < kLeastRedundancy ? weak : parts[i];
    if (!(component.redundancy > 1)) continue;
    BundlePart& part = bundle_.parts[i];
    const double sigma = component.Sigma();
    changed = changed || std::abs(sigma / part.sigma - 1) > kSettled;
    part.sigma = sigma;
  }
  for (BundleCorner& corner : bundle_.corners) {
    const BundlePart& part = bundle_.parts[corner.part];
    corner.sigma = CornerSigma(corner.stated, part.stated, part.sigma);
  }
  return changed;
}

bool NoiseModel::Estimate(const BundleStatistics& statistics, By by) {
  bool changed = EstimateParts(statistics, by);
  changed = Rescale(FactorOfPriors(bundle_.flanges, statistics.flange_chi2,
                                   statistics.flange_redundancy, by),
                    robot_scale_, bundle_.flanges) ||
            changed;
  return Rescale(FactorOfPriors(bundle_.board_poses, statistics.survey_chi2,
                                statistics.survey_redundancy, by),
                 survey_scale_, bundle_.board_poses) ||
         changed;
}

NoiseFactors NoiseModel::Factors(const BundleStatistics& statistics) const {
  NoiseFactors factors;
  double chi2 = 0;  // with the corners' noise as found
  double stated_chi2 = 0;
  double redundancy = 0;
  for (size_t i = 0; i < bundle_.parts.size(); ++i) {
    const BundlePart& part = bundle_.parts[i];
    chi2 += statistics.part_chi2[i];
    stated_chi2 += statistics.part_chi2[i] * Square(part.sigma / part.stated);
    redundancy += statistics.part_redundancy[i];
  }
  factors.image = redundancy > 1 ? std::sqrt(stated_chi2 / redundancy) : 1;
  factors.robot = robot_scale_ * FactorOfPriors(bundle_.flanges, statistics.flange_chi2,
                                                statistics.flange_redundancy, By::kSquares);
  factors.survey = survey_scale_ * FactorOfPriors(bundle_.board_poses, statistics.survey_chi2,
                                                  statistics.survey_redundancy, By::kSquares);
  chi2 += statistics.flange_chi2 * Square(robot_scale_) +
          statistics.survey_chi2 * Square(survey_scale_);
  if (statistics.dof > 0) factors.chi2_per_dof = chi2 / statistics.dof;
  return factors;
}

}  // namespace silhouette
