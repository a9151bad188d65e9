// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/weak_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <set>

#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/matrix_fit.h"

namespace silhouette {
namespace {

constexpr int kFolds = 5;
constexpr int kPlacesForFrames = 10;  // least number of places at which frames are held out
constexpr double kDeviations = 4;
constexpr double kMostOutliers = 0.3;
constexpr double kFewCovered = 0.25;  // of an image
constexpr double kSpreadOdd = 2;
constexpr double kBowed = 30;  // gain of the lenses

std::string Number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g", value);
  return text.data();
}

// Which fold a corner is left out in.
std::vector<int> FoldsOf(const ViewPair& pair, const std::vector<Correspondence>& corners,
                         bool by_frame) {
  const std::vector<int> first = FirstAtSamePlace(pair);
  std::vector<int> place(first.size());
  int places = 0;
  for (size_t i = 0; i < first.size(); ++i) {
    const bool is_new = first[i] == static_cast<int>(i);
    place[i] = is_new ? places++ : place[static_cast<size_t>(first[i])];
  }
  std::vector<int> folds;
  for (const Correspondence& corner : corners) {
    folds.push_back((by_frame ? place[static_cast<size_t>(corner.frame)] : corner.tag) % kFolds);
  }
  return folds;
}

int PlacesOf(const ViewPair& pair) {
  const std::vector<int> first = FirstAtSamePlace(pair);
  return static_cast<int>(std::set<int>(first.begin(), first.end()).size());
}

// Nothing if what is left of the corners does not fix a matrix.
std::optional<LineDistances> HeldOut(const ViewPair& pair,
                                     const std::vector<Correspondence>& corners, bool by_frame,
                                     const ViewSizes& a, const ViewSizes& b) {
  const std::vector<int> folds = FoldsOf(pair, corners, by_frame);
  LineDistanceSum sum(a, b);
  for (int fold = 0; fold < kFolds; ++fold) {
    std::vector<Correspondence> kept;
    std::vector<Correspondence> left_out;
    for (size_t i = 0; i < corners.size(); ++i) {
      (folds[i] == fold ? left_out : kept).push_back(corners[i]);
    }
    if (left_out.empty()) continue;
    if (kept.size() < 8 || OnOnePlane(kept)) return std::nullopt;
    const Eigen::Matrix3d f = Refined(EightPoints(kept), kept).f;
    for (const Correspondence& corner : left_out) sum.Add(f, corner);
  }
  return sum.Result();
}

// The fit, for pixels of the masks.
MatrixFit OfMasks(MatrixFit fit, const ViewSizes& a, const ViewSizes& b) {
  fit.f = ScaledTo(fit.f, a.image, a.mask, b.image, b.mask);
  for (Eigen::Matrix3d& slope : fit.slopes) {
    slope = ScaledTo(slope, a.image, a.mask, b.image, b.mask);
  }
  return fit;
}

// The greatest deviation of the margin over points of a and points on their lines in b; `fit` is
// for pixels of the masks.
double GreatestDeviation(const MatrixFit& fit, PixelSize a, PixelSize b) {
  constexpr int kSteps = 8;
  double greatest = 0;
  for (const Eigen::Vector2d& point : PointsAllOver(a, kSteps)) {
    for (const Eigen::Vector2d& there : PointsOnLine(fit.f * point.homogeneous(), b, kSteps)) {
      if (Contains(b, there)) greatest = std::max(greatest, fit.MarginDeviation(point, there));
    }
  }
  return greatest;
}

// What is odd about a matrix that is not refused.
std::vector<std::string> Warnings(const ViewPair& pair, const WeakCalibration& found,
                                  const ViewSizes& a, const ViewSizes& b) {
  std::vector<std::string> warnings;
  if (found.bowed) {
    warnings.push_back("lenses bow the lines, by about " + Number(found.lenses.off_lines) +
                       " px at most; no matrix follows that, camera models do");
  } else if (found.spread > kSpreadOdd) {
    warnings.push_back("the corners differ from the matrix by " + Number(found.spread) +
                       " times what they are said to be wrong by; did the board move while the "
                       "images were taken?");
  }
  const int places = PlacesOf(pair);
  if (places < static_cast<int>(pair.frames.size())) {
    warnings.push_back("in " + std::to_string(static_cast<int>(pair.frames.size()) - places) +
                       " of " + std::to_string(pair.frames.size()) +
                       " frames nothing was moved since an earlier one; they say nothing new");
  }
  for (const bool of_a : {true, false}) {
    const double share = ShareOfImage(pair.corners, of_a ? &Correspondence::a : &Correspondence::b,
                                      of_a ? a.image : b.image);
    if (share >= kFewCovered) continue;
    warnings.push_back("tags were seen in " + std::to_string(std::lround(100 * share)) +
                       " % of the image of '" + (of_a ? pair.view_a : pair.view_b) +
                       "' only; the matrix is uncertain elsewhere");
  }
  return warnings;
}

std::optional<std::string> WhyRefused(const ViewPair& pair, const WeakCalibration& found,
                                      double most_margin) {
  const double share =
      static_cast<double>(found.outliers) / static_cast<double>(pair.corners.size());
  if (share > kMostOutliers) {
    return std::to_string(std::lround(100 * share)) +
           " % of the corners fit no common matrix; are the frames of both views of the same "
           "instants, and did the cameras stand still? Lenses that bow lines strongly do this, "
           "too: "
           "these need camera models";
  }
  if (found.margin > most_margin) {
    std::string why =
        "the corners leave it too uncertain. Show boards in more places, all over what both views "
        "see";
    if (found.bowed) {
      why =
          "lenses bow the lines, and no matrix follows that. Calibrate lenses and poses, and use "
          "camera models";
    } else if (found.held_out.margin > found.predicted_margin) {
      why = "corners that it was not fitted to are up to " + Number(found.held_out.worst) +
            " px off. Did anything move while the images were taken?";
    }
    return "the matrix needs a margin of " + Number(found.margin) + " mask pixels, where " +
           Number(most_margin) + " is allowed (--max-margin): " + why;
  }
  return std::nullopt;
}

}  // namespace

