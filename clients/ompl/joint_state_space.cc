// SPDX-License-Identifier: Apache-2.0
#include <ompl/base/ProjectionEvaluator.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/base/spaces/SO2StateSpace.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "silhouette/ompl.h"

namespace silhouette::client {
namespace {

namespace ob = ompl::base;

// On the joints that move most of the robot: the first ones.
class FirstJoints : public ob::ProjectionEvaluator {
 public:
  FirstJoints(const JointStateSpace* space, std::span<const GridJoint> joints)
      : ob::ProjectionEvaluator(space), space_(*space), all_(joints.size()) {
    for (size_t j = 0; j < std::min<size_t>(joints.size(), 3); ++j) {
      cellSizes_.push_back(std::max((joints[j].upper - joints[j].lower) / 20, 1e-9));
    }
  }

  unsigned int getDimension() const override {
    return static_cast<unsigned int>(cellSizes_.size());
  }
  void project(const ob::State* state, Eigen::Ref<Eigen::VectorXd> projection) const override {
    std::array<double, kMaxJoints> q;
    space_.GetValues(state, std::span(q).first(all_));
    for (size_t j = 0; j < cellSizes_.size(); ++j) projection(static_cast<Eigen::Index>(j)) = q[j];
  }

 private:
  const JointStateSpace& space_;
  size_t all_;
};

}  // namespace

JointStateSpace::JointStateSpace(std::span<const GridJoint> joints)
    : joints_(joints.begin(), joints.end()) {
  setName("joints");
  for (const GridJoint& joint : joints_) {
    if (joint.continuous) {
      addSubspace(std::make_shared<ob::SO2StateSpace>(), 1);
    } else {
      auto line = std::make_shared<ob::RealVectorStateSpace>(1);
      // A range without length is refused.
      const double above = std::nextafter(joint.lower, std::numeric_limits<double>::infinity());
      line->setBounds(joint.lower, std::max(joint.upper, above));
      addSubspace(line, 1);
    }
  }
  lock();
}

void JointStateSpace::SetState(std::span<const double> q, ob::State* state) const {
  auto* compound = state->as<ob::CompoundState>();
  for (size_t j = 0; j < joints_.size(); ++j) {
    if (joints_[j].continuous) {
      auto* turn = compound->as<ob::SO2StateSpace::StateType>(j);
      turn->value = q[j];
      getSubspace(j)->enforceBounds(turn);
    } else {
      compound->as<ob::RealVectorStateSpace::StateType>(j)->values[0] = q[j];
    }
  }
}

void JointStateSpace::GetValues(const ob::State* state, std::span<double> q) const {
  const auto* compound = state->as<ob::CompoundState>();
  for (size_t j = 0; j < joints_.size(); ++j) {
    q[j] = joints_[j].continuous ? compound->as<ob::SO2StateSpace::StateType>(j)->value
                                 : compound->as<ob::RealVectorStateSpace::StateType>(j)->values[0];
  }
}

void JointStateSpace::GetValuesNear(std::span<const double> from, const ob::State* state,
                                    std::span<double> q) const {
  GetValues(state, q);
  for (size_t j = 0; j < joints_.size(); ++j) {
    if (joints_[j].continuous) {
      q[j] = from[j] + std::remainder(q[j] - from[j], 2 * std::numbers::pi);
    }
  }
}

void JointStateSpace::registerProjections() {
  registerDefaultProjection(std::make_shared<FirstJoints>(this, joints_));
}

}  // namespace silhouette::client
