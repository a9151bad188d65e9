// The pixels that a box may touch in an image.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <optional>

namespace silhouette {

// Corners of a box and the middles of its edges, faces and itself: distortion bends edges.
inline std::array<Eigen::Vector3d, 27> PointsOf(const Eigen::AlignedBox3d& box) {
  std::array<Eigen::Vector3d, 27> points;
  for (int i = 0; i < 27; ++i) {
    const Eigen::Vector3d share(i % 3 / 2.0, i / 3 % 3 / 2.0, i / 9 / 2.0);
    points[static_cast<size_t>(i)] = box.min() + share.cwiseProduct(box.sizes());
  }
  return points;
}

// The image's pixels around projected points; the whole image if a point has no projection.
class PixelBounds {
 public:
  void Add(const std::optional<Eigen::Vector2d>& pixel) {
    if (pixel)
      box_.extend(*pixel);
    else
      whole_ = true;
  }
  // The bounds with a margin for what lies between the points, cut to the image.
  void Cut(int width, int height, int& left, int& right, int& top, int& bottom) const {
    left = top = 0;
    right = width;
    bottom = height;
    if (whole_) return;
    const Eigen::Vector2d margin = 0.02 * box_.sizes() + Eigen::Vector2d(2, 2);
    const Eigen::Vector2d lower = (box_.min() - margin).cwiseMax(0);
    const Eigen::Vector2d upper = (box_.max() + margin).cwiseMax(0);
    left = static_cast<int>(std::min<double>(lower.x(), width));
    top = static_cast<int>(std::min<double>(lower.y(), height));
    right = static_cast<int>(std::min<double>(upper.x() + 1, width));
    bottom = static_cast<int>(std::min<double>(upper.y() + 1, height));
  }

 private:
  Eigen::AlignedBox2d box_;
  bool whole_ = false;
};

}  // namespace silhouette
