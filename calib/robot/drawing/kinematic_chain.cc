// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/kinematic_chain.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "db/mask/wider_vectors.h"

namespace silhouette {
namespace {

using Four [[gnu::vector_size(32)]] = double;
using Bits [[gnu::vector_size(32)]] = int64_t;

constexpr double kMostTurned = 1e6;

bool IsFinite(const ChainLink& link) {
  return link.parent_from_link.matrix().allFinite() && link.axis.allFinite() &&
         std::isfinite(link.factor) && std::isfinite(link.offset);
}

}  // namespace

// sin and 1 - cos of four angles within kMostTurned, to a unit or two of the last place. Reduced by
// quarter turns as by Cody and Waite; polynomials and constants: fdlibm, k_sin.c and k_cos.c.
[[gnu::always_inline]] static inline void TurnsOf(const double* angles, double* sines,
                                                  double* versines) {
  constexpr double kRound = 0x1.8p52;  // what is added to it is rounded to whole numbers
  Four x;
  std::memcpy(&x, angles, sizeof x);
  const Four shifted = x * (2 / std::numbers::pi) + kRound;
  Bits quarters;
  std::memcpy(&quarters, &shifted, sizeof quarters);
  const Four whole = shifted - kRound;
  const Four r = ((x - whole * 1.57079632673412561417e+00) - whole * 6.07710050630396597660e-11) -
                 whole * 2.02226624879595063154e-21;
  const Four z = r * r;
  const Four sine =
      r + r * z *
              (-1.66666666666666324348e-01 +
               z * (8.33333333332248946124e-03 +
                    z * (-1.98412698298579493134e-04 +
                         z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 +
                                                                z * 1.58969099521155010221e-10)))));
  const Four versine =
      0.5 * z -
      z * z *
          (4.16666666666666019037e-02 +
           z * (-1.38888888888741095749e-03 +
                z * (2.48015872894767294178e-05 +
                     z * (-2.75573143513906633035e-07 +
                          z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
  const Four cosine = 1 - versine;
  const Bits odd = (quarters & 1) != 0;
  const Bits sine_falls = (quarters & 2) != 0;
  const Bits cosine_falls = ((quarters + 1) & 2) != 0;
  const Four of_sine = odd ? cosine : sine;
  const Four of_cosine = odd ? sine : cosine;
  const Four turned = sine_falls ? -of_sine : of_sine;
  const Four most = 1 - (cosine_falls ? -of_cosine : of_cosine);
  const Four rest = (quarters & 3) == 0 ? versine : most;
  std::memcpy(sines, &turned, sizeof turned);
  std::memcpy(versines, &rest, sizeof rest);
}

// Matrices by columns. to = parent * (fixed + a * first + b * second)
[[gnu::always_inline]] static inline void MoveLink(const double* parent, const double* fixed,
                                                   const double* first, double a,
                                                   const double* second, double b, double* to) {
  // Each by itself, into a register.
  Four x, y, z, origin;
  std::memcpy(&x, parent, sizeof x);
  std::memcpy(&y, parent + 4, sizeof y);
  std::memcpy(&z, parent + 8, sizeof z);
  std::memcpy(&origin, parent + 12, sizeof origin);
#pragma GCC unroll 4
  for (size_t at = 0; at < 16; at += 4) {
    Four here, along, beyond;
    std::memcpy(&here, fixed + at, sizeof here);
    std::memcpy(&along, first + at, sizeof along);
    std::memcpy(&beyond, second + at, sizeof beyond);
    here += a * along + b * beyond;
    const Four moved = here[0] * x + here[1] * y + here[2] * z + here[3] * origin;
    std::memcpy(to + at, &moved, sizeof moved);
  }
}

Eigen::Isometry3d ParentFromLink(const ChainLink& link, double value) {
  const double moved = link.factor * value + link.offset;
  if (link.slides) return link.parent_from_link * Eigen::Translation3d(moved * link.axis);
  return link.parent_from_link * Eigen::AngleAxisd(moved, link.axis);
}

KinematicChain::KinematicChain(std::vector<ChainJoint> joints, std::vector<ChainLink> links)
    : joints_(std::move(joints)), links_(std::move(links)) {
  for (const ChainJoint& joint : joints_) {
    if (!std::isfinite(joint.lower) || !std::isfinite(joint.upper) || joint.lower > joint.upper) {
      throw std::invalid_argument("joint '" + joint.name + "' has limits that cannot be");
    }
  }
  moves_.resize(links_.size());
  for (size_t i = 0; i < links_.size(); ++i) {
    const ChainLink& link = links_[i];
    const bool placed = i == 0 ? link.parent == -1 && link.joint == -1
                               : link.parent >= 0 && link.parent < static_cast<int>(i);
    if (!placed || link.joint < -1 || link.joint >= static_cast<int>(joints_.size()) ||
        !IsFinite(link)) {
      throw std::invalid_argument("a link of the robot hangs on nothing");
    }
    if (link.joint < 0) continue;
    const ChainJoint& joint = joints_[static_cast<size_t>(link.joint)];
    if (!(std::abs(link.axis.norm() - 1) < 1e-6)) {
      throw std::invalid_argument("the axis of joint '" + joint.name + "' is not of unit length");
    }
    if (link.slides && joint.continuous) {
      throw std::invalid_argument("joint '" + joint.name + "' cannot slide without end");
    }
    if (link.slides) {
      moves_[i].first.col(3).head<3>() = link.parent_from_link.linear() * link.axis;
      continue;
    }
    Eigen::Matrix3d cross;
    cross << 0, -link.axis.z(), link.axis.y(), link.axis.z(), 0, -link.axis.x(), -link.axis.y(),
        link.axis.x(), 0;
    const Eigen::Matrix3d sine = link.parent_from_link.linear() * cross;
    moves_[i].first.topLeftCorner<3, 3>() = sine;
    moves_[i].second.topLeftCorner<3, 3>() = sine * cross;
  }
}

bool KinematicChain::Contains(std::span<const double> q) const {
  if (q.size() != joints_.size()) return false;
  for (size_t j = 0; j < q.size(); ++j) {
    if (!(std::abs(q[j]) <= kMostTurned)) return false;
    if (joints_[j].continuous) continue;
    if (q[j] < joints_[j].lower - kLimitTolerance) return false;
    if (q[j] > joints_[j].upper + kLimitTolerance) return false;
  }
  return true;
}

void KinematicChain::Pose(std::span<const double> q,
                          std::vector<Eigen::Isometry3d>& base_from_link) const {
  if (q.size() != joints_.size()) throw std::invalid_argument("not a value for each joint");
  base_from_link.resize(links_.size());
  Follow(q, base_from_link);
}

SILHOUETTE_WIDER_VECTORS void KinematicChain::Follow(
    std::span<const double> q, std::span<Eigen::Isometry3d> base_from_link) const {
  constexpr size_t kLanes = 4;
  double moved[kLanes];
  double first[kLanes];
  double second[kLanes];
  for (size_t i = 0; i < links_.size(); ++i) {
    const size_t lane = i % kLanes;
    if (lane == 0) {
      for (size_t k = 0; k < kLanes; ++k) moved[k] = MovedBy(q, i + k);
      TurnsOf(moved, first, second);
    }
    const ChainLink& link = links_[i];
    if (link.parent < 0) {
      base_from_link[i] = link.parent_from_link;
      continue;
    }
    if (link.slides) {
      first[lane] = moved[lane];
      second[lane] = 0;
    } else if (!(std::abs(moved[lane]) <= kMostTurned)) {
      first[lane] = std::sin(moved[lane]);
      second[lane] = 1 - std::cos(moved[lane]);
    }
    MoveLink(base_from_link[static_cast<size_t>(link.parent)].data(), link.parent_from_link.data(),
             moves_[i].first.data(), first[lane], moves_[i].second.data(), second[lane],
             base_from_link[i].data());
  }
}

double KinematicChain::MovedBy(std::span<const double> q, size_t link) const {
  if (link >= links_.size() || links_[link].joint < 0) return 0;
  return links_[link].factor * q[static_cast<size_t>(links_[link].joint)] + links_[link].offset;
}

double KinematicChain::LeverOf(size_t joint, size_t link, double radius) const {
  double lever = 0;
  // How far the point is at most from the origin of the link `at`, from the tip to the base.
  double distance = radius;
  for (int at = static_cast<int>(link); at > 0;) {
    const ChainLink& here = links_[static_cast<size_t>(at)];
    if (here.joint == static_cast<int>(joint)) {
      lever += std::abs(here.factor) * (here.slides ? 1 : distance);
    }
    distance += here.parent_from_link.translation().norm();
    if (here.slides && here.joint >= 0) {
      const ChainJoint& slide = joints_[static_cast<size_t>(here.joint)];
      const double most = std::max(std::abs(slide.lower), std::abs(slide.upper));
      distance += std::abs(here.factor) * most + std::abs(here.offset);
    }
    at = here.parent;
  }
  return lever;
}

}  // namespace silhouette
