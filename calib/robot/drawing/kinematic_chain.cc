// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/kinematic_chain.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "db/mask/wider_vectors.h"

namespace silhouette {
namespace {

using Four [[gnu::vector_size(32)]] = double;

constexpr double kMostTurned = 1e6;

bool IsFinite(const ChainLink& link) {
  return link.parent_from_link.matrix().allFinite() && link.axis.allFinite() &&
         std::isfinite(link.factor) && std::isfinite(link.offset);
}

}  // namespace

// Matrices by columns. to = parent * (fixed + a * first + b * second)
SILHOUETTE_WIDER_VECTORS static void MoveLink(const double* parent, const double* fixed,
                                              const double* first, double a, const double* second,
                                              double b, double* to) {
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
  for (size_t i = 0; i < links_.size(); ++i) {
    const ChainLink& link = links_[i];
    if (link.parent < 0) {
      base_from_link[i] = link.parent_from_link;
      continue;
    }
    double first = 0;
    double second = 0;
    if (link.joint >= 0) {
      const double moved = link.factor * q[static_cast<size_t>(link.joint)] + link.offset;
      first = link.slides ? moved : std::sin(moved);
      second = link.slides ? 0 : 1 - std::cos(moved);
    }
    MoveLink(base_from_link[static_cast<size_t>(link.parent)].data(), link.parent_from_link.data(),
             moves_[i].first.data(), first, moves_[i].second.data(), second,
             base_from_link[i].data());
  }
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
