// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/part_balls.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/drawing/hull_edges.h"
#include "calib/robot/drawing/lens_window.h"
#include "db/mask/wider_vectors.h"

namespace silhouette {
namespace {

using Eigen::Vector3d;
using Lanes = BallNumbers::Lanes;
using IntLanes [[gnu::vector_size(32)]] = int32_t;
using DoubleFour [[gnu::vector_size(32)]] = double;

constexpr auto kThin = static_cast<float>(PartDrawer::kThin);
constexpr IntLanes kBits = {1, 2, 4, 8, 16, 32, 64, 128};
constexpr float kUnknown = 1 << 16;  // PlaneDistances::kUnits, more than any distance
// Single-precision sums of three products are this precise, and some more.
constexpr double kFloat = 1e-6;

float Greatest(const Lanes& v) {
  float greatest = v[0];
  for (size_t lane = 1; lane < BallNumbers::kLanes; ++lane) greatest = std::max(greatest, v[lane]);
  return greatest;
}

// Balls about a part, whose centres are in the hull of its points. A part is cut across its length
// into pieces about as long as it is thick.
struct Cover {
  std::vector<Vector3d> centres;
  double radius = 0;
};

Cover CoverOf(const Eigen::Matrix3Xd& points) {
  constexpr double kMostPieces = 6;
  constexpr double kPiece = 0.7;  // of the thickness: shorter ones hardly make smaller balls
  constexpr double kEnd = 0.05;   // of the length
  const Vector3d mean = points.rowwise().mean();
  const Eigen::Matrix3Xd about = points.colwise() - mean;
  const Eigen::Matrix3d spread = about * about.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
  const Eigen::VectorXd along = (axes.eigenvectors().col(2).transpose() * about).transpose();
  const double low = along.minCoeff();
  const double high = along.maxCoeff();
  // From the middle of one end to that of the other: in the hull.
  Vector3d ends[2] = {Vector3d::Zero(), Vector3d::Zero()};
  double counts[2] = {};
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const bool at_end[2] = {along[i] <= low + kEnd * (high - low),
                            along[i] >= high - kEnd * (high - low)};
    for (int end = 0; end < 2; ++end) {
      if (!at_end[end]) continue;
      ends[end] += points.col(i);
      ++counts[end];
    }
  }
  const Vector3d from = ends[0] / counts[0];
  const Vector3d axis = ends[1] / counts[1] - from;
  const double length = axis.norm();
  if (!(length > 1e-9)) {
    return {{mean}, about.colwise().norm().maxCoeff()};
  }
  const Vector3d unit = axis / length;
  double first = 0;
  double last = length;
  double thick = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Vector3d p = points.col(i) - from;
    const double at = unit.dot(p);
    first = std::min(first, at);
    last = std::max(last, at);
    thick = std::max(thick, (p - at * unit).norm());
  }
  const double pieces =
      std::clamp(std::round((last - first) / (kPiece * 2 * thick + 1e-9)), 1.0, kMostPieces);
  const double half = (last - first) / pieces / 2;
  Cover cover;
  double off = 0;
  for (int piece = 0; piece < pieces; ++piece) {
    const double middle = first + (2 * piece + 1) * half;
    const double at = std::clamp(middle, 0.0, length);
    off = std::max(off, std::abs(middle - at));
    cover.centres.emplace_back(from + at * unit);
  }
  cover.radius = std::hypot(thick, half + off);
  return cover;
}

}  // namespace

PartBalls::PartBalls(std::span<const RobotPart> parts, std::span<const HullEdges> edges) {
  size_t links = 0;
  for (const RobotPart& part : parts) links = std::max(links, part.moves_with + 1);
  for (size_t link = 0; link < links; ++link) {
    for (size_t i = 0; i < parts.size(); ++i) {
      if (parts[i].moves_with != link) continue;
      const Cover cover = CoverOf(parts[i].points);
      for (const Vector3d& centre : cover.centres) {
        const double far = (parts[i].points.colwise() - centre).colwise().norm().maxCoeff();
        Append(i, link, centre, std::min(cover.radius, far), far);
        part_radius_[balls() - 1] = static_cast<float>(parts[i].radius);
        depth_[balls() - 1] = static_cast<float>(edges[i].DepthOf(centre));
      }
    }
    // The last one again, up to whole vectors.
    while (balls() % BallNumbers::kLanes != 0) {
      const size_t last = balls() - 1;
      Append(part_[last], link, {x_[last], y_[last], z_[last]}, balls_.radius[last],
             balls_.far[last]);
      part_radius_[last + 1] = part_radius_[last];
      depth_[last + 1] = depth_[last];
    }
  }
  Group();
}

