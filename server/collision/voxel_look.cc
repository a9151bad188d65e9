#include "server/collision/voxel_look.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace silhouette {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kVoxelLookEdge = VoxelGrid::kBlockEdge;
// Rounding of coordinates, in pixels.
constexpr double kVoxelLookRounding = 1e-6;
// Certain pixels farther than this from the centre's are not asked for.
constexpr int kShapeReach = 15;

// How finely places and radii are told apart, in steps per pixel: the larger the ball, the less it
// matters.
int StepsPerPixel(double radius) { return radius < 2 ? 16 : radius < 4 ? 8 : 4; }

// The pixels, relative to pixel (0, 0), that every ellipse with these semi-axes touches whose
// centre lies in `centres`.
PixelShape SurelyTouched(const PlaneBox& centres, const Vector2d& axes) {
  PixelShape shape;
  const auto farthest = [](double from, double to, int pixel) {
    return std::max({0.0, pixel - 0.5 - from, to - pixel - 0.5});
  };
  for (int y = -kShapeReach; y <= kShapeReach; ++y) {
    const double dy = farthest(centres.min().y(), centres.max().y(), y) / axes.y();
    if (dy > 1) continue;
    const double room = std::sqrt(1 - dy * dy) * axes.x();
    int first = kShapeReach + 1;
    int last = -kShapeReach - 1;
    for (int x = -kShapeReach; x <= kShapeReach; ++x) {
      if (farthest(centres.min().x(), centres.max().x(), x) > room) continue;
      first = std::min(first, x);
      last = std::max(last, x);
    }
    if (first <= last) {
      shape.push_back({y, first, last});
    }
  }
  return shape;
}

// Semi-axes of an ellipse, about the image of `centre`, that the image of a ball there surely
// fills; nothing if the view cannot tell. The image of a small ball is the ellipse { J u : |u| <=
// radius } with the matrix J J'; of its second-order error, all is taken off.
std::optional<Vector2d> EllipseIn(const VoxelView& view, const Vector3d& centre, double radius) {
  const std::optional<Vector2d> image = view.project(centre);
  if (!image) return std::nullopt;
  Vector2d bend = Vector2d::Zero();
  // Half the way that the image moves while the point moves by `step` to either side.
  const auto move = [&](const Vector3d& step) -> std::optional<Vector2d> {
    const auto before = view.project(centre - step), behind = view.project(centre + step);
    if (!before || !behind) return std::nullopt;
    bend += (*before - 2 * *image + *behind).cwiseAbs();
    return (*behind - *before) / 2;
  };
  Eigen::Matrix<double, 2, 3> across;
  for (int axis = 0; axis < 3; ++axis) {
    const std::optional<Vector2d> moved = move(radius * Vector3d::Unit(axis));
    if (!moved) return std::nullopt;
    across.col(axis) = *moved;
  }
  for (int signs = 0; signs < 4; ++signs) {
    const Vector3d diagonal(signs & 1 ? 1 : -1, signs & 2 ? 1 : -1, 1);
    if (!move(radius * diagonal.normalized())) return std::nullopt;
  }
  // The ellipse with axes along x and y and the same ratio of extents that fits into the other one
  // is smaller by sqrt(1 - |correlation|).
  const Eigen::Matrix2d matrix = across * across.transpose();
  const Vector2d extents = matrix.diagonal().cwiseSqrt();
  if (!(extents.minCoeff() > 0)) return std::nullopt;
  const double correlation = std::abs(matrix(0, 1)) / (extents.x() * extents.y());
  return std::sqrt(std::max(0.0, 1 - correlation)) * extents - bend;
}

}  // namespace

VoxelLooker::VoxelLooker(const VoxelView& view, const VoxelGrid& grid, double least_obstacle,
                         VoxelSpace::Look& look)
    : view_(view),
      grid_(grid),
      least_obstacle_(least_obstacle),
      look_(look),
      corners_(static_cast<size_t>(kCorners * kCorners * kCorners)),
      shapes_{{PixelShape{}, 0}} {
  look_.shapes = {PixelShape{}};
}

