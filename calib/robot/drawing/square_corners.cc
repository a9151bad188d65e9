// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/square_corners.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "calib/robot/drawing/lens_window.h"

namespace silhouette {
namespace {

using Eigen::AlignedBox2d;
using Eigen::Vector2d;

}  // namespace

SquareCorners::SquareCorners(const CameraModel& camera, double margin) {
  const CameraIntrinsics& in = camera.intrinsics();
  const auto at = [&](double x, double y) { return AtOneMetre(camera, {x, y}); };
  const double half = 0.5 + margin;
  for (int y = 0; y < in.height; ++y) {
    for (int x = 0; x < in.width; ++x) {
      corners_.push_back({at(x - half, y - half), at(x + half, y - half), at(x - half, y + half),
                          at(x + half, y + half)});
    }
  }
  // A side that bends by its second derivative d is d / 8 off its chord in the middle; d is the
  // second difference of corners a pixel apart. Twice that, for what is between.
  double second = 0;
  const auto columns = static_cast<size_t>(in.width);
  for (size_t i = 0; i < corners_.size(); ++i) {
    for (size_t k = 0; k < 4; ++k) {
      const auto bend = [&](size_t step) {
        const double size =
            (corners_[i - step][k] - 2 * corners_[i][k] + corners_[i + step][k]).norm();
        if (size > second) second = size;  // not a number is not
      };
      if (i % columns > 0 && i % columns + 1 < columns) bend(1);
      if (i >= columns && i + columns < corners_.size()) bend(columns);
    }
  }
  bend_ = 2 * second * (2 * half) * (2 * half) / 8 + 1e-9;
}

void SquareCorners::AddInside(std::span<const Vector2d> outline, std::span<uint64_t> words) const {
  AlignedBox2d box;
  for (const Vector2d& point : outline) box.extend(point);
  const auto is_inside = [&](const Vector2d& p) {
    if (!box.contains(p)) return false;  // not a number is not
    for (size_t i = 0; i < outline.size(); ++i) {
      const Vector2d& from = outline[i];
      const Vector2d edge = outline[(i + 1) % outline.size()] - from;
      const Vector2d to = p - from;
      if (!(edge.x() * to.y() - edge.y() * to.x() >= bend_ * edge.norm())) return false;
    }
    return true;
  };
  for (size_t pixel = 0; pixel < corners_.size(); ++pixel) {
    if (!std::ranges::all_of(corners_[pixel], is_inside)) continue;
    words[pixel / 64] |= uint64_t{1} << (pixel % 64);
  }
}

}  // namespace silhouette