void PartBalls::Group() {
  constexpr int kSteps = 100;
  const size_t vectors = (link_.size() + BallNumbers::kLanes - 1) / BallNumbers::kLanes;
  groups_.radius.resize(vectors);
  groups_.far.resize(vectors);
  group_radius_.resize(vectors);
  for (size_t i = 0; i < link_.size(); ++i) {
    const size_t first = BallNumbers::kLanes * i;
    const auto centre = [&](size_t ball) { return Vector3d(x_[ball], y_[ball], z_[ball]); };
    // About the least ball: towards the farthest again and again, by less and less (Badoiu and
    // Clarkson 2003).
    Vector3d middle = centre(first);
    for (int step = 2; step < kSteps; ++step) {
      size_t farthest = first;
      double most = 0;
      for (size_t ball = first; ball < first + BallNumbers::kLanes; ++ball) {
        const double reach = (centre(ball) - middle).norm() + double{balls_.radius[ball]};
        if (reach <= most) continue;
        most = reach;
        farthest = ball;
      }
      middle += (centre(farthest) - middle) / step;
    }
    middle = middle.cast<float>().cast<double>();
    middles_.push_back({static_cast<float>(middle.x()), static_cast<float>(middle.y()),
                        static_cast<float>(middle.z())});
    for (size_t ball = first; ball < first + BallNumbers::kLanes; ++ball) {
      const auto away = static_cast<float>(1.000001 * (centre(ball) - middle).norm());
      groups_.radius[i] = std::max(groups_.radius[i], away + balls_.radius[ball]);
      groups_.far[i] = std::max(groups_.far[i], away + balls_.far[ball]);
    }
    group_radius_[i] = Greatest(part_radius_.vector(i));
  }
}

void PartBalls::Append(size_t part, size_t link, const Vector3d& centre, double radius,
                       double far) {
  const size_t ball = balls();
  if (ball % BallNumbers::kLanes == 0) {
    link_.push_back(link);
    for (BallNumbers* numbers :
         {&x_, &y_, &z_, &balls_.radius, &balls_.far, &depth_, &part_radius_}) {
      numbers->resize(link_.size());
    }
  }
  part_.push_back(part);
  x_[ball] = static_cast<float>(centre.x());
  y_[ball] = static_cast<float>(centre.y());
  z_[ball] = static_cast<float>(centre.z());
  balls_.radius[ball] = static_cast<float>(radius);
  balls_.far[ball] = static_cast<float>(far);
  reach_ = std::max(reach_, centre.lpNorm<1>() + far);
}

SILHOUETTE_WIDER_VECTORS void PartBalls::Move(std::span<const Eigen::Isometry3d> base_from_link,
                                              PlacedBalls& placed) const {
  using Four [[gnu::vector_size(16)]] = float;
  float away = 0;
  for (size_t i = 0; i < link_.size(); ++i) {
    const double* const pose = base_from_link[link_[i]].data();  // by columns
    Four columns[4];
#pragma GCC unroll 4
    for (size_t k = 0; k < 4; ++k) {
      DoubleFour column;
      std::memcpy(&column, pose + 4 * k, sizeof column);
      columns[k] = __builtin_convertvector(column, Four);
    }
    const auto& [right, up, out, move] = columns;
    const Lanes& x = x_.vector(i);
    const Lanes& y = y_.vector(i);
    const Lanes& z = z_.vector(i);
    placed.x.vector(i) = right[0] * x + up[0] * y + out[0] * z + move[0];
    placed.y.vector(i) = right[1] * x + up[1] * y + out[1] * z + move[1];
    placed.z.vector(i) = right[2] * x + up[2] * y + out[2] * z + move[2];
    const std::array<float, 3>& middle = middles_[i];
    const Four moved = right * middle[0] + up * middle[1] + out * middle[2] + move;
    placed.groups.x[i] = moved[0];
    placed.groups.y[i] = moved[1];
    placed.groups.z[i] = moved[2];
    away = std::max(away, std::abs(move[0]) + std::abs(move[1]) + std::abs(move[2]));
  }
  placed.slack = static_cast<float>(kFloat * (1.00001 * double{away} + reach_));
}

