// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/kinematic_chain.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

constexpr double kMostTurned = 1e6;

bool IsFinite(const ChainLink& link) {
  return link.parent_from_link.matrix().allFinite() && link.axis.allFinite() &&
         std::isfinite(link.factor) && std::isfinite(link.offset);
}

// a * b. Eigen's own is not inlined, and takes longer.
Eigen::Isometry3d Product(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  Eigen::Isometry3d product;
  const Eigen::Matrix4d& from = a.matrix();
  for (int column = 0; column < 4; ++column) {
    product.matrix().col(column) = from.col(0) * b(0, column) + from.col(1) * b(1, column) +
                                   from.col(2) * b(2, column) + from.col(3) * b(3, column);
  }
  return product;
}

}  // namespace

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
  turns_.resize(links_.size());
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
    Eigen::Matrix3d cross;
    cross << 0, -link.axis.z(), link.axis.y(), link.axis.z(), 0, -link.axis.x(), -link.axis.y(),
        link.axis.x(), 0;
    turns_[i].sine = link.parent_from_link.linear() * cross;
    turns_[i].versine = turns_[i].sine * cross;
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
    Eigen::Isometry3d parent_from_link = link.parent_from_link;
    if (link.joint >= 0) {
      const double moved = link.factor * q[static_cast<size_t>(link.joint)] + link.offset;
      if (link.slides) {
        parent_from_link.translation() += moved * (link.parent_from_link.linear() * link.axis);
      } else {
        parent_from_link.linear() +=
            std::sin(moved) * turns_[i].sine + (1 - std::cos(moved)) * turns_[i].versine;
      }
    }
    base_from_link[i] = Product(base_from_link[static_cast<size_t>(link.parent)], parent_from_link);
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
