// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/circle_grid.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <optional>
#include <utility>

#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Of the way to the nearest neighbour: so far a circle and the paper about it are looked at, and
// from here on there is only paper.
constexpr double kWindow = 0.5;
constexpr double kPaper = 0.42;
// Circles near one that say how the board's plane is seen there.
constexpr size_t kNear = 12;
// No order of the circles is the board's if they are so far from where a homography puts them, as a
// share of the way to a neighbour; lenses bend less.
constexpr double kMostOutOfOrder = 0.4;
// Circles are looked at so often, the second time where the first one puts them. Of the way to a
// neighbour: so far the centroid may be from there. And how often a radius may be the median.
constexpr int kLooks = 2;
constexpr double kMostOffCentre = 0.12;
constexpr double kMostOfRadius = 1.25;
// What the centroid of the sharpest image is not truer than, pixels.
constexpr double kTruestCentroid = 0.01;
constexpr double kFaintestCircle = 0.1;  // by how much it is darker than paper, as a share

std::vector<cv::Point2f> FindCircles(const Board& board, const cv::Mat& image) {
  const BoardDescription& d = board.description();
  // OpenCV's own settings miss large and faint circles, these ones among clutter.
  cv::SimpleBlobDetector::Params all_sizes;
  all_sizes.minThreshold = 10;
  all_sizes.maxThreshold = 245;
  all_sizes.minArea = 12;
  all_sizes.maxArea = static_cast<float>(image.total()) / 10;
  all_sizes.minDistBetweenBlobs = 3;
  all_sizes.minConvexity = 0.8F;
  const int kind = d.asymmetric ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID;
  std::vector<cv::Point2f> found;
  for (const auto& blobs : {all_sizes, cv::SimpleBlobDetector::Params()}) {
    const cv::Ptr<cv::FeatureDetector> detector = cv::SimpleBlobDetector::create(blobs);
    for (const int way : {0, static_cast<int>(cv::CALIB_CB_CLUSTERING)}) {
      if (cv::findCirclesGrid(image, {d.columns, d.rows}, found, kind | way, detector) &&
          found.size() == static_cast<size_t>(board.tags())) {
        return found;
      }
    }
  }
  return {};
}

// From the board's plane, metres, to pixels.
class Homography {
 public:
  // Nothing if there is none. As many places as pixels, at least four.
  static std::optional<Homography> Fit(const std::vector<Vector2d>& on_board,
                                       const std::vector<Vector2d>& seen) {
    std::vector<cv::Point2d> from;
    std::vector<cv::Point2d> to;
    for (const Vector2d& at : on_board) from.emplace_back(at.x(), at.y());
    for (const Vector2d& at : seen) to.emplace_back(at.x(), at.y());
    const cv::Mat found = cv::findHomography(from, to, 0);
    if (found.empty()) return std::nullopt;
    Homography homography;
    for (int i = 0; i < 9; ++i) homography.matrix_(i / 3, i % 3) = found.at<double>(i / 3, i % 3);
    return homography;
  }

  Vector2d operator()(const Vector2d& at) const {
    return (matrix_ * at.homogeneous()).hnormalized();
  }
  // Pixels a metre along the board's x and y.
  Matrix2d Slopes(const Vector2d& at) const {
    const Vector3d mapped = matrix_ * at.homogeneous();
    return (matrix_.topLeftCorner<2, 2>() -
            mapped.hnormalized() * matrix_.bottomLeftCorner<1, 2>()) /
           mapped.z();
  }

 private:
  Matrix3d matrix_;
};

// The circles by their places in the board.
struct CirclesSeen {
  std::vector<Vector2d> on_board;  // metres
  std::vector<Vector2d> seen;      // pixels
  std::vector<bool> counts;        // whether they say how the board's plane is seen near them
  double apart = 0;                // nearest neighbours, metres
};

// How the board's plane is seen about a circle: a polynomial of the second degree, in which are
// both perspective and the lens.
struct Nearby {
  Vector2d at;                      // of the circle's middle
  Matrix2d slopes;                  // pixels a metre along the board's x and y
  std::array<Vector2d, 3> bends{};  // derivatives by xx, xy and yy, pixels a square metre

  // From the centroid of the circle's image to the image of its middle, as far as the second degree
  // goes: a part of the disc counts by how large it is seen.
  Vector2d FromCentroid(double radius) const {
    const auto cross = [](const Vector2d& a, const Vector2d& b) {
      return a.x() * b.y() - a.y() * b.x();
    };
    const Vector2d x = slopes.col(0);
    const Vector2d y = slopes.col(1);
    const double along_x = cross(bends[0], y) + cross(x, bends[1]);
    const double along_y = cross(bends[1], y) + cross(x, bends[2]);
    return -radius * radius / 4 *
           ((bends[0] + bends[2]) / 2 + (along_x * x + along_y * y) / cross(x, y));
  }
};

