// A board of tags as a distorted camera sees it, for tests: averaged over each pixel's square,
// blurred, with noise. Where its corners really are is known.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "calib/camera_model.h"
#include "calib/tags/board.h"
#include "calib/tags/tag_family.h"

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
  // 1 on white, 0 on black.
  double WhiteAt(double x, double y) const {
    const BoardDescription& d = board_.description();
    const double pitch = d.tag_size + d.gap;
    const double print = d.tag_size + 2 * rim_;
    const double left = x + rim_;
    const double top = y + rim_;
    const int column = pitch > 0 && d.columns > 1 ? static_cast<int>(std::floor(left / pitch)) : 0;
    const int row = pitch > 0 && d.rows > 1 ? static_cast<int>(std::floor(top / pitch)) : 0;
    if (column < 0 || row < 0 || column >= d.columns || row >= d.rows) return 1;
    const double in_x = left - column * pitch;
    const double in_y = top - row * pitch;
    if (in_x < 0 || in_y < 0 || in_x >= print || in_y >= print) return 1;
    const TagModules& tag = modules_[static_cast<size_t>(row) * d.columns + column];
    return tag.White(std::min(tag.width - 1, static_cast<int>(in_x / module_)),
                     std::min(tag.width - 1, static_cast<int>(in_y / module_)))
               ? 1
               : 0;
  }

  void Draw(const RenderSettings& settings, std::mt19937_64& random) {
    const CameraIntrinsics& k = camera_.intrinsics();
    const CameraModel lens(k, Eigen::Isometry3d::Identity());
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
    constexpr int kSamples = 64;
    std::array<cv::Vec2d, kSamples> places;
    for (int i = 0; i < kSamples; i += 2) {
      double whole = 0;
      places[i] = {std::modf(0.5 + i * 0.7548776662466927, &whole),
                   std::modf(0.5 + i * 0.5698402909980532, &whole)};
      places[i + 1] = cv::Vec2d(1, 1) - places[i];
    }
    cv::Mat_<float> grey(k.height, k.width);
    for (int y = 0; y < k.height; ++y) {
      for (int x = 0; x < k.width; ++x) {
        const cv::Vec2d origin = rays(y, x);
        const cv::Vec2d right = rays(y, x + 1) - origin;
        const cv::Vec2d down = rays(y + 1, x) - origin;
        const cv::Vec2d twist = rays(y + 1, x + 1) - rays(y + 1, x) - right;
        double white = 0;
        for (const cv::Vec2d& place : places) {
          const cv::Vec2d ray =
              origin + place[0] * right + place[1] * down + place[0] * place[1] * twist;
          const Eigen::Vector3d at = board_from_ray * Eigen::Vector3d(ray[0], ray[1], 1);
          white += WhiteAt(at.x() / at.z(), at.y() / at.z());
        }
        grey(y, x) = static_cast<float>(settings.black +
                                        (settings.white - settings.black) * white / kSamples);
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