void PartBalls::Place(std::span<const Eigen::Isometry3d> base_from_link,
                      std::span<const double> growth, PlacedBalls& placed) const {
  // Of the radius of a ball: more makes its part nearly round.
  constexpr double kNearlyRound = 0.5;
  BallPlaces& groups = placed.groups;
  for (BallNumbers* numbers : {&placed.x, &placed.y, &placed.z}) numbers->resize(vectors());
  for (BallNumbers* numbers : {&groups.x, &groups.y, &groups.z}) {
    numbers->resize(groups_.radius.vectors());
  }
  Move(base_from_link, placed);
  placed.growth = part_radius_;
  groups.growth = group_radius_;
  placed.grown.assign(vectors(), 0);
  if (growth.empty()) return;
  for (size_t ball = 0; ball < balls(); ++ball) {
    const double by = growth[part_[ball]];
    placed.growth[ball] += static_cast<float>(by);
    const size_t vector = ball / BallNumbers::kLanes;
    if (by > kNearlyRound * double{balls_.radius[ball]}) {
      placed.grown[vector] |= uint32_t{1} << (ball % BallNumbers::kLanes);
    }
  }
  for (size_t i = 0; i < vectors(); ++i) groups.growth[i] = Greatest(placed.growth.vector(i));
}

BallLook::BallLook(const PartDrawer& view) {
  const PartDrawer::Bounds bounds = view.bounds();
  const CameraModel& camera = view.camera();
  const CameraIntrinsics& in = camera.intrinsics();
  bounded_ = bounds.bounded;
  if (!bounded_) return;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      turn_[3 * row + column] = static_cast<float>(camera.camera_from_world()(row, column));
    }
    move_[row] = static_cast<float>(camera.camera_from_world()(row, 3));
  }
  slack_ = static_cast<float>(kFloat * camera.camera_from_world().translation().lpNorm<1>());
  for (size_t i = 0; i < 8; ++i) lens_[i] = static_cast<float>(in.distortion[i]);
  focal_[0] = static_cast<float>(in.fx);
  focal_[1] = static_cast<float>(in.fy);
  centre_[0] = static_cast<float>(in.cx);
  centre_[1] = static_cast<float>(in.cy);
  for (int axis = 0; axis < 2; ++axis) {
    low_[axis] = static_cast<float>(bounds.box.min()[axis]);
    high_[axis] = static_cast<float>(bounds.box.max()[axis]);
  }
  circle_ = static_cast<float>(bounds.circle);
  stretch_ = static_cast<float>(bounds.stretch);
  shrink_ = static_cast<float>(0.999 * bounds.shrink);
  margin_ = static_cast<float>(view.margin());
  bend_ = static_cast<float>(bounds.bend);
  widened_ = static_cast<float>(bounds.widened);
  rational_ = in.distortion[5] != 0 || in.distortion[6] != 0 || in.distortion[7] != 0;
  width_ = view.size().width;
  height_ = view.size().height;
  // How far single precision is off, on a lattice.
  constexpr int kSteps = 32;
  double off = 0;
  for (int y = 0; y <= kSteps; ++y) {
    for (int x = 0; x <= kSteps; ++x) {
      const Eigen::Vector2d p =
          bounds.box.min() +
          Eigen::Vector2d(x, y).cwiseProduct(bounds.box.sizes()) / static_cast<double>(kSteps);
      if (bounds.circle > 0 && p.norm() > bounds.circle) continue;
      Eigen::Vector2f rough;
      DistortLanes(lens_, rational_, static_cast<float>(p.x()), static_cast<float>(p.y()),
                   rough.x(), rough.y());
      const Eigen::Vector2d exact = Distort(in, p.x(), p.y());
      off = std::max({off, in.fx * std::abs(static_cast<double>(rough.x()) - exact.x()),
                      in.fy * std::abs(static_cast<double>(rough.y()) - exact.y())});
    }
  }
  const double most = bounds.box.min().cwiseAbs().cwiseMax(bounds.box.max().cwiseAbs()).maxCoeff();
  rounding_ = static_cast<float>(4 * off + 4 * kFloat * (1 + most) * std::max(in.fx, in.fy) +
                                 kFloat * (width_ + height_) + 1e-3);
}

