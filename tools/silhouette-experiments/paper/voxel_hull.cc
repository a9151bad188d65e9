// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/voxel_hull.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace silhouette::paper {
namespace {

using Eigen::Vector3d;

// Voxels and pixels whose edges lie on one line do not touch by the errors of computing alone.
constexpr double kSame = 1e-9;

// Set pixels above and to the left of every pixel corner.
class Sums {
 public:
  explicit Sums(const Mask& mask) : stride_(static_cast<size_t>(mask.width()) + 1) {
    sums_.assign(stride_ * (static_cast<size_t>(mask.height()) + 1), 0);
    const MaskWords words = mask.words();
    for (int y = 0; y < mask.height(); ++y) {
      int row = 0;
      for (int x = 0; x < mask.width(); ++x) {
        const auto bit = static_cast<size_t>(y * mask.width() + x);
        row += static_cast<int>(words[bit / 64] >> (bit % 64) & 1);
        At(x + 1, y + 1) = At(x + 1, y) + row;
      }
    }
  }
  bool Any(int x0, int y0, int x1, int y1) const {
    return At(x1, y1) - At(x0, y1) - At(x1, y0) + At(x0, y0) > 0;
  }

 private:
  int& At(int x, int y) { return sums_[static_cast<size_t>(y) * stride_ + static_cast<size_t>(x)]; }
  int At(int x, int y) const {
    return sums_[static_cast<size_t>(y) * stride_ + static_cast<size_t>(x)];
  }

  size_t stride_;
  std::vector<int> sums_;
};

// From `low` to `high` along one axis, in voxels, cut at the cube's sides.
struct Span {
  int from = 0;
  int to = -1;  // included
};

Span VoxelsWithin(double low, double high, double half_width, double voxel, int edge) {
  return {std::max(0, static_cast<int>(std::floor((low + half_width) / voxel))),
          std::min(edge - 1, static_cast<int>(std::floor((high + half_width) / voxel)))};
}

// Whether a bit from `from` to `to`, both included, is set.
bool VoxelHullAnyIn(const uint64_t* bits, int from, int to) {
  for (int word = from / 64; word <= to / 64; ++word) {
    const int first = std::max(from - 64 * word, 0);
    const int last = std::min(to - 64 * word, 63);
    if (first > last) continue;
    if ((bits[word] & (~uint64_t{0} << first) & (~uint64_t{0} >> (63 - last))) != 0) return true;
  }
  return false;
}

}  // namespace

VoxelCube::VoxelCube(std::span<const ParallelCamera> cameras, double half_width, int edge)
    : half_width_(half_width), edge_(edge) {
  if (edge < 1 || edge > kMostEdge) {
    throw std::invalid_argument("a cube has 1 to " + std::to_string(kMostEdge) +
                                " voxels per edge");
  }
  for (const ParallelCamera& camera : cameras) {
    std::vector<Pixels>& touched = touched_.emplace_back();
    const double scale = camera.pixels_per_unit() * voxel() / 2;
    const double reach_x = camera.right().cwiseAbs().sum() * scale - kSame;
    const double reach_y = camera.up().cwiseAbs().sum() * scale - kSame;
    const int side = camera.mask_size().width;
    const auto pixel = [&](double at) {
      return static_cast<uint16_t>(std::clamp(static_cast<int>(std::lround(at)), 0, side - 1));
    };
    for (int z = 0; z < edge; ++z) {
      for (int y = 0; y < edge; ++y) {
        for (int x = 0; x < edge; ++x) {
          const Vector3d middle = (Vector3d(x, y, z).array() + 0.5) * voxel() - half_width;
          const Eigen::Vector2d at = camera.Project(middle);
          Pixels pixels{pixel(at.x() - reach_x), pixel(at.y() - reach_y),
                        static_cast<uint16_t>(pixel(at.x() + reach_x) + 1),
                        static_cast<uint16_t>(pixel(at.y() + reach_y) + 1)};
          const bool out = at.x() - reach_x < -0.5 || at.y() - reach_y < -0.5 ||
                           at.x() + reach_x > side - 0.5 || at.y() + reach_y > side - 0.5;
          touched.push_back(out ? Pixels{} : pixels);
        }
      }
    }
  }
}

std::string NameOf(RobotOut out) {
  switch (out) {
    case RobotOut::kBody:
      return "hull-minus-body";
    case RobotOut::kHull:
      return "hull-minus-robot-hull";
    case RobotOut::kPixels:
      return "hull-of-obstacles";
  }
  return "";
}

const std::vector<RobotOut>& AllRobotOut() {
  static const std::vector<RobotOut> all = {RobotOut::kBody, RobotOut::kHull, RobotOut::kPixels};
  return all;
}

VoxelHull::VoxelHull(const VoxelCube& cube, std::span<const ObstacleImage> images, ViewSet views,
                     std::span<const Sphere> robot, RobotOut out)
    : cube_(cube), row_words_((static_cast<size_t>(cube.edge()) + 63) / 64) {
  if (images.size() != cube.touched_.size()) {
    throw std::invalid_argument("there must be one obstacle image per view");
  }
  Carve(images, views, out);
  if (out == RobotOut::kBody) {
    for (const Sphere& sphere : robot) TakeAway(sphere);
  }
  Summarise();
}