void VoxelLooker::ProjectCorners(const VoxelSpace::Block& block) {
  for (int z = 0; z < kCorners; ++z) {
    for (int y = 0; y < kCorners; ++y) {
      for (int x = 0; x < kCorners; ++x) {
        corners_[static_cast<size_t>((z * kCorners + y) * kCorners + x)] =
            view_.project(grid_.Corner(block.x * kVoxelLookEdge + x, block.y * kVoxelLookEdge + y,
                                       block.z * kVoxelLookEdge + z));
      }
    }
  }
  // How far the image of a voxel's edge is from straight: a sixteenth of the bend over half a block
  // is that over a voxel, of which an eighth would do.
  bulge_ = 0;
  constexpr int kHalf = kVoxelLookEdge / 2;
  const auto bend = [&](int x, int y, int z, int dx, int dy, int dz) {
    const auto &before = Corner(x - dx, y - dy, z - dz), &at = Corner(x, y, z),
               &behind = Corner(x + dx, y + dy, z + dz);
    if (!before || !at || !behind) return;
    bulge_ = std::max(bulge_, (*before - 2 * *at + *behind).lpNorm<Eigen::Infinity>() / 16);
  };
  for (int a = 0; a < kCorners; a += kHalf) {
    for (int b = 0; b < kCorners; b += kHalf) {
      bend(kHalf, a, b, kHalf, 0, 0);
      bend(a, kHalf, b, 0, kHalf, 0);
      bend(a, b, kHalf, 0, 0, kHalf);
    }
  }
  for (int x : {-kHalf, kHalf}) {
    for (int y : {-kHalf, kHalf}) bend(kHalf, kHalf, kHalf, x, y, kHalf);
  }
}

std::optional<PlaneBox> VoxelLooker::Image(int x, int y, int z, int edges) const {
  PlaneBox box;
  for (int corner = 0; corner < 8; ++corner) {
    const auto& image = Corner(x + (corner & 1) * edges, y + (corner >> 1 & 1) * edges,
                               z + (corner >> 2 & 1) * edges);
    if (!image) return std::nullopt;
    box.extend(*image);
  }
  // Over several edges the bend grows with the square.
  const Vector2d bulge = Vector2d::Constant(bulge_ * edges * edges);
  return PlaneBox(box.min() - bulge, box.max() + bulge);
}

PixelRectangle VoxelLooker::Pixels(const std::optional<PlaneBox>& image) const {
  if (!image) return {};
  const MaskSize size = view_.mask_size;
  const Vector2d from = image->min() - view_.margin;
  const Vector2d to = image->max() + view_.margin;
  const Vector2d end(size.width - 0.5, size.height - 0.5);
  const auto pixel = [](double coordinate, int pixels) {
    return static_cast<int>(std::clamp(std::floor(coordinate + 0.5), -1.0, double(pixels)));
  };
  const int left = std::max(pixel(from.x() - kVoxelLookRounding, size.width), 0);
  const int top = std::max(pixel(from.y() - kVoxelLookRounding, size.height), 0);
  const int right = std::min(pixel(to.x() + kVoxelLookRounding, size.width), size.width - 1);
  const int bottom = std::min(pixel(to.y() + kVoxelLookRounding, size.height), size.height - 1);
  if (left > right || top > bottom) return {};
  return {.x = left,
          .y = top,
          .width = right - left + 1,
          .height = bottom - top + 1,
          .whole = from.x() >= -0.5 - kVoxelLookRounding && from.y() >= -0.5 - kVoxelLookRounding &&
                   to.x() <= end.x() + kVoxelLookRounding &&
                   to.y() <= end.y() + kVoxelLookRounding};
}

uint32_t VoxelLooker::TouchedIndex(const PixelRectangle& pixels) {
  if (pixels.width == 0) return 0;
  const VoxelSpace::RectangleKind kind{pixels.width, pixels.height, pixels.whole};
  const auto [place, added] = kinds_.emplace(kind, static_cast<uint32_t>(look_.kinds.size()));
  if (added) look_.kinds.push_back(kind);
  return 1 + place->second * static_cast<uint32_t>(view_.mask_size.pixels()) +
         static_cast<uint32_t>(pixels.y * view_.mask_size.width + pixels.x);
}