WeakCalibration CalibrateWeakly(const ViewPair& pair, const ViewSizes& a, const ViewSizes& b,
                                double most_margin, uint32_t seed) {
  WeakCalibration result;
  result.refusal = WhyDegenerate(pair, a.image, b.image);
  if (result.refusal) return result;
  const std::optional<RobustFit> found = FitMatrix(pair.corners, seed);
  if (!found) {
    result.refusal =
        "no matrix fits even half of the corners; are the frames of both views of the same "
        "instants, and the boards' tags there only once?";
    return result;
  }
  result.outliers = static_cast<int>(pair.corners.size()) - found->believed;
  result.spread = found->spread;
  const std::vector<Correspondence> believed = Chosen(pair.corners, found->fits);
  result.frames_held_out = PlacesOf(pair) >= kPlacesForFrames;
  const auto held_out = HeldOut(pair, believed, result.frames_held_out, a, b);
  if (OnOnePlane(believed) || !held_out) {
    result.refusal =
        "the corners that fit a matrix lie on one plane, or nearly; move and tilt the board "
        "between "
        "more frames";
    return result;
  }
  result.held_out = *held_out;
  const MatrixFit of_masks = OfMasks(found->fit, a, b);
  result.f = found->fit.f;
  result.f_of_masks = of_masks.f / of_masks.f.norm();
  result.predicted_margin =
      kDeviations * std::max(1.0, found->spread) * GreatestDeviation(of_masks, a.mask, b.mask);
  result.lenses = EstimateLenses(result.f, Chosen(pair.corners, found->roughly), a, b);
  result.bowed = result.lenses.gain > kBowed;
  result.margin = std::max(result.predicted_margin, result.held_out.margin) +
                  (result.bowed ? result.lenses.margin : 0);
  result.warnings = Warnings(pair, result, a, b);
  result.refusal = WhyRefused(pair, result, most_margin);
  return result;
}

}  // namespace silhouette