// By those near circle `i`, and itself, of the ones that count; nothing: they are too few.
std::optional<Nearby> NearbyOf(const CirclesSeen& circles, size_t i) {
  std::vector<size_t> order;
  for (size_t k = 0; k < circles.seen.size(); ++k) {
    if (circles.counts[k]) order.push_back(k);
  }
  const size_t near = std::min(kNear, order.size());
  if (near < 3) return std::nullopt;
  std::ranges::partial_sort(
      order, order.begin() + static_cast<std::ptrdiff_t>(near), {},
      [&](size_t k) { return (circles.on_board[k] - circles.on_board[i]).norm(); });
  Eigen::MatrixXd terms(near, 6);
  Eigen::MatrixXd seen(near, 2);
  for (size_t k = 0; k < near; ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    const Vector2d to = (circles.on_board[order[k]] - circles.on_board[i]) / circles.apart;
    terms.row(row) << 1, to.x(), to.y(), to.x() * to.x() / 2, to.x() * to.y(), to.y() * to.y() / 2;
    seen.row(row) = circles.seen[order[k]].transpose();
  }
  const Eigen::MatrixXd found = terms.completeOrthogonalDecomposition().solve(seen);
  Nearby nearby{.at = found.row(0), .slopes = found.middleRows<2>(1).transpose() / circles.apart};
  for (int k = 0; k < 3; ++k) {
    nearby.bends[static_cast<size_t>(k)] =
        found.row(3 + k).transpose() / (circles.apart * circles.apart);
  }
  return nearby;
}

// In the board's order, not mirrored: of those that fit as well, such as those of a board that
// looks the same turned by half, with the first circle nearest to the image's top left. Empty: it
// is another board's.
std::vector<Vector2d> Ordered(const Board& board, const CirclesSeen& circles,
                              const std::vector<cv::Point2f>& found) {
  const auto columns = static_cast<size_t>(board.description().columns);
  std::vector<Vector2d> best;
  double least = kMostOutOfOrder;
  for (const bool turned : {false, true}) {
    for (const bool mirrored : {false, true}) {
      std::vector<Vector2d> seen;
      for (size_t i = 0; i < found.size(); ++i) {
        size_t from = turned ? found.size() - 1 - i : i;
        if (mirrored) from += columns - 1 - 2 * (from % columns);
        seen.emplace_back(found[from].x, found[from].y);
      }
      const auto homography = Homography::Fit(circles.on_board, seen);
      if (!homography) continue;
      double misfit = 0;
      bool upright = true;
      for (size_t i = 0; i < seen.size(); ++i) {
        const double stretch = homography->Slopes(circles.on_board[i]).determinant();
        upright = upright && stretch > 0;
        const double apart = circles.apart * std::sqrt(std::abs(stretch));
        misfit = std::max(misfit, ((*homography)(circles.on_board[i]) - seen[i]).norm() / apart);
      }
      constexpr double kAlike = 1e-6;
      const bool nearer =
          !best.empty() && misfit < least + kAlike && seen.front().sum() < best.front().sum();
      if (!upright || (misfit >= least - kAlike && !nearer)) continue;
      least = misfit;
      best = std::move(seen);
    }
  }
  return best;
}

// One circle in the image.
struct Spot {
  Vector2d centroid;
  double area = 0;   // pixels
  double sigma = 0;  // of the centroid per axis, pixels
};

// Calls visit(pixel, its place about the middle as a share of the way to a neighbour).
template <typename Visit>
void ForWindow(const cv::Mat& image, const Vector2d& middle, const Matrix2d& share_of_pixels,
               const Visit& visit) {
  const Matrix2d pixels = share_of_pixels.inverse();
  const Vector2d reach = kWindow * pixels.rowwise().norm();
  const auto low = [](double at) { return static_cast<int>(std::floor(at)); };
  for (int y = std::max(0, low(middle.y() - reach.y()));
       y <= std::min(image.rows - 1, low(middle.y() + reach.y()) + 1); ++y) {
    for (int x = std::max(0, low(middle.x() - reach.x()));
         x <= std::min(image.cols - 1, low(middle.x() + reach.x()) + 1); ++x) {
      const double share = (share_of_pixels * (Vector2d(x, y) - middle)).norm();
      if (share <= kWindow) visit(Vector2d(x, y), share);
    }
  }
}