std::optional<Vector2d> VoxelLooker::BallAxes(const VoxelSpace::Block& block) const {
  Vector2d least = Vector2d::Constant(std::numeric_limits<double>::infinity());
  const auto take = [&](double x, double y, double z) {
    const Vector3d at = grid_.Corner(0, 0, 0) + grid_.edge() * kVoxelLookEdge *
                                                    Vector3d(block.x + x, block.y + y, block.z + z);
    const std::optional<Vector2d> axes = EllipseIn(view_, at, least_obstacle_);
    if (axes) least = least.cwiseMin(*axes);
    return axes.has_value();
  };
  // The extents shrink with the distance: the block's corners have the least.
  for (int corner = 0; corner < 8; ++corner) {
    if (!take(corner & 1, corner >> 1 & 1, corner >> 2 & 1)) return std::nullopt;
  }
  if (!take(0.5, 0.5, 0.5)) return std::nullopt;
  const Vector2d axes = least - view_.margin - Vector2d::Constant(bulge_ + kVoxelLookRounding);
  if (!(axes.minCoeff() > 0)) return std::nullopt;
  return axes;
}

uint32_t VoxelLooker::CertainIndex(const PlaneBox& centres, const Vector2d& axes) {
  const MaskSize size = view_.mask_size;
  const Vector2d anchor = centres.center().array().round();
  if (!(anchor.x() >= 0 && anchor.y() >= 0 && anchor.x() < size.width &&
        anchor.y() < size.height)) {
    return 0;
  }
  const int steps = StepsPerPixel(axes.maxCoeff());
  const Eigen::Vector2i from =
      ((centres.min() - anchor) * steps).array().floor().matrix().cast<int>();
  const Eigen::Vector2i to = ((centres.max() - anchor) * steps).array().ceil().matrix().cast<int>();
  const Eigen::Vector2i radii = (axes * steps).array().floor().matrix().cast<int>();
  const auto [known, added] = quantised_.emplace(
      std::array{from.x(), from.y(), to.x(), to.y(), radii.x() * 64 + steps, radii.y()}, 0);
  if (added && radii.minCoeff() > 0) {
    const PixelShape shape = SurelyTouched({from.cast<double>() / steps, to.cast<double>() / steps},
                                           radii.cast<double>() / steps);
    const auto [place, is_new] = shapes_.emplace(shape, static_cast<uint32_t>(shapes_.size()));
    if (is_new) look_.shapes.push_back(shape);
    known->second = place->second;
  }
  const uint32_t row =
      known->second * static_cast<uint32_t>(size.height) + static_cast<uint32_t>(anchor.y());
  return row * look_.row_bits() + static_cast<uint32_t>(anchor.x());
}

PixelRectangle VoxelLooker::BlockRectangle(const VoxelSpace::Block& block) {
  ProjectCorners(block);
  return Pixels(Image(0, 0, 0, kVoxelLookEdge));
}

void VoxelLooker::Append(const VoxelSpace::Block& block) {
  ProjectCorners(block);
  const std::optional<Vector2d> axes = BallAxes(block);
  bool whole = true;
  int left = MaskSize::kMaxSide;
  int top = MaskSize::kMaxSide;
  int right = 0;
  int bottom = 0;
  for (int z = 0; z < kVoxelLookEdge; ++z) {
    for (int y = 0; y < kVoxelLookEdge; ++y) {
      for (int x = 0; x < kVoxelLookEdge; ++x) {
        const std::optional<PlaneBox> image = Image(x, y, z, 1);
        const PixelRectangle pixels = Pixels(image);
        look_.touched.push_back(TouchedIndex(pixels));
        look_.certain.push_back(image && axes ? CertainIndex(*image, *axes) : 0);
        whole = whole && pixels.whole;
        if (pixels.width == 0) continue;
        left = std::min(left, pixels.x);
        top = std::min(top, pixels.y);
        right = std::max(right, pixels.x + pixels.width);
        bottom = std::max(bottom, pixels.y + pixels.height);
      }
    }
  }
  const PixelRectangle none;
  const PixelRectangle all{left, top, right - left, bottom - top, whole};
  look_.block_touched.push_back(right == 0 ? none : all);
}

}  // namespace silhouette
