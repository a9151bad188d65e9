// SPDX-License-Identifier: Apache-2.0
// A board as a distorted camera sees it, for tests: averaged over each pixel's square,
// blurred, with noise. Where its corners really are is known.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "calib/boards/board.h"
#include "calib/boards/board_print.h"
#include "calib/camera/camera_model.h"

namespace silhouette {

struct RenderSettings {
  double blur = 0.5;  // standard deviation, pixels
  double noise = 2;   // standard deviation, grey levels
  double black = 40;  // grey levels
  double white = 210;
  bool mirrored = false;  // the print is seen as through a mirror
};

inline CameraIntrinsics Intrinsics(int width, int height, double focal, double k1) {
  CameraIntrinsics k{.width = width, .height = height, .fx = focal, .fy = focal};
  k.cx = 0.5 * width - 0.5 + 3.3;
  k.cy = 0.5 * height - 0.5 - 2.7;
  k.distortion[0] = k1;
  return k;
}

// The board's middle `distance` before the camera, turned by up to `tilt` radians any way.
inline Eigen::Isometry3d RandomPose(const Board& board, double distance, double tilt,
                                    std::mt19937_64& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(Eigen::Vector3d(0, 0, distance * (1 + 0.02 * any(random))));
  pose.rotate(Eigen::AngleAxisd(tilt * any(random), Eigen::Vector3d::UnitX()) *
              Eigen::AngleAxisd(tilt * any(random), Eigen::Vector3d::UnitY()) *
              Eigen::AngleAxisd(std::numbers::pi * any(random) / 8, Eigen::Vector3d::UnitZ()));
  return pose * Eigen::Translation3d(-0.5 * board.extent().x(), -0.5 * board.extent().y(), 0);
}

class RenderedBoard {
 public:
  RenderedBoard(const Board& board, const CameraIntrinsics& k,
                const Eigen::Isometry3d& camera_from_board, const RenderSettings& settings,
                std::mt19937_64& random)
      : board_(board), camera_(k, camera_from_board) {
    MakeCells();
    Draw(settings, random);
  }

  const cv::Mat& image() const { return image_; }
  const CameraIntrinsics& intrinsics() const { return camera_.intrinsics(); }

  Eigen::Vector2d Corner(int id, int corner) const {
    return camera_.Project(board_.CornersOf(id)[corner]).value();
  }

 private:
  // The print's edges divide the board into cells, each all black or all white.
  void MakeCells() {
    const BoardPrint print = PrintOf(board_);
    for (const Eigen::AlignedBox2d& box : print.black) {
      for (const Eigen::Vector2d& corner : {box.min(), box.max()}) {
        lines_[0].push_back(corner.x());
        lines_[1].push_back(corner.y());
      }
    }
    for (std::vector<double>& lines : lines_) {
      std::ranges::sort(lines);
      // Edges that meet differ by rounding errors.
      const auto same = [](double a, double b) { return b - a < 1e-9; };
      lines.erase(std::unique(lines.begin(), lines.end(), same), lines.end());
    }
    black_.assign((lines_[0].size() + 1) * (lines_[1].size() + 1), false);
    for (const Eigen::AlignedBox2d& box : print.black) {
      for (size_t y = PlaceOf(box.min().y() + 1e-8, 1); y <= PlaceOf(box.max().y() - 1e-8, 1);
           ++y) {
        for (size_t x = PlaceOf(box.min().x() + 1e-8, 0); x <= PlaceOf(box.max().x() - 1e-8, 0);
             ++x) {
          black_[y * (lines_[0].size() + 1) + x] = true;
        }
      }
    }
  }

  size_t PlaceOf(double coordinate, int axis) const {
    return static_cast<size_t>(std::ranges::upper_bound(lines_[axis], coordinate) -
                               lines_[axis].begin());
  }
  size_t CellAt(double x, double y) const {
    return PlaceOf(y, 1) * (lines_[0].size() + 1) + PlaceOf(x, 0);
  }

