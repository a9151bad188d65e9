// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/projection.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "calib/robot/drawing/lens_window.h"
#include "db/mask/wider_vectors.h"

namespace silhouette {
namespace {

using Four [[gnu::vector_size(32)]] = double;

}  // namespace

static inline double Least(const Four& v) {
  return std::min(std::min(v[0], v[1]), std::min(v[2], v[3]));
}

static inline double Most(const Four& v) {
  return std::max(std::max(v[0], v[1]), std::max(v[2], v[3]));
}

// An octagon that grows, four points at a time.
struct GrowingOctagon {
  Four low[4];
  Four high[4];

  [[gnu::always_inline]] inline GrowingOctagon() {
    const Four infinity = Four{} + std::numeric_limits<double>::infinity();
    for (Four& least : low) least = infinity;
    for (Four& most : high) most = -infinity;
  }

  [[gnu::always_inline]] inline void Add(const Four& x, const Four& y) {
    const Four along[4] = {x, y, x + y, x - y};
#pragma GCC unroll 4
    for (size_t i = 0; i < 4; ++i) {
      low[i] = along[i] < low[i] ? along[i] : low[i];
      high[i] = along[i] > high[i] ? along[i] : high[i];
    }
  }

  [[gnu::always_inline]] inline Octagon All() const {
    Octagon found;
#pragma GCC unroll 4
    for (size_t i = 0; i < 4; ++i) {
      found.low[i] = Least(low[i]);
      found.high[i] = Most(high[i]);
    }
    return found;
  }
};

// Stores x and y of the first `lanes` in turn.
static inline void StorePairs(const Four& x, const Four& y, size_t lanes, double* to) {
  if (lanes == 4) {
    const Four first = __builtin_shufflevector(x, y, 0, 4, 1, 5);
    const Four second = __builtin_shufflevector(x, y, 2, 6, 3, 7);
    std::memcpy(to, &first, sizeof first);
    std::memcpy(to + 4, &second, sizeof second);
    return;
  }
  for (size_t i = 0; i < lanes; ++i) {
    to[2 * i] = x[i];
    to[2 * i + 1] = y[i];
  }
}

// `turn`, row by row, and `move` take `from`, at least one point, into the camera's frame.
// `projected`: of each point, at z = 1.
SILHOUETTE_WIDER_VECTORS static ProjectedExtent ProjectPoints(const double* turn,
                                                              const double* move,
                                                              const double* from, size_t count,
                                                              double* projected) {
  const Four zero = {};
  const Four infinity = zero + std::numeric_limits<double>::infinity();
  Four sum = zero;
  Four nearest = infinity;
  Four farthest = -infinity;
  GrowingOctagon octagon;
  Four off_axis = zero;
  for (size_t begin = 0; begin < count; begin += 4) {
    const size_t lanes = std::min<size_t>(4, count - begin);
    const double* at = from + 3 * begin;
    Four of[3];
#pragma GCC unroll 3
    for (size_t i = 0; i < 3; ++i) {
      // The last one again, up to a whole vector.
      of[i] = lanes == 4 ? Four{at[i], at[i + 3], at[i + 6], at[i + 9]}
                         : Four{at[i], at[3 * (lanes / 2) + i], at[3 * (lanes - 1) + i],
                                at[3 * (lanes - 1) + i]};
    }
    Four to[3];
#pragma GCC unroll 3
    for (size_t i = 0; i < 3; ++i) {
      to[i] = turn[3 * i] * of[0] + turn[3 * i + 1] * of[1] + turn[3 * i + 2] * of[2] + move[i];
      sum += to[i] < 0 ? -to[i] : to[i];
    }
    const Four inverse = 1 / to[2];
    const Four x = to[0] * inverse;
    const Four y = to[1] * inverse;
    const Four square = x * x + y * y;
    off_axis = off_axis > square ? off_axis : square;
    nearest = to[2] < nearest ? to[2] : nearest;
    farthest = to[2] > farthest ? to[2] : farthest;
    octagon.Add(x, y);
    StorePairs(x, y, lanes, projected + 2 * begin);
  }
  return {.sum = sum[0] + sum[1] + sum[2] + sum[3],
          .nearest = Least(nearest),
          .farthest = Most(farthest),
          .off_axis = Most(off_axis),
          .octagon = octagon.All()};
}

// Where the image shows points at z = 1, one after the other; `focal`, `centre`: along x and y.
SILHOUETTE_WIDER_VECTORS static Octagon PixelsOf(const double* lens, bool rational,
                                                 const double* focal, const double* centre,
                                                 const double* projected, size_t count,
                                                 double* pixels) {
  GrowingOctagon octagon;
  for (size_t begin = 0; begin < count; begin += 4) {
    const size_t lanes = std::min<size_t>(4, count - begin);
    const double* const at = projected + 2 * begin;
    Four u;
    Four v;
    if (lanes == 4) {
      Four first;
      Four second;
      std::memcpy(&first, at, sizeof first);
      std::memcpy(&second, at + 4, sizeof second);
      u = __builtin_shufflevector(first, second, 0, 2, 4, 6);
      v = __builtin_shufflevector(first, second, 1, 3, 5, 7);
    } else {
      // The last one again, as ProjectPoints has it.
      u = Four{at[0], at[2 * (lanes / 2)], at[2 * (lanes - 1)], at[2 * (lanes - 1)]};
      v = Four{at[1], at[2 * (lanes / 2) + 1], at[2 * lanes - 1], at[2 * lanes - 1]};
    }
    Four bent_u;
    Four bent_v;
    DistortLanes(lens, rational, u, v, bent_u, bent_v);
    const Four x = focal[0] * bent_u + centre[0];
    const Four y = focal[1] * bent_v + centre[1];
    octagon.Add(x, y);
    StorePairs(x, y, lanes, pixels + 2 * begin);
  }
  return octagon.All();
}

ProjectedExtent Project(const Eigen::Isometry3d& camera_from_points,
                        const Eigen::Ref<const Eigen::Matrix3Xd>& points,
                        std::vector<Eigen::Vector2d>& projected) {
  double turn[9];
  double move[3];
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      turn[3 * row + column] = camera_from_points(row, column);
    }
    move[row] = camera_from_points(row, 3);
  }
  projected.resize(static_cast<size_t>(points.cols()));
  return ProjectPoints(turn, move, points.data(), projected.size(), projected.data()->data());
}

Octagon PixelsAt(const CameraIntrinsics& in, const std::vector<Eigen::Vector2d>& projected,
                 std::vector<Eigen::Vector2d>& pixels) {
  const double focal[2] = {in.fx, in.fy};
  const double centre[2] = {in.cx, in.cy};
  const auto& lens = in.distortion;
  const bool rational = lens[5] != 0 || lens[6] != 0 || lens[7] != 0;
  pixels.resize(projected.size());
  return PixelsOf(lens.data(), rational, focal, centre, projected.data()->data(), projected.size(),
                  pixels.data()->data());
}

}  // namespace silhouette
