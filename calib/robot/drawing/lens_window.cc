// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/lens_window.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

namespace silhouette {
namespace {

using Eigen::AlignedBox2d;
using Eigen::Vector2d;

constexpr double kBeyond = 2;         // pixels about image and margin that the window holds too
constexpr double kWidest = 12;        // at z = 1: 85 degrees off the axis, as CameraModel has it
constexpr double kLensSafety = 1.25;  // sampled bounds of the lens are multiplied by this

}  // namespace

Vector2d AtOneMetre(const CameraModel& camera, const Vector2d& pixel) {
  const CameraIntrinsics& in = camera.intrinsics();
  const auto p = camera.Undistorted(pixel);
  if (!p) return Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  return {(p->x() - in.cx) / in.fx, (p->y() - in.cy) / in.fy};
}

LensWindow::LensWindow(const CameraModel& camera, double margin) {
  Find(camera, margin);
  BoundLens(camera);
}

void LensWindow::Find(const CameraModel& camera, double margin) {
  const CameraIntrinsics& in = camera.intrinsics();
  // Around the image, and a little beyond what it may show.
  const double beyond = kBeyond + margin;
  const Vector2d low = Vector2d::Constant(-0.5 - beyond);
  const Vector2d high(in.width - 0.5 + beyond, in.height - 0.5 + beyond);
  const std::vector<Vector2d> round = {low, {high.x(), low.y()}, high, {low.x(), high.y()}};
  bool all_seen = true;
  double step = 0;
  double farthest = 0;
  std::optional<Vector2d> before;
  for (size_t side = 0; side < 4 && all_seen; ++side) {
    const Vector2d along = round[(side + 1) % 4] - round[side];
    const int steps = 2 * static_cast<int>(std::ceil(along.norm()));
    for (int i = 0; i <= steps && all_seen; ++i) {
      const Vector2d p = AtOneMetre(camera, round[side] + along * i / steps);
      all_seen = p.allFinite();
      if (!all_seen) break;
      box_.extend(p);
      farthest = std::max(farthest, p.norm());
      if (before) step = std::max(step, (p - *before).norm());
      before = p;
    }
  }
  box_.min() -= Vector2d::Constant(step);
  box_.max() += Vector2d::Constant(step);
  farthest += step;
  const double fold = camera.FoldRadius();
  const double widest = std::min(fold, kWidest);
  all_seen = all_seen && farthest < kWidest && NothingBeyond(camera, widest, margin);
  const Vector2d corner = box_.min().cwiseAbs().cwiseMax(box_.max().cwiseAbs());
  if (all_seen && corner.norm() < 0.98 * fold) {
    sides_ = {{{-1, 0}, -box_.min().x()},
              {{1, 0}, box_.max().x()},
              {{0, -1}, -box_.min().y()},
              {{0, 1}, box_.max().y()}};
    return;
  }
  // A polygon about a circle, which is a little smaller than the lens's fold if the image is. Where
  // the lens folds within the image the image of what is between circle and polygon hardly moves.
  constexpr int kSides = 64;
  constexpr double kCorner = 1.0013;  // 1 / cos(pi / kSides), rounded up
  clear_of_fold_ = all_seen && farthest * kCorner < fold;
  radius_ = clear_of_fold_ ? farthest : widest;
  box_ =
      AlignedBox2d(Vector2d::Constant(-kCorner * radius_), Vector2d::Constant(kCorner * radius_));
  for (int i = 0; i < kSides; ++i) {
    const double angle = 2 * std::numbers::pi * i / kSides;
    sides_.push_back({{std::cos(angle), std::sin(angle)}, radius_});
  }
}

// Whether no direction outside the box and within `widest` may appear in the image, on a lattice.
bool LensWindow::NothingBeyond(const CameraModel& camera, double widest, double margin) const {
  const CameraIntrinsics& in = camera.intrinsics();
  constexpr int kSteps = 200;
  const AlignedBox2d image(Vector2d::Constant(-0.5 - margin),
                           Vector2d(in.width - 0.5 + margin, in.height - 0.5 + margin));
  for (int y = -kSteps; y <= kSteps; ++y) {
    for (int x = -kSteps; x <= kSteps; ++x) {
      const Vector2d p = Vector2d(x, y) * (widest / kSteps);
      if (p.norm() < widest && !box_.contains(p) && image.contains(PixelAt(in, p))) return false;
    }
  }
  return true;
}

void LensWindow::BoundLens(const CameraModel& camera) {
  const CameraIntrinsics& in = camera.intrinsics();
  constexpr int kSteps = 96;
  const double h = 1e-4 * box_.sizes().maxCoeff();
  const Vector2d x(h, 0);
  const Vector2d y(0, h);
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < (kSteps + 1) * (kSteps + 1); ++i) {
    const Vector2d share =
        Vector2d(i % (kSteps + 1), i / (kSteps + 1)) / static_cast<double>(kSteps);
    const Vector2d p = box_.min() + share.cwiseProduct(box_.sizes());
    const double beyond = p.norm() / (1.001 * camera.FoldRadius());
    const Vector2d at = beyond > 1 ? Vector2d(p / beyond) : p;
    const Vector2d middle = PixelAt(in, at);
    const Vector2d dx = (PixelAt(in, at + x) - PixelAt(in, at - x)) / (2 * h);
    const Vector2d dy = (PixelAt(in, at + y) - PixelAt(in, at - y)) / (2 * h);
    const Vector2d dxx = (PixelAt(in, at + x) - 2 * middle + PixelAt(in, at - x)) / (h * h);
    const Vector2d dyy = (PixelAt(in, at + y) - 2 * middle + PixelAt(in, at - y)) / (h * h);
    const Vector2d dxy = (PixelAt(in, at + x + y) - PixelAt(in, at + x - y) -
                          PixelAt(in, at - x + y) + PixelAt(in, at - x - y)) /
                         (4 * h * h);
    const double scale = std::sqrt(dx.squaredNorm() + dy.squaredNorm());
    // The greatest singular value.
    const double sum = dx.squaredNorm() + dy.squaredNorm();
    const double area = dx.x() * dy.y() - dx.y() * dy.x();
    const double apart = std::sqrt(std::max(0.0, sum * sum - 4 * area * area));
    stretch_ = std::max(stretch_, std::sqrt((sum + apart) / 2));
    least = std::min(least, std::sqrt(std::max(0.0, (sum - apart) / 2)));
    const double bend = std::sqrt(dxx.squaredNorm() + 2 * dxy.squaredNorm() + dyy.squaredNorm());
    // Not a number stays.
    if (!(scale <= scale_)) scale_ = scale;
    if (!(bend <= bend_)) bend_ = bend;
    if (std::isnan(scale_) || std::isnan(bend_)) break;
  }
  // Between two samples it changes by no more than it bends.
  const double between = kLensSafety * bend_ * box_.sizes().norm() / (2 * kSteps);
  stretch_ = 1.001 * stretch_ + between;
  shrink_ = std::max(0.0, 0.999 * least - between);
  scale_ *= kLensSafety;
  bend_ *= kLensSafety;
}

