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

// Stores x and y of the first `lanes` in turn.
static inline void StorePairs(const Four& x, const Four& y, size_t lanes, double* to) {
  const Four pairs[2] = {__builtin_shufflevector(x, y, 0, 4, 1, 5),
                         __builtin_shufflevector(x, y, 2, 6, 3, 7)};
  if (lanes == 4) {
    std::memcpy(to, pairs, sizeof pairs);
  } else {
    for (size_t i = 0; i < 2 * lanes; ++i) to[i] = pairs[i / 4][i % 4];
  }
}

// `turn`, row by row, and `move` take `from`, at least one point, into the camera's frame.
// `projected`: of each point, at z = 1.
SILHOUETTE_WIDER_VECTORS static Extremes ProjectPoints(const double* turn, const double* move,
                                                       const double* from, size_t count,
                                                       double* projected) {
  const Four zero = {};
  const Four infinity = zero + std::numeric_limits<double>::infinity();
  Four sum = zero;
  Four least[5] = {infinity, infinity, infinity, infinity, infinity};
  Four most[5] = {-infinity, -infinity, -infinity, -infinity, -infinity};
  Four off_axis = zero;
  for (size_t begin = 0; begin < count; begin += 4) {
    const size_t lanes = std::min<size_t>(4, count - begin);
    const double* at = from + 3 * begin;
    Four of[3];
    for (size_t i = 0; i < 3; ++i) {
      // The last one again, up to a whole vector.
      of[i] = lanes == 4 ? Four{at[i], at[i + 3], at[i + 6], at[i + 9]}
                         : Four{at[i], at[3 * (lanes / 2) + i], at[3 * (lanes - 1) + i],
                                at[3 * (lanes - 1) + i]};
    }
    Four to[3];
    for (size_t i = 0; i < 3; ++i) {
      to[i] = turn[3 * i] * of[0] + turn[3 * i + 1] * of[1] + turn[3 * i + 2] * of[2] + move[i];
      sum += to[i] < 0 ? -to[i] : to[i];
    }
    const Four inverse = 1 / to[2];
    const Four x = to[0] * inverse;
    const Four y = to[1] * inverse;
    const Four square = x * x + y * y;
    off_axis = off_axis > square ? off_axis : square;
    const Four along[5] = {x, y, x + y, x - y, to[2]};
    for (int i = 0; i < 5; ++i) {
      least[i] = along[i] < least[i] ? along[i] : least[i];
      most[i] = along[i] > most[i] ? along[i] : most[i];
    }
    StorePairs(x, y, lanes, projected + 2 * begin);
  }
  const auto min = [](const Four& v) { return std::min({v[0], v[1], v[2], v[3]}); };
  const auto max = [](const Four& v) { return std::max({v[0], v[1], v[2], v[3]}); };
  Extremes found{.sum = sum[0] + sum[1] + sum[2] + sum[3],
                 .nearest = min(least[4]),
                 .farthest = max(most[4]),
                 .off_axis = max(off_axis)};
  for (size_t i = 0; i < 4; ++i) {
    found.low[i] = min(least[i]);
    found.high[i] = max(most[i]);
  }
  return found;
}

// Where the image shows points at z = 1, one after the other; `focal`, `centre`: along x and y.
SILHOUETTE_WIDER_VECTORS static void PixelsOf(const double* lens, bool rational,
                                              const double* focal, const double* centre,
                                              const double* projected, size_t count,
                                              double* pixels) {
  for (size_t begin = 0; begin < count; begin += 4) {
    const size_t lanes = std::min<size_t>(4, count - begin);
    Four pairs[2] = {};
    if (lanes == 4) {
      std::memcpy(pairs, projected + 2 * begin, sizeof pairs);
    } else {
      for (size_t i = 0; i < 2 * lanes; ++i) pairs[i / 4][i % 4] = projected[2 * begin + i];
    }
    const Four u = __builtin_shufflevector(pairs[0], pairs[1], 0, 2, 4, 6);
    const Four v = __builtin_shufflevector(pairs[0], pairs[1], 1, 3, 5, 7);
    Four bent_u;
    Four bent_v;
    DistortLanes(lens, rational, u, v, bent_u, bent_v);
    StorePairs(focal[0] * bent_u + centre[0], focal[1] * bent_v + centre[1], lanes,
               pixels + 2 * begin);
  }
}

Extremes Project(const Eigen::Isometry3d& camera_from_points,
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

void PixelsAt(const CameraIntrinsics& in, const std::vector<Eigen::Vector2d>& projected,
              std::vector<Eigen::Vector2d>& pixels) {
  const double focal[2] = {in.fx, in.fy};
  const double centre[2] = {in.cx, in.cy};
  const auto& lens = in.distortion;
  const bool rational = lens[5] != 0 || lens[6] != 0 || lens[7] != 0;
  pixels.resize(projected.size());
  PixelsOf(lens.data(), rational, focal, centre, projected.data()->data(), projected.size(),
           pixels.data()->data());
}

}  // namespace silhouette
