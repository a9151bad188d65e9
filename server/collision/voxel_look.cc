// SPDX-License-Identifier: Apache-2.0
#include "server/collision/voxel_look.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <span>
#include <stdexcept>
#include <utility>

namespace silhouette {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kVoxelLookEdge = VoxelGrid::kBlockEdge;
// Rounding of coordinates, in pixels.
constexpr double kVoxelLookRounding = 1e-6;
// Certain pixels farther than this from the centre's are not asked for.
constexpr int kShapeReach = 15;
constexpr size_t kShapeSide = 2 * kShapeReach + 1;

// How finely places and radii are resolved, in steps per pixel: the larger the ball, the less it
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

// Throws unless indices below `end` fit into the entries of a Look.
void CheckIndices(uint64_t end) {
  if (end <= uint64_t{1} << 32) return;
  throw std::invalid_argument(
      "the images of the voxels have too many shapes; use smaller masks or a coarser voxel_edge");
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
  if (added) {
    look_.kinds.push_back(kind);
    CheckIndices(1 + look_.kinds.size() * view_.mask_size.pixels());
  }
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

VoxelLooker::BallShapes* VoxelLooker::BallsOf(const VoxelSpace::Block& block) {
  const std::optional<Vector2d> axes = BallAxes(block);
  if (!axes) return nullptr;
  const int steps = StepsPerPixel(axes->maxCoeff());
  const Eigen::Vector2i radii = (*axes * steps).array().floor().matrix().cast<int>();
  if (radii.minCoeff() == 0) return nullptr;
  const std::array key{steps, radii.x(), radii.y()};
  return &ball_shapes_.try_emplace(key, BallShapes{steps, radii}).first->second;
}

uint32_t& VoxelLooker::BallShapes::Of(const Eigen::Vector2i& from, const Eigen::Vector2i& to) {
  // `from` + `to` is at most a pixel, and a step for rounding outwards.
  const int most = steps + 1;
  const auto side = static_cast<size_t>(2 * most + 1);
  const Eigen::Vector2i size = to - from;
  const Eigen::Vector2i place = (from + to).array() + most;
  std::vector<uint32_t>& of_size = by_centres[{size.x(), size.y()}];
  if (of_size.empty()) of_size.assign(side * side, kNotMade);
  return of_size.at(static_cast<size_t>(place.y()) * side + static_cast<size_t>(place.x()));
}

uint32_t VoxelLooker::CertainIndex(const PlaneBox& centres, BallShapes& balls) {
  const MaskSize size = view_.mask_size;
  const Vector2d anchor = centres.center().array().round();
  if (!(anchor.x() >= 0 && anchor.y() >= 0 && anchor.x() < size.width &&
        anchor.y() < size.height)) {
    return 0;
  }
  const double steps = balls.steps;
  const Eigen::Vector2i from =
      ((centres.min() - anchor) * steps).array().floor().matrix().cast<int>();
  const Eigen::Vector2i to = ((centres.max() - anchor) * steps).array().ceil().matrix().cast<int>();
  uint32_t& known = balls.Of(from, to);
  if (known == BallShapes::kNotMade) {
    const PixelShape shape = SurelyTouched({from.cast<double>() / steps, to.cast<double>() / steps},
                                           balls.radii.cast<double>() / steps);
    const auto [place, is_new] = shapes_.emplace(shape, static_cast<uint32_t>(look_.shapes.size()));
    if (is_new) {
      look_.shapes.push_back(shape);
      CheckIndices(look_.shapes.size() * static_cast<size_t>(size.height) * look_.row_bits());
    }
    known = place->second;
  }
  const uint32_t row =
      known * static_cast<uint32_t>(size.height) + static_cast<uint32_t>(anchor.y());
  return row * look_.row_bits() + static_cast<uint32_t>(anchor.x());
}

PixelRectangle VoxelLooker::BlockRectangle(const VoxelSpace::Block& block) {
  ProjectCorners(block);
  return Pixels(Image(0, 0, 0, kVoxelLookEdge));
}

void VoxelLooker::Append(const VoxelSpace::Block& block) {
  ProjectCorners(block);
  BallShapes* const balls = BallsOf(block);
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
        look_.certain.push_back(image && balls != nullptr ? CertainIndex(*image, *balls) : 0);
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

namespace {

constexpr uint8_t kSaysNothing =
    LookTables::kPossible | LookTables::kObstacle | LookTables::kAllowed;
// While a table is made, in the place of kAllowed: a pixel that is neither background nor allowed.
constexpr uint8_t kNotAllowed = LookTables::kAllowed;

// out[i] = a[i] | b[i], eight at a time.
void Or(const uint8_t* a, const uint8_t* b, size_t count, uint8_t* out) {
  size_t i = 0;
  for (; i + 8 <= count; i += 8) {
    uint64_t of_a = 0;
    uint64_t of_b = 0;
    std::memcpy(&of_a, a + i, 8);
    std::memcpy(&of_b, b + i, 8);
    of_a |= of_b;
    std::memcpy(out + i, &of_a, 8);
  }
  for (; i < count; ++i) out[i] = a[i] | b[i];
}

void Flip(uint8_t* bytes, size_t count, uint8_t bits) {
  for (size_t i = 0; i < count; ++i) bytes[i] ^= bits;
}

// `row` moved so that place x holds what was at x + by; what comes in from outside is set.
void AndMoved(std::span<const uint64_t> row, int by, int width, std::span<uint64_t> out) {
  const auto bits = [&](int place) {  // 64 bits from `place`, of whatever lies there
    const auto word = [&](int64_t i) {
      return i < 0 || i >= static_cast<int64_t>(row.size()) ? ~uint64_t{0}
                                                            : row[static_cast<size_t>(i)];
    };
    const int64_t at = place >> 6;  // rounded down
    const unsigned shift = static_cast<unsigned>(place) & 63;
    return shift == 0 ? word(at) : word(at) >> shift | word(at + 1) << (64 - shift);
  };
  for (size_t i = 0; i < out.size(); ++i) {
    const int place = static_cast<int>(i) * 64;
    if (place < width) out[i] &= bits(place + by);
  }
}

}  // namespace

LookTables::LookTables(const VoxelSpace::Look& look, const std::optional<ObstacleImage>& image,
                       const std::optional<Mask>& allowed)
    : width_(look.mask_size.width) {
  if (!image) {
    touched_.assign(1 + look.kinds.size() * look.mask_size.pixels(), kPossible | kObstacle);
    return;
  }
  FillTouched(look, *image, allowed);
  const Mask foreground = image->obstacle() | image->unknown() | image->error();
  certain_.emplace(look, foreground);
  const auto stride = static_cast<size_t>(width_) + 1;
  sums_.assign(stride * (static_cast<size_t>(look.mask_size.height) + 1), 0);
  const MaskWords words = foreground.words();
  for (int y = 0; y < look.mask_size.height; ++y) {
    uint32_t in_row = 0;
    for (int x = 0; x < width_; ++x) {
      const auto bit = static_cast<size_t>(y * width_ + x);
      in_row += static_cast<uint32_t>(words[bit / 64] >> (bit % 64) & 1);
      const size_t corner = static_cast<size_t>(y + 1) * stride + static_cast<size_t>(x) + 1;
      sums_[corner] = sums_[corner - stride] + in_row;
    }
  }
}

void LookTables::FillTouched(const VoxelSpace::Look& look, const ObstacleImage& image,
                             const std::optional<Mask>& allowed) {
  const size_t pixels = look.mask_size.pixels();
  int widest = 1;
  for (const auto& kind : look.kinds) widest = std::max(widest, kind.width);
  // For rectangles of one row and 1, 2, ... pixels, by their first pixel.
  std::vector<uint8_t> rows(static_cast<size_t>(widest) * pixels, 0);
  const MaskWords obstacle = image.obstacle().words();
  const MaskWords unknown = image.unknown().words();
  const MaskWords error = image.error().words();
  for (size_t i = 0; i < pixels; ++i) {
    const auto bit = [i](MaskWords words) { return (words[i / 64] >> (i % 64) & 1) != 0; };
    if (!bit(obstacle) && !bit(unknown) && !bit(error)) continue;
    rows[i] = kPossible | (bit(obstacle) ? kObstacle | kShown : 0) |
              (allowed && bit(allowed->words()) ? 0 : kNotAllowed);
  }
  for (size_t width = 2; width <= static_cast<size_t>(widest); ++width) {
    uint8_t* out = rows.data() + (width - 1) * pixels;
    Or(out - pixels, rows.data() + (width - 1), pixels - (width - 1), out);
  }
  touched_.assign(1 + look.kinds.size() * pixels, kSaysNothing);
  const auto stride = static_cast<size_t>(width_);
  for (size_t i = 0; i < look.kinds.size(); ++i) {
    const VoxelSpace::RectangleKind& kind = look.kinds[i];
    if (!kind.whole) continue;
    const uint8_t* row = rows.data() + static_cast<size_t>(kind.width - 1) * pixels;
    uint8_t* out = touched_.data() + 1 + i * pixels;
    std::copy(row, row + pixels, out);
    for (size_t below = 1; below < static_cast<size_t>(kind.height); ++below) {
      Or(out, row + below * stride, pixels - below * stride, out);
    }
    Flip(out, pixels, kNotAllowed);
  }
}

CertainImages::CertainImages(const VoxelSpace::Look& look, const Mask& foreground)
    : shapes_(look.shapes),
      width_(look.mask_size.width),
      height_(static_cast<size_t>(look.mask_size.height)),
      row_words_(look.row_bits() / 64),
      foreground_(height_ * row_words_, ~uint64_t{0}),
      run_images_(kShapeSide * kShapeSide),
      words_(std::make_unique_for_overwrite<uint64_t[]>(shapes_.size() * foreground_.size())),
      made_((shapes_.size() * foreground_.size() + 63) / 64, 0) {
  const MaskWords words = foreground.words();
  for (size_t y = 0; y < height_; ++y) {
    for (size_t x = 0; x < static_cast<size_t>(width_); ++x) {
      const size_t bit = y * static_cast<size_t>(width_) + x;
      if ((words[bit / 64] >> (bit % 64) & 1) != 0) continue;
      foreground_[y * row_words_ + x / 64] &= ~(uint64_t{1} << (x % 64));
    }
  }
}

const std::vector<uint64_t>& CertainImages::RunImage(int first, int last) {
  std::vector<uint64_t>& image = run_images_[static_cast<size_t>(first + kShapeReach) * kShapeSide +
                                             static_cast<size_t>(last + kShapeReach)];
  if (!image.empty()) return image;
  image.assign(foreground_.size(), ~uint64_t{0});
  for (size_t y = 0; y < height_; ++y) {
    const std::span row(foreground_.data() + y * row_words_, row_words_);
    const std::span out(image.data() + y * row_words_, row_words_);
    for (int by = first; by <= last; ++by) AndMoved(row, by, width_, out);
  }
  return image;
}

void CertainImages::Make(size_t word) {
  const size_t in_image = word % foreground_.size();
  const int y = static_cast<int>(in_image / row_words_);
  uint64_t bits = ~uint64_t{0};
  for (const PixelRun& run : shapes_[word / foreground_.size()]) {
    const int row = y + run.dy;
    if (row < 0 || row >= static_cast<int>(height_)) continue;
    bits &= RunImage(run.first,
                     run.last)[static_cast<size_t>(row) * row_words_ + in_image % row_words_];
  }
  words_[word] = bits;
  made_[word / 64] |= uint64_t{1} << (word % 64);
}

bool LookTables::AnyPossible(const PixelRectangle& pixels) const {
  if (sums_.empty() || !pixels.whole) return true;
  const auto stride = static_cast<size_t>(width_) + 1;
  const size_t top = static_cast<size_t>(pixels.y) * stride;
  const size_t bottom = static_cast<size_t>(pixels.y + pixels.height) * stride;
  const auto left = static_cast<size_t>(pixels.x);
  const auto right = static_cast<size_t>(pixels.x + pixels.width);
  return sums_[bottom + right] - sums_[bottom + left] - sums_[top + right] + sums_[top + left] != 0;
}

}  // namespace silhouette