bool LensWindow::Holds(const Vector2d& low, const Vector2d& high) const {
  if (radius_ > 0) return low.cwiseAbs().cwiseMax(high.cwiseAbs()).norm() <= radius_;
  return box_.contains(low) && box_.contains(high);
}

void LensWindow::Clip(std::vector<Vector2d>& outline, std::vector<Vector2d>& room) const {
  AlignedBox2d box;
  for (const Vector2d& point : outline) box.extend(point);
  if (Holds(box.min(), box.max())) return;
  for (const HalfPlane& side : sides_) {
    const auto within = [&](const Vector2d& p) { return side.offset - side.normal.dot(p); };
    if (std::ranges::all_of(outline, [&](const Vector2d& p) { return within(p) >= 0; })) {
      continue;
    }
    room.clear();
    for (size_t i = 0; i < outline.size(); ++i) {
      const Vector2d& from = outline[i];
      const Vector2d& to = outline[(i + 1) % outline.size()];
      const double before = within(from);
      const double after = within(to);
      if (before >= 0) room.push_back(from);
      if ((before >= 0) != (after >= 0)) {
        room.push_back(from + before / (before - after) * (to - from));
      }
    }
    std::swap(outline, room);
    if (outline.empty()) return;
  }
}

}  // namespace silhouette