struct BallLook::Sight {
  // The ball's centre, a point of the part, is in the square of the nearest pixel for certain.
  IntLanes centred;
  IntLanes distance;  // of that pixel from the plane
  IntLanes depth;     // SeenBalls::depth
  Lanes inverse;      // of z
  Lanes off;          // pixels: of the ball's centre from the pixel's, at most
};

// All bits of all lanes.
static inline uint32_t BitsOf(const IntLanes& of) {
  IntLanes lanes = of;
  lanes |= __builtin_shufflevector(lanes, lanes, 4, 5, 6, 7, 0, 1, 2, 3);
  lanes |= __builtin_shufflevector(lanes, lanes, 2, 3, 0, 1, 6, 7, 4, 5);
  lanes |= __builtin_shufflevector(lanes, lanes, 1, 0, 3, 2, 5, 4, 7, 6);
  return static_cast<uint32_t>(lanes[0]);
}

[[gnu::always_inline]] inline BallLook::Sight BallLook::SeeVector(
    const PartBalls::Extents& extents, const BallPlaces& placed, size_t i, float slack,
    const PlaneDistances& distances) const {
  const Lanes& px = placed.x.vector(i);
  const Lanes& py = placed.y.vector(i);
  const Lanes& pz = placed.z.vector(i);
  const Lanes x = turn_[0] * px + turn_[1] * py + turn_[2] * pz + move_[0];
  const Lanes y = turn_[3] * px + turn_[4] * py + turn_[5] * pz + move_[1];
  const Lanes z = turn_[6] * px + turn_[7] * py + turn_[8] * pz + move_[2];
  const Lanes radius = extents.radius.vector(i) * 1.00001F + slack;
  const Lanes far = extents.far.vector(i) * 1.00001F + slack;
  const Lanes growth = placed.growth.vector(i) * 1.00001F;
  const Lanes none = {};
  const IntLanes behind = z + far + growth < none - 1e-3F;
  // What is near the camera's plane is drawn otherwise.
  const IntLanes ahead = z - far > 2 * growth + 0.011F;

  // At z = 1: a point that is r away from one at o, z is no farther than r sqrt(1 + o^2) / (z -
  // r) from it there. sqrt(1 + o^2) is no more than 1 + o^2 / 2.
  const Lanes inverse = 1 / z;
  const Lanes u = x * inverse;
  const Lanes v = y * inverse;
  const Lanes square = u * u + v * v;
  const Lanes au = u < 0 ? -u : u;
  const Lanes av = v < 0 ? -v : v;
  const Lanes off_axis = (au > av ? au : av) + 0.42F * (au > av ? av : au);
  const Lanes own = radius * (1 / (z - radius)) * (1 + 0.5F * square);
  const Lanes apart = far * (1 / (z - far)) * (1 + 0.5F * square);
  const Lanes outer = off_axis + apart;
  const Lanes wide = 1.036F * growth * (1 / (z - far - growth)) * (1 + 0.5F * outer * outer);
  const Lanes disc = own + wide;
  const Lanes extent = 2 * (apart + wide);
  const Lanes bow = bend_ * 0.125F * extent * extent;
  const Lanes chord = 0.0626F + bow * (1.0F / 4096);
  // An edge's chord is off its image, and its margin as wide along both axes.
  const Lanes sag = 2.5F * (bow < chord ? bow : chord);

  // In the window; what is beyond it is cut off.
  const Lanes cu = u > low_[0] ? (u < high_[0] ? u : none + high_[0]) : none + low_[0];
  const Lanes cv = v > low_[1] ? (v < high_[1] ? v : none + high_[1]) : none + low_[1];
  IntLanes unknown = ~ahead;
  IntLanes hidden = behind;
  if (circle_ > 0) {
    const IntLanes beyond = square > circle_ * circle_ * 0.9999F;
    const IntLanes wholly =
        square > (circle_ * 1.0001F + disc) * (circle_ * 1.0001F + disc) * 1.0001F;
    hidden |= wholly & ahead;
    unknown |= beyond;
  }

  Lanes bent_u;
  Lanes bent_v;
  DistortLanes(lens_, rational_, cu, cv, bent_u, bent_v);
  const Lanes at_x = focal_[0] * bent_u + centre_[0];
  const Lanes at_y = focal_[1] * bent_v + centre_[1];
  const float right = static_cast<float>(width_ - 1);
  const float bottom = static_cast<float>(height_ - 1);
  const Lanes in_x = at_x > 0 ? (at_x < right ? at_x : none + right) : none;
  const Lanes in_y = at_y > 0 ? (at_y < bottom ? at_y : none + bottom) : none;
  const IntLanes column = __builtin_convertvector(in_x + 0.5F, IntLanes);
  const IntLanes row = __builtin_convertvector(in_y + 0.5F, IntLanes);
  const Lanes off_x = at_x - __builtin_convertvector(column, Lanes);
  const Lanes off_y = at_y - __builtin_convertvector(row, Lanes);
  const Lanes ax = off_x < 0 ? -off_x : off_x;
  const Lanes ay = off_y < 0 ? -off_y : off_y;
  const Lanes more = ax > ay ? ax : ay;
  const Lanes less = ax > ay ? ay : ax;
  const Lanes away = more + 0.4143F * less;
  // A margin along both axes reaches farther at corners.
  const Lanes growth_margin = stretch_ * wide;
  const Lanes corner = 0.42F * (growth_margin < kThin ? growth_margin : none + kThin);
  const Lanes reach =
      stretch_ * disc * 1.00001F + (bow + sag) + (1.415F * widened_ + rounding_ + away + corner);
  const Lanes units = reach * static_cast<float>(PlaneDistances::kUnits);
  // Not a number is not less.
  const IntLanes known = ~unknown & (units < kUnknown);
  const Lanes result = hidden ? none - 1 : (known ? units : none + kUnknown);
  const IntLanes most = __builtin_convertvector(result, IntLanes);
  const IntLanes centred =
      ahead & (u == cu) & (v == cv) & (more < 0.5F - rounding_) & ~hidden & ~unknown;
  const IntLanes pixel = row * width_ + column;
  const uint16_t* const by_pixel = distances.units().data();
  IntLanes distance;
#pragma GCC unroll 8
  for (int lane = 0; lane < static_cast<int>(BallNumbers::kLanes); ++lane) {
    distance[lane] = by_pixel[pixel[lane]];
  }
  return {.centred = centred,
          .distance = distance,
          .depth = most - distance,
          .inverse = inverse,
          .off = away};
}

