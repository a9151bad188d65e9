// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/lens_stages.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

namespace silhouette {
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
