#include "calib/fundamental/robust_fit.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "calib/fundamental/epipolar_geometry.h"

namespace silhouette {
namespace {

constexpr int kSample = 8;
constexpr int kMostSamples = 2000;
constexpr double kSure = 1e-4;  // probability that no sample was free of wrong corners
// A corner is wrong at first if it is further off than this: the greater of pixels (lenses bow
// lines, eight points are few) and standard deviations.
constexpr double kRoughPixels = 2;
constexpr double kRough = 10;
constexpr double kBelieved = 4;  // standard deviations

double Distance(const Eigen::Matrix3d& f, const Correspondence& c) {
  return std::abs(SampsonDistance(f, c.a, c.sigma_a, c.b, c.sigma_b));
}

double RoughLimit(const Correspondence& c) {
  return std::max(kRough, kRoughPixels / std::max(c.sigma_a, c.sigma_b));
}

std::vector<Correspondence> RobustFitChosen(std::span<const Correspondence> corners,
                                            const std::vector<bool>& which) {
  std::vector<Correspondence> chosen;
  for (size_t i = 0; i < corners.size(); ++i) {
    if (which[i]) chosen.push_back(corners[i]);
  }
  return chosen;
}

template <typename Limit>
std::vector<bool> Within(std::span<const Correspondence> corners, const Eigen::Matrix3d& f,
                         const Limit& limit) {
  std::vector<bool> within(corners.size());
  for (size_t i = 0; i < corners.size(); ++i) {
    within[i] = Distance(f, corners[i]) < limit(corners[i]);
  }
  return within;
}

int CountOf(const std::vector<bool>& which) {
  return static_cast<int>(std::count(which.begin(), which.end(), true));
}

// Eight corners, of as many tags as there are.
std::vector<Correspondence> Sample(std::span<const Correspondence> corners, std::mt19937& random) {
  std::vector<Correspondence> sample;
  std::uniform_int_distribution<size_t> any(0, corners.size() - 1);
  for (int attempt = 0; sample.size() < kSample; ++attempt) {
    const Correspondence& corner = corners[any(random)];
    const bool taken = std::any_of(sample.begin(), sample.end(), [&](const Correspondence& other) {
      return attempt < 4 * kSample ? other.tag == corner.tag : other.a == corner.a;
    });
    if (!taken) sample.push_back(corner);
  }
  return sample;
}

// How badly a matrix fits: a wrong corner counts as one at its limit.
double Cost(std::span<const Correspondence> corners, const Eigen::Matrix3d& f) {
  double cost = 0;
  for (const Correspondence& corner : corners) {
    const double share = Distance(f, corner) / RoughLimit(corner);
    cost += share < 1 ? share * share : 1;  // not a number: wrong
  }
  return cost;
}

// The corners that agree with the best of many samples.
std::vector<bool> Agreeing(std::span<const Correspondence> corners, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<bool> best(corners.size());
  double least = static_cast<double>(corners.size());
  double needed = kMostSamples;
  for (int i = 0; i < kMostSamples && i < needed; ++i) {
    Eigen::Matrix3d f = EightPoints(Sample(corners, random));
    if (!f.allFinite() || !(Cost(corners, f) < least)) continue;
    // A matrix of all that agree is better than that of eight of them.
    const std::vector<Correspondence> agreeing =
        RobustFitChosen(corners, Within(corners, f, RoughLimit));
    if (agreeing.size() < kSample) continue;
    const Eigen::Matrix3d of_all = EightPoints(agreeing);
    if (Cost(corners, of_all) < Cost(corners, f)) f = of_all;
    least = Cost(corners, f);
    best = Within(corners, f, RoughLimit);
    const double share = static_cast<double>(CountOf(best)) / static_cast<double>(corners.size());
    const double clean = std::min(std::pow(share, kSample), 1 - 1e-12);
    needed = 20 + std::log(kSure) / std::log(1 - clean);
  }
  return best;
}

// Root mean square of the distances of those that were believed, and of the middle of all as if
// they were normal: few that are wrong do not widen it.
double MedianSpread(std::span<const Correspondence> corners, const Eigen::Matrix3d& f) {
  std::vector<double> distances;
  for (const Correspondence& corner : corners) distances.push_back(Distance(f, corner));
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return 1.4826 * *middle;
}

}  // namespace

std::optional<RobustFit> FitMatrix(std::span<const Correspondence> corners, uint32_t seed) {
  constexpr int kRounds = 10;
  if (corners.size() < kSample) return std::nullopt;
  RobustFit result;
  result.fits = Agreeing(corners, seed);
  if (2 * CountOf(result.fits) < static_cast<int>(corners.size())) return std::nullopt;
  result.roughly = result.fits;
  Eigen::Matrix3d start = EightPoints(RobustFitChosen(corners, result.fits));
  for (int round = 0; round < kRounds; ++round) {
    result.fit = Refined(start, RobustFitChosen(corners, result.fits));
    start = result.fit.f;
    if (!start.allFinite()) return std::nullopt;
    const double limit = kBelieved * std::max(1.0, MedianSpread(corners, start));
    std::vector<bool> within = Within(corners, start, [&](const Correspondence&) { return limit; });
    if (CountOf(within) < kSample) return std::nullopt;
    if (within == result.fits) break;
    result.fits = std::move(within);
  }
  double squares = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    if (!result.fits[i]) continue;
    ++result.believed;
    const double distance = Distance(result.fit.f, corners[i]);
    squares += distance * distance;
  }
  result.spread = std::sqrt(squares / std::max(1, result.believed - kMatrixFreedoms));
  return result;
}

}  // namespace silhouette
