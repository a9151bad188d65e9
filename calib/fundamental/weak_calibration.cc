// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/weak_calibration.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>
#include <unsupported/Eigen/NonLinearOptimization>
#include <unsupported/Eigen/NumericalDiff>
#include <utility>

#include "absl/strings/str_format.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/matrix_fit.h"

namespace silhouette {
namespace {

constexpr int kFolds = 5;
constexpr int kPlacesForFrames = 10;  // least number of places at which frames are held out
constexpr double kDeviations = 4;
constexpr double kMostOutliers = 0.3;
constexpr int kWrongInRun = 8;  // tags by which the wrong ones of a run outnumber the right ones
constexpr double kFewCovered = 0.25;  // of an image
constexpr double kSpreadOdd = 2;
constexpr double kBowed = 30;  // gain of the lenses
// Mask pixels: wider bands say little of where a point is, smaller masks little of the robot.
constexpr double kWidestMargin = 1.5;
constexpr int kLeastMask = 16;
constexpr double kManyPlaces = 500;  // of a board

std::string Number(double value) { return absl::StrFormat("%.3g", value); }

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

// How bands can be made to hold without better images; empty if they would be of no use. A margin
// grows with the masks: an error in the camera images is more pixels of a finer mask.
std::string OrWiderBands(double margin, double most_margin, PixelSize mask_a, PixelSize mask_b) {
  if (margin > kWidestMargin) return "";
  const double wider = std::ceil(20 * margin) / 20;
  std::string text = absl::StrFormat(
      ". Or accept wider bands, which block more: set margin: %g under calibration in cell.yaml, "
      "and --max-margin %g here, --margin %g of silhouette-db calibration import",
      wider, wider, wider);
  const auto coarser = [&](PixelSize size) {
    const double scale = most_margin / margin;
    return PixelSize{static_cast<int>(scale * size.width), static_cast<int>(scale * size.height)};
  };
  const PixelSize a = coarser(mask_a);
  const PixelSize b = coarser(mask_b);
  if (std::min({a.width, a.height, b.width, b.height}) < kLeastMask) return text;
  return text + ". Or capture with coarser masks: mask_size at most " + SizeText(a) +
         (SizeText(a) == SizeText(b) ? "" : " and " + SizeText(b)) + " instead of " +
         SizeText(mask_a) +
         (SizeText(mask_a) == SizeText(mask_b) ? "" : " and " + SizeText(mask_b));
}

std::string WhyMargin(const ViewPair& pair, const WeakCalibration& found, double most_margin,
                      PixelSize mask_a, PixelSize mask_b) {
  if (found.bowed) {
    return "lenses bow the lines, and no matrix follows that. Calibrate lenses and poses, and use "
           "camera models";
  }
  const std::string or_wider = OrWiderBands(found.margin, most_margin, mask_a, mask_b);
  if (found.held_out.margin <= found.predicted_margin) {
    // The deviation falls with the root of the number of places.
    const int places = PlacesOf(pair);
    const double enough = places * std::pow(found.predicted_margin / most_margin, 2);
    const std::string how_many = enough < kManyPlaces
                                     ? absl::StrFormat("about %.0f", std::ceil(enough))
                                     : std::string("many more");
    return "the corners leave it too uncertain. Show boards in " + how_many +
           " places instead of " + std::to_string(places) + ", all over what both views see" +
           or_wider;
  }
  const std::string off =
      "corners that it was not fitted to are up to " + Number(found.held_out.worst) + " px off";
  if (std::max(found.spread, found.held_out.rms / found.held_out.noise) > kSpreadOdd) {
    return off +
           ". Did anything move while the images were taken? Take them again, with the board "
           "at rest";
  }
  return off + ", by their own noise. Take sharper images, or show larger tags" + or_wider;
}

struct FrameRun {
  int first = 0;
  int last = 0;
};

// The run of frames in which wrong tags outnumber right ones by most; nothing if by too few: tags
// that are wrong by themselves are scattered over the frames. A tag is wrong if most of its corners
// are.
std::optional<FrameRun> WrongFrames(const ViewPair& pair, const std::vector<bool>& fits) {
  std::map<std::pair<int, int>, int> tags;  // by frame: wrong corners less right ones
  for (size_t i = 0; i < fits.size(); ++i) {
    tags[{pair.corners[i].frame, pair.corners[i].tag}] += fits[i] ? -1 : 1;
  }
  std::vector<int> excess(pair.frames.size());
  for (const auto& [tag, wrong] : tags) {
    excess[static_cast<size_t>(tag.first)] += wrong > 0 ? 1 : -1;
  }
  FrameRun run;
  FrameRun worst;
  int sum = 0;
  int most = 0;
  for (size_t i = 0; i < excess.size(); ++i) {
    if (sum <= 0) {
      sum = 0;
      run.first = static_cast<int>(i);
    }
    sum += excess[i];
    run.last = static_cast<int>(i);
    if (sum <= most) continue;
    most = sum;
    worst = run;
  }
  return most < kWrongInRun ? std::nullopt : std::optional(worst);
}

// Whether frames show that something moved during the session. Boards in the corners of an image
// that lenses bow are off the lines, too; then the other frames show such lenses.
std::optional<std::string> WhyMoved(const ViewPair& pair, const RobustFit& fit, const ViewSizes& a,
                                    const ViewSizes& b) {
  const std::optional<FrameRun> run = WrongFrames(pair, fit.fits);
  if (!run) return std::nullopt;
  std::vector<bool> others = fit.roughly;
  for (size_t i = 0; i < others.size(); ++i) {
    const int frame = pair.corners[i].frame;
    if (run->first <= frame && frame <= run->last) others[i] = false;
  }
  if (EstimateLenses(fit.fit.f, Chosen(pair.corners, others), a, b).gain > kBowed) {
    return std::nullopt;
  }
  const int frames = run->last - run->first + 1;
  const std::string& first = pair.frames[static_cast<size_t>(run->first)];
  return absl::StrFormat(
      "most tags of %s fit no matrix of the other frames: a camera moved, or the board while its "
      "images were taken. Fasten the cameras and take the frames again; leave these frames out "
      "only if no camera moved",
      frames == 1 ? "the frame '" + first + "'"
                  : absl::StrFormat("%d frames from '%s' on", frames, first));
}

std::optional<std::string> WhyRefused(const ViewPair& pair, const WeakCalibration& found,
                                      const RobustFit& fit, double most_margin, const ViewSizes& a,
                                      const ViewSizes& b) {
  const double share =
      static_cast<double>(found.outliers) / static_cast<double>(pair.corners.size());
  if (share > kMostOutliers) {
    return std::to_string(std::lround(100 * share)) +
           " % of the corners fit no common matrix; are the frames of both views of the same "
           "instants, and did the cameras stand still? Lenses that bow lines strongly do this, "
           "too: "
           "these need camera models";
  }
  if (auto moved = WhyMoved(pair, fit, a, b)) return moved;
  if (found.margin > most_margin) {
    return "the matrix needs a margin of " + Number(found.margin) + " mask pixels, where " +
           Number(most_margin) +
           " is allowed (--max-margin): " + WhyMargin(pair, found, most_margin, a.mask, b.mask);
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
  result.refusal = WhyRefused(pair, result, *found, most_margin, a, b);
  return result;
}

namespace {

constexpr size_t kLeastCorners = 16;
constexpr double kSamePlace = 1;      // pixels
constexpr double kLeastShare = 0.04;  // of an image
// How well a plane may fit: standard deviations of the corners, or pixels, for lenses that bow it.
constexpr double kPlaneDeviations = 3;
constexpr double kPlanePixels = 2;

std::vector<cv::Point2d> PointsOf(std::span<const Correspondence> corners,
                                  Eigen::Vector2d Correspondence::*point) {
  std::vector<cv::Point2d> points;
  for (const Correspondence& corner : corners) {
    points.emplace_back((corner.*point).x(), (corner.*point).y());
  }
  return points;
}

std::string Percent(double share) {
  return std::to_string(static_cast<int>(std::lround(100 * share))) + " %";
}

// Whether all points lie at nearly one place in both images, frame by frame.
bool Stood(const std::vector<const Correspondence*>& one,
           const std::vector<const Correspondence*>& other) {
  if (one.size() != other.size()) return false;
  for (size_t i = 0; i < one.size(); ++i) {
    if ((one[i]->a - other[i]->a).norm() > kSamePlace) return false;
    if ((one[i]->b - other[i]->b).norm() > kSamePlace) return false;
  }
  return true;
}

std::string OutOfPlane(const ViewPair& pair) {
  const std::vector<int> first = FirstAtSamePlace(pair);
  int places = 0;
  for (size_t i = 0; i < first.size(); ++i) places += first[i] == static_cast<int>(i) ? 1 : 0;
  const std::string mend =
      "; a plane looks the same for many pairs of cameras. Move and tilt the board between frames, "
      "so that the tags fill the space that both views see";
  if (pair.frames.size() == 1)
    return "there is one frame, and all its tags lie on one plane" + mend;
  if (places == 1) {
    return "the tags stand at the same place in all " + std::to_string(pair.frames.size()) +
           " frames, all on one plane" + mend;
  }
  return "all tags of all frames lie on one plane" + mend;
}

}  // namespace

std::vector<int> FirstAtSamePlace(const ViewPair& pair) {
  std::vector<std::vector<const Correspondence*>> by_frame(pair.frames.size());
  for (const Correspondence& corner : pair.corners) {
    by_frame[static_cast<size_t>(corner.frame)].push_back(&corner);
  }
  std::vector<int> first;
  for (size_t i = 0; i < by_frame.size(); ++i) {
    size_t same = 0;
    while (same < i && !Stood(by_frame[same], by_frame[i])) ++same;
    first.push_back(static_cast<int>(same));
  }
  return first;
}

bool OnOnePlane(std::span<const Correspondence> corners) {
  if (corners.size() < 5) return true;
  const std::vector<cv::Point2d> a = PointsOf(corners, &Correspondence::a);
  const std::vector<cv::Point2d> b = PointsOf(corners, &Correspondence::b);
  const cv::Mat homography = cv::findHomography(a, b);
  if (homography.empty()) return true;
  std::vector<cv::Point2d> there;
  cv::perspectiveTransform(a, there, homography);
  double squares = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const double sigma = std::hypot(corners[i].sigma_a, corners[i].sigma_b);
    const double limit = std::max(kPlanePixels, kPlaneDeviations * sigma);
    squares += std::pow(cv::norm(there[i] - b[i]) / limit, 2) / 2;
  }
  return squares < static_cast<double>(corners.size());
}

double ShareOfImage(std::span<const Correspondence> corners, Eigen::Vector2d Correspondence::*point,
                    PixelSize image) {
  std::vector<cv::Point2f> points;
  for (const cv::Point2d& p : PointsOf(corners, point)) points.emplace_back(p);
  std::vector<cv::Point2f> hull;
  cv::convexHull(points, hull);
  return hull.size() < 3 ? 0 : cv::contourArea(hull) / image.width / image.height;
}

std::optional<std::string> WhyDegenerate(const ViewPair& pair, PixelSize image_a,
                                         PixelSize image_b) {
  if (pair.corners.size() < kLeastCorners) {
    return "both views saw only " + std::to_string(pair.corners.size()) +
           " corners of tags at once, where at least " + std::to_string(kLeastCorners) +
           " are needed; take more frames in which both see a board";
  }
  if (OnOnePlane(pair.corners)) return OutOfPlane(pair);
  const double share_a = ShareOfImage(pair.corners, &Correspondence::a, image_a);
  const double share_b = ShareOfImage(pair.corners, &Correspondence::b, image_b);
  if (std::min(share_a, share_b) < kLeastShare) {
    return "all corners lie in one place of the image of '" +
           (share_a < share_b ? pair.view_a : pair.view_b) + "', within " +
           Percent(std::min(share_a, share_b)) +
           " of it; a matrix holds only where tags were: show boards all over what both views see";
  }
  return std::nullopt;
}

namespace {

using Eigen::Vector2d;

// Straightens what a lens bows, and bows it again.
class Lens {
 public:
  Lens(PixelSize image, double bend)
      : middle_(0.5 * (image.width - 1), 0.5 * (image.height - 1)),
        corner_(0.5 * std::hypot(image.width, image.height)),
        bend_(bend) {}