SILHOUETTE_WIDER_VECTORS int BallLook::FindNear(const PartBalls& balls, const PlacedBalls& placed,
                                                const PlaneDistances& distances,
                                                std::span<uint32_t> near) const {
  int found = 0;
  for (size_t i = 0; i < balls.groups(); ++i) {
    const Sight sight =
        SeeVector(balls.groups_, placed.groups, i, placed.slack + slack_, distances);
    const size_t lanes = std::min(BallNumbers::kLanes, balls.vectors() - BallNumbers::kLanes * i);
    near[i] = BitsOf((sight.depth >= 0) & kBits) & ((uint32_t{1} << lanes) - 1);
    found += std::popcount(near[i]);
  }
  return found;
}

SILHOUETTE_WIDER_VECTORS void BallLook::See(const PartBalls& balls, const PlacedBalls& placed,
                                            const PlaneDistances& distances,
                                            SeenBalls& seen) const {
  const size_t i = seen.vector;
  const float slack = placed.slack + slack_;
  const Sight sight = SeeVector(balls.balls_, placed, i, slack, distances);
  // The part holds this about the ball's centre, and the image a disc about that of the centre.
  const Lanes depth = (balls.depth_.vector(i) + placed.growth.vector(i)) * 0.99999F - slack;
  const Lanes disc = depth * sight.inverse * shrink_ + (margin_ - rounding_ - sight.off);
  const Lanes units = disc * static_cast<float>(PlaneDistances::kUnits);
  const IntLanes within =
      __builtin_convertvector((units > 0) & (units < kUnknown) ? units : Lanes{}, IntLanes);
  constexpr int kFar = PlaneDistances::kMost * PlaneDistances::kUnits;
  const IntLanes met =
      (sight.distance == 0) | ((sight.distance < within) & (sight.distance < kFar));
  const uint32_t bits = BitsOf(((sight.depth >= 0) & kBits) | (sight.centred & met & (kBits << 8)));
  seen.near = bits & 0xFF;
  seen.shown = bits >> 8;
  std::memcpy(seen.depth, &sight.depth, sizeof sight.depth);
}

}  // namespace silhouette