  // 1 on white, 0 on black.
  double WhiteOf(size_t cell) const { return black_[cell] ? 0 : 1; }

  void Draw(const RenderSettings& settings, std::mt19937_64& random) {
    const CameraIntrinsics& k = camera_.intrinsics();
    const CameraModel lens(k);
    // Directions of the pixels' corners; between them they are interpolated.
    cv::Mat_<cv::Vec2d> rays(k.height + 1, k.width + 1);
    for (int y = 0; y <= k.height; ++y) {
      for (int x = 0; x <= k.width; ++x) {
        const Eigen::Vector3d ray = lens.Ray({x - 0.5, y - 0.5}).value();
        rays(y, x) = {ray.x() / ray.z(), ray.y() / ray.z()};
      }
    }
    Eigen::Matrix3d ray_from_board;
    ray_from_board << camera_.camera_from_world().linear().leftCols<2>(),
        camera_.camera_from_world().translation();
    // Plain numbers: tests are hardly optimised, and this is most of their time.
    std::array<double, 9> h;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data()) = ray_from_board.inverse();
    // A pixel is sampled at the points of a sequence that spreads evenly along all directions, and
    // at their mirror images, so that their mean is the pixel's centre.
    std::array<std::array<double, 2>, 256> places;
    for (size_t i = 0; i < places.size(); i += 2) {
      double whole = 0;
      places[i] = {std::modf(0.5 + static_cast<double>(i) * 0.7548776662466927, &whole),
                   std::modf(0.5 + static_cast<double>(i) * 0.5698402909980532, &whole)};
      places[i + 1] = {1 - places[i][0], 1 - places[i][1]};
    }
    cv::Mat_<float> grey(k.height, k.width);
    for (int y = 0; y < k.height; ++y) {
      for (int x = 0; x < k.width; ++x) {
        const cv::Vec2d origin = rays(y, x);
        const cv::Vec2d right = rays(y, x + 1) - origin;
        const cv::Vec2d down = rays(y + 1, x) - origin;
        const cv::Vec2d twist = rays(y + 1, x + 1) - rays(y + 1, x) - right;
        const auto cell_at = [&](double a, double b) {
          const double u = origin[0] + a * right[0] + b * down[0] + a * b * twist[0];
          const double v = origin[1] + a * right[1] + b * down[1] + a * b * twist[1];
          const double z = h[6] * u + h[7] * v + h[8];
          return CellAt((h[0] * u + h[1] * v + h[2]) / z, (h[3] * u + h[4] * v + h[5]) / z);
        };
        const size_t first = cell_at(0, 0);
        double white = WhiteOf(first);
        if (cell_at(1, 0) != first || cell_at(0, 1) != first || cell_at(1, 1) != first) {
          white = 0;
          for (const auto& [a, b] : places) white += WhiteOf(cell_at(a, b));
          white /= static_cast<double>(places.size());
        }
        grey(y, x) = static_cast<float>(settings.black + (settings.white - settings.black) * white);
      }
    }
    if (settings.blur > 0) cv::GaussianBlur(grey, grey, {}, settings.blur, settings.blur);
    std::normal_distribution<double> noise(0, settings.noise);
    image_.create(k.height, k.width, CV_8UC1);
    for (int y = 0; y < k.height; ++y) {
      for (int x = 0; x < k.width; ++x) {
        image_.at<uint8_t>(y, x) = cv::saturate_cast<uint8_t>(grey(y, x) + noise(random));
      }
    }
    if (settings.mirrored) cv::flip(image_, image_, 1);
  }

  Board board_;
  CameraModel camera_;                        // the board's frame is the world
  std::array<std::vector<double>, 2> lines_;  // across x, across y
  std::vector<bool> black_;                   // of cells
  cv::Mat image_;
};

}  // namespace silhouette