// Nothing if it is too faint. `share_of_pixels`: the way to a neighbour is 1 long.
std::optional<Spot> SpotAt(const cv::Mat& image, const Vector2d& middle,
                           const Matrix2d& share_of_pixels) {
  const auto grey = [&](const Vector2d& at) {
    return static_cast<double>(
        image.at<uint8_t>(static_cast<int>(at.y()), static_cast<int>(at.x())));
  };
  // Paper: a plane of grey values, since light falls off.
  Matrix3d normal = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  double squares = 0;
  int count = 0;
  ForWindow(image, middle, share_of_pixels, [&](const Vector2d& at, double share) {
    if (share < kPaper) return;
    const Vector3d row = (at - middle).homogeneous();
    normal += row * row.transpose();
    right += grey(at) * row;
    squares += grey(at) * grey(at);
    ++count;
  });
  if (count < 6) return std::nullopt;
  const Vector3d paper = normal.ldlt().solve(right);
  const double noise = std::sqrt(std::max(0.0, squares - paper.dot(right)) / (count - 3));
  double weight = 0;
  double darkest = 0;
  double spread = 0;
  Vector2d moment = Vector2d::Zero();
  ForWindow(image, middle, share_of_pixels, [&](const Vector2d& at, double share) {
    if (share >= kPaper) return;
    // As a share: where there is less light, paper and circle are darker.
    const double dark = 1 - grey(at) / std::max(1.0, paper.dot((at - middle).homogeneous()));
    weight += dark;
    moment += dark * (at - middle);
    darkest = std::max(darkest, dark);
    spread += (at - middle).squaredNorm() / 2;
  });
  if (darkest < kFaintestCircle || weight <= 0) return std::nullopt;
  return Spot{.centroid = middle + moment / weight,
              .area = weight / darkest,
              .sigma = std::hypot(kTruestCentroid,
                                  noise / std::max(1.0, paper.z()) * std::sqrt(spread) / weight)};
}

// A circle as it is seen where `seen` says.
struct Look {
  Nearby nearby;
  double scale = 0;          // pixels a metre
  double apart = 0;          // nearest neighbours, pixels
  std::optional<Spot> spot;  // nothing: there is none

  double radius() const { return std::sqrt(spot->area / std::numbers::pi) / scale; }  // metres
};

// Nothing: nothing says how the board's plane is seen there.
std::optional<Look> LookAt(const cv::Mat& image, const CirclesSeen& circles, size_t i) {
  const auto nearby = NearbyOf(circles, i);
  if (!nearby) return std::nullopt;
  const Vector2d at = circles.counts[i] ? circles.seen[i] : nearby->at;
  const double scale = std::sqrt(std::abs(nearby->slopes.determinant()));
  if (!(circles.apart * scale >= 1)) return std::nullopt;  // the ones that count are in a line
  return Look{.nearby = *nearby,
              .scale = scale,
              .apart = circles.apart * scale,
              .spot = SpotAt(image, at, (circles.apart * nearby->slopes).inverse())};
}

double MedianRadius(const std::vector<Look>& looks) {
  std::vector<double> radii;
  for (const Look& look : looks) {
    if (look.spot) radii.push_back(look.radius());
  }
  return radii.empty() ? 0 : Median(std::move(radii));
}

// Where the circles are now. What is far from where it was looked for, or of another size, counts
// no longer: OpenCV makes up a circle or two, and others are partly covered.
void MoveToCentroids(const std::vector<Look>& looks, CirclesSeen& circles) {
  const double radius = MedianRadius(looks);
  for (size_t i = 0; i < looks.size(); ++i) {
    const Look& look = looks[i];
    const Vector2d at = circles.counts[i] ? circles.seen[i] : look.nearby.at;
    circles.counts[i] = look.spot &&
                        (look.spot->centroid - at).norm() < kMostOffCentre * look.apart &&
                        std::abs(std::log(look.radius() / radius)) < std::log(kMostOfRadius);
    if (circles.counts[i]) circles.seen[i] = look.spot->centroid;
  }
}

}  // namespace

std::vector<DetectedTag> DetectCircles(const Board& board, const cv::Mat& image) {
  const std::vector<cv::Point2f> found = FindCircles(board, image);
  if (found.empty()) return {};
  const BoardDescription& d = board.description();
  CirclesSeen circles;
  circles.apart = NeighbourDistance(d);
  for (int id = board.first_mark(); board.HasTag(id); ++id) {
    circles.on_board.emplace_back(board.CornersOf(id).front().head<2>());
  }
  circles.seen = Ordered(board, circles, found);
  if (circles.seen.empty()) return {};

  circles.counts.assign(found.size(), true);
  std::vector<Look> looks;
  for (int round = 0; round < kLooks; ++round) {
    looks.clear();
    for (size_t i = 0; i < found.size(); ++i) {
      std::optional<Look> look = LookAt(image, circles, i);
      if (!look) return {};
      looks.push_back(std::move(*look));
    }
    MoveToCentroids(looks, circles);
  }
  if (std::ranges::count(circles.counts, false) > 0) return {};

  const double radius = MedianRadius(looks);
  std::vector<DetectedTag> marks;
  for (size_t i = 0; i < looks.size(); ++i) {
    const Look& look = looks[i];
    const Vector2d at = circles.seen[i] + look.nearby.FromCentroid(radius);
    marks.push_back({.family = board.family(),
                     .tag = board.first_mark() + static_cast<int>(i),
                     .corners = {at},
                     .sigma = look.spot->sigma,
                     .size = d.square * look.scale,
                     .fitted = true});
  }
  return marks;
}

}  // namespace silhouette
