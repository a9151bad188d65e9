// SPDX-License-Identifier: Apache-2.0
// A board of tags as a distorted camera sees it, for tests: averaged over each pixel's square,
// blurred, with noise. Where its corners really are is known.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "calib/boards/board.h"
#include "calib/boards/tag_family.h"
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
  const TagCorners last = board.CornersOf(board.description().first_id + board.tags() - 1);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(Eigen::Vector3d(0, 0, distance * (1 + 0.02 * any(random))));
  pose.rotate(Eigen::AngleAxisd(tilt * any(random), Eigen::Vector3d::UnitX()) *
              Eigen::AngleAxisd(tilt * any(random), Eigen::Vector3d::UnitY()) *
              Eigen::AngleAxisd(std::numbers::pi * any(random) / 8, Eigen::Vector3d::UnitZ()));
  return pose * Eigen::Translation3d(-0.5 * last[1]);
}

class RenderedBoard {
 public:
  RenderedBoard(const Board& board, const CameraIntrinsics& k,
                const Eigen::Isometry3d& camera_from_board, const RenderSettings& settings,
                std::mt19937_64& random)
      : board_(board), camera_(k, camera_from_board) {
    const TagFamily family(board.description().family);
    for (int i = 0; i < board.tags(); ++i) {
      modules_.push_back(family.Modules(board.description().first_id + i));
    }
    module_ = board.description().tag_size / family.width_at_border();
    rim_ = module_ * (family.total_width() - family.width_at_border()) / 2;
    Draw(settings, random);
  }

  const cv::Mat& image() const { return image_; }
  const CameraIntrinsics& intrinsics() const { return camera_.intrinsics(); }

  Eigen::Vector2d Corner(int id, int corner) const {
    return camera_.Project(board_.CornersOf(id)[corner]).value();
  }

 private:
  // Which module of which tag is at a point of the board, as a number; -1: paper.
  int ModuleAt(const Eigen::Vector2d& at) const {
    const BoardDescription& d = board_.description();
    const double pitch = d.tag_size + d.gap;
    const double print = d.tag_size + 2 * rim_;
    const double left = at.x() + rim_;
    const double top = at.y() + rim_;
    const int column = d.columns > 1 ? static_cast<int>(std::floor(left / pitch)) : 0;
    const int row = d.rows > 1 ? static_cast<int>(std::floor(top / pitch)) : 0;
    if (column < 0 || row < 0 || column >= d.columns || row >= d.rows) return -1;
    const double in_x = left - column * pitch;
    const double in_y = top - row * pitch;
    if (in_x < 0 || in_y < 0 || in_x >= print || in_y >= print) return -1;
    const int tag = row * d.columns + column;
    const int width = modules_[tag].width;
    const int module_x = std::min(width - 1, static_cast<int>(in_x / module_));
    const int module_y = std::min(width - 1, static_cast<int>(in_y / module_));
    return (tag * width + module_y) * width + module_x;
  }

  // 1 on white, 0 on black.
  double WhiteOf(int module) const {
    if (module < 0) return 1;
    const int width = modules_.front().width;
    const TagModules& tag = modules_[module / (width * width)];
    return tag.white[module % (width * width)] ? 1 : 0;
  }

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
    const Eigen::Matrix3d board_from_ray = [&] {
      Eigen::Matrix3d ray_from_board;
      ray_from_board << camera_.camera_from_world().linear().leftCols<2>(),
          camera_.camera_from_world().translation();
      return Eigen::Matrix3d(ray_from_board.inverse());
    }();
    // A pixel is sampled at the points of a sequence that spreads evenly along all directions, and
    // at their mirror images, so that their mean is the pixel's centre.
    std::vector<cv::Vec2d> places(400);
    for (size_t i = 0; i < places.size(); i += 2) {
      double whole = 0;
      places[i] = {std::modf(0.5 + static_cast<double>(i) * 0.7548776662466927, &whole),
                   std::modf(0.5 + static_cast<double>(i) * 0.5698402909980532, &whole)};
      places[i + 1] = cv::Vec2d(1, 1) - places[i];
    }
    cv::Mat_<float> grey(k.height, k.width);
    for (int y = 0; y < k.height; ++y) {
      for (int x = 0; x < k.width; ++x) {
        const cv::Vec2d origin = rays(y, x);
        const cv::Vec2d right = rays(y, x + 1) - origin;
        const cv::Vec2d down = rays(y + 1, x) - origin;
        const cv::Vec2d twist = rays(y + 1, x + 1) - rays(y + 1, x) - right;
        const auto module_at = [&](double a, double b) {
          const cv::Vec2d ray = origin + a * right + b * down + a * b * twist;
          const Eigen::Vector3d at = board_from_ray * Eigen::Vector3d(ray[0], ray[1], 1);
          return ModuleAt({at.x() / at.z(), at.y() / at.z()});
        };
        const int first = module_at(0, 0);
        double white = WhiteOf(first);
        if (module_at(1, 0) != first || module_at(0, 1) != first || module_at(1, 1) != first) {
          white = 0;
          for (const cv::Vec2d& place : places) white += WhiteOf(module_at(place[0], place[1]));
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
  CameraModel camera_;  // the board's frame is the world
  std::vector<TagModules> modules_;
  double module_ = 0;
  double rim_ = 0;
  cv::Mat image_;
};

}  // namespace silhouette