  Vector2d Straightened(const Vector2d& pixel) const {
    const Vector2d from = (pixel - middle_) / corner_;
    return middle_ + (pixel - middle_) / (1 + bend_ * from.squaredNorm());
  }

  std::optional<Vector2d> Bowed(const Vector2d& straight) const {
    const double radius = (straight - middle_).norm() / corner_;
    const double root = 1 - 4 * bend_ * radius * radius;
    if (root < 0) return std::nullopt;
    return middle_ + (straight - middle_) * 2 / (1 + std::sqrt(root));
  }

 private:
  Vector2d middle_;
  double corner_;
  double bend_;
};

struct LensEstimateDistances : CornerFunction {
  PixelSize image_a;
  PixelSize image_b;

  int inputs() const { return kMatrixFreedoms + 2; }

  int operator()(const Eigen::VectorXd& p, Eigen::VectorXd& distances) const {
    const Eigen::Matrix3d f = chart.At(p);
    const Lens a(image_a, p[kMatrixFreedoms]);
    const Lens b(image_b, p[kMatrixFreedoms + 1]);
    for (size_t i = 0; i < corners.size(); ++i) {
      const Correspondence& c = corners[i];
      distances[static_cast<Eigen::Index>(i)] =
          SampsonDistance(f, a.Straightened(c.a), c.sigma_a, b.Straightened(c.b), c.sigma_b);
    }
    return 0;
  }
};

// Adds what `f` is wrong by if the truth is `true_f` behind the lenses.
void AddMargin(const Eigen::Matrix3d& f, const Eigen::Matrix3d& true_f, const Lens& lens_a,
               const Lens& lens_b, const ViewSizes& a, const ViewSizes& b, LensEstimate& estimate) {
  constexpr int kSteps = 10;
  const Eigen::Matrix3d of_masks = ScaledTo(f, a.image, a.mask, b.image, b.mask);
  for (const Vector2d& pixel : PointsAllOver(a.image, kSteps)) {
    const Eigen::Vector3d line = true_f * lens_a.Straightened(pixel).homogeneous();
    for (const Vector2d& straight : PointsOnLine(line, b.image, kSteps)) {
      const std::optional<Vector2d> there = lens_b.Bowed(straight);
      if (!there || !Contains(b.image, *there)) continue;
      estimate.off_lines = std::max(estimate.off_lines, DistanceBetween(f, pixel, *there).in_b);
      estimate.margin =
          std::max(estimate.margin, NeededMargin(of_masks, ScaledTo(pixel, a.image, a.mask),
                                                 ScaledTo(*there, b.image, b.mask)));
    }
  }
}

}  // namespace

LensEstimate EstimateLenses(const Eigen::Matrix3d& f, std::span<const Correspondence> corners,
                            const ViewSizes& a, const ViewSizes& b) {
  const MatrixChart chart(f, NormalisingOf(corners, &Correspondence::a),
                          NormalisingOf(corners, &Correspondence::b));
  Eigen::NumericalDiff<LensEstimateDistances> distances(
      LensEstimateDistances{{chart, corners}, a.image, b.image});
  Eigen::VectorXd p = Eigen::VectorXd::Zero(kMatrixFreedoms + 2);
  Eigen::VectorXd left(distances.values());
  distances(p, left);
  const double without = left.squaredNorm();
  Eigen::LevenbergMarquardt<Eigen::NumericalDiff<LensEstimateDistances>> minimiser(distances);
  minimiser.parameters.maxfev = 600;
  minimiser.minimize(p);
  distances(p, left);

  LensEstimate estimate{.bend_a = p[kMatrixFreedoms], .bend_b = p[kMatrixFreedoms + 1]};
  const double per_corner = left.squaredNorm() / static_cast<double>(corners.size());
  estimate.gain = (without - left.squaredNorm()) / std::max(1.0, per_corner);
  AddMargin(f, chart.At(p), Lens(a.image, estimate.bend_a), Lens(b.image, estimate.bend_b), a, b,
            estimate);
  return estimate;
}

}  // namespace silhouette