void VoxelHull::Carve(std::span<const ObstacleImage> images, ViewSet views, RobotOut out) {
  const int edge = cube_.edge();
  bits_.assign(row_words_ * static_cast<size_t>(edge) * static_cast<size_t>(edge), 0);
  struct View {
    const std::vector<VoxelCube::Pixels>& touched;
    Sums foreground;
    Sums obstacle;
  };
  std::vector<View> looks;
  for (size_t view = 0; view < images.size(); ++view) {
    if ((views >> view & 1) == 0) continue;
    const Mask& obstacle = images[view].obstacle();
    looks.push_back({cube_.touched_[view],
                     Sums(out == RobotOut::kPixels ? obstacle : ~images[view].Background()),
                     Sums(obstacle)});
  }
  const auto shows = [](const Sums& sums, const VoxelCube::Pixels& pixels) {
    return sums.Any(pixels.x0, pixels.y0, pixels.x1, pixels.y1);
  };
  size_t voxel = 0;
  for (int z = 0; z < edge; ++z) {
    for (int y = 0; y < edge; ++y) {
      uint64_t* const row = Row(y, z);
      for (int x = 0; x < edge; ++x, ++voxel) {
        bool stays = std::all_of(looks.begin(), looks.end(), [&](const View& view) {
          const VoxelCube::Pixels& pixels = view.touched[voxel];
          return pixels.x1 == 0 || shows(view.foreground, pixels);
        });
        if (stays && out == RobotOut::kHull) {
          bool seen = false;
          bool obstacle = false;
          for (const View& view : looks) {
            const VoxelCube::Pixels& pixels = view.touched[voxel];
            seen = seen || pixels.x1 != 0;
            obstacle = obstacle || shows(view.obstacle, pixels);
          }
          stays = obstacle || !seen;
        }
        if (stays) row[x / 64] |= uint64_t{1} << (x % 64);
      }
    }
  }
}

void VoxelHull::TakeAway(const Sphere& sphere) {
  const double voxel = cube_.voxel();
  const auto along = [&](int axis) {
    return VoxelsWithin(sphere.centre[axis] - sphere.radius, sphere.centre[axis] + sphere.radius,
                        cube_.half_width(), voxel, cube_.edge());
  };
  // Of the voxel's farther side from the centre, squared.
  const auto far = [&](int axis, int i) {
    const double low = i * voxel - cube_.half_width() - sphere.centre[axis];
    return std::max(low * low, (low + voxel) * (low + voxel));
  };
  const Span zs = along(2);
  const Span ys = along(1);
  const Span xs = along(0);
  for (int z = zs.from; z <= zs.to; ++z) {
    for (int y = ys.from; y <= ys.to; ++y) {
      const double rest = sphere.radius * sphere.radius - far(2, z) - far(1, y);
      uint64_t* const row = Row(y, z);
      for (int x = xs.from; x <= xs.to; ++x) {
        if (far(0, x) <= rest) row[x / 64] &= ~(uint64_t{1} << (x % 64));
      }
    }
  }
}

void VoxelHull::Summarise() {
  const auto edge = static_cast<size_t>(cube_.edge());
  rows_.assign(row_words_ * edge, 0);
  columns_.assign(row_words_ * edge, 0);
  for (size_t z = 0; z < edge; ++z) {
    for (size_t y = 0; y < edge; ++y) {
      const uint64_t* const row = Row(static_cast<int>(y), static_cast<int>(z));
      uint64_t any = 0;
      for (size_t word = 0; word < row_words_; ++word) {
        any |= row[word];
        columns_[z * row_words_ + word] |= row[word];
      }
      if (any != 0) rows_[z * row_words_ + y / 64] |= uint64_t{1} << (y % 64);
    }
  }
}

bool VoxelHull::Touches(std::span<const Sphere> spheres) const {
  return std::any_of(spheres.begin(), spheres.end(),
                     [this](const Sphere& sphere) { return Touches(sphere); });
}

bool VoxelHull::Touches(const Sphere& sphere) const {
  const double voxel = cube_.voxel();
  const double half = cube_.half_width();
  const Vector3d& c = sphere.centre;
  const double r = sphere.radius;
  const auto within = [&](double centre, double reach) {
    return VoxelsWithin(centre - reach, centre + reach, half, voxel, cube_.edge());
  };
  const auto near = [&](double centre, int i) {
    const double low = i * voxel - half - centre;
    return std::max({0.0, low, -(low + voxel)});
  };
  const Span xs = within(c.x(), r);
  const Span ys = within(c.y(), r);
  const Span zs = within(c.z(), r);
  for (int z = zs.from; z <= zs.to; ++z) {
    const auto slice = static_cast<size_t>(z) * row_words_;
    if (!VoxelHullAnyIn(&columns_[slice], xs.from, xs.to)) continue;
    const double dz = near(c.z(), z);
    for (int y = ys.from; y <= ys.to; ++y) {
      if ((rows_[slice + static_cast<size_t>(y) / 64] >> (y % 64) & 1) == 0) continue;
      const double dy = near(c.y(), y);
      const double rest = r * r - dz * dz - dy * dy;
      if (rest < 0) continue;
      const Span met = within(c.x(), std::sqrt(rest));
      if (VoxelHullAnyIn(Row(y, z), met.from, met.to)) return true;
    }
  }
  return false;
}

ConfigurationSet Touching(const VoxelHull& hull, const ArmTable& arms) {
  return arms.Where([&](size_t index) { return hull.Touches(arms.At(index)); });
}

}  // namespace silhouette::paper
