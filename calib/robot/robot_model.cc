// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/robot_model.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/robot/drawing/kinematic_chain.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

struct TessellateShape {
  TriangleMesh operator()(const BoxShape& box) const { return BoxMesh(box.size); }
  TriangleMesh operator()(const CylinderShape& cylinder) const {
    return CylinderMesh(cylinder.radius, cylinder.length);
  }
  TriangleMesh operator()(const SphereShape& sphere) const { return SphereMesh(sphere.radius); }
  TriangleMesh operator()(const MeshShape& mesh) const { return *mesh.mesh; }
};

std::string NamesOf(const std::vector<RobotJoint>& joints) {
  return absl::StrJoin(joints, ", ", [](std::string* out, const RobotJoint& joint) {
    absl::StrAppend(out, "'", joint.name, "'");
  });
}

}  // namespace

TriangleMesh Tessellate(const Shape& shape) { return std::visit(TessellateShape(), shape); }

std::optional<size_t> RobotModel::JointIndex(const std::string& name) const {
  for (size_t i = 0; i < joints_.size(); ++i) {
    if (joints_[i].name == name) return i;
  }
  return std::nullopt;
}

absl::Status RobotModel::NoJoint(const std::string& name) const {
  const auto mimicking = followed_.find(name);
  if (mimicking != followed_.end()) {
    return InvalidArgument("the joint '", name, "' of the robot '", name_, "' follows '",
                           mimicking->second,
                           "' (mimic) and has no value of its own; leave it out");
  }
  return InvalidArgument("the robot '", name_, "' has no joint '", name, "'; it has ",
                         NamesOf(joints_));
}

std::vector<bool> RobotModel::Outermost() const {
  std::vector<bool> outermost(links_.size(), true);
  std::vector<bool> moves(links_.size(), false);
  for (size_t i = 0; i < links_.size(); ++i) {
    moves[i] = links_[i].joint >= 0;
    if (links_[i].parent < 0) continue;
    const auto parent = static_cast<size_t>(links_[i].parent);
    moves[i] = moves[i] || moves[parent];
    outermost[parent] = false;
  }
  for (size_t i = 0; i < links_.size(); ++i) outermost[i] = outermost[i] && moves[i];
  return outermost;
}

RobotModel RobotModel::WithBody(size_t link, LinkGeometry body) const {
  RobotModel model = *this;
  RobotLink& of = model.links_.at(link);
  (of.visual.empty() && !of.collision.empty() ? of.collision : of.visual)
      .push_back(std::move(body));
  return model;
}

std::vector<Eigen::Isometry3d> RobotModel::LinkPoses(std::span<const double> positions) const {
  if (positions.size() != joints_.size()) {
    throw std::invalid_argument(
        absl::StrCat("the robot has ", joints_.size(), " joints, not ", positions.size()));
  }
  std::vector<Eigen::Isometry3d> base_from_link;
  chain_.Pose(positions, base_from_link);
  return base_from_link;
}

absl::StatusOr<KinematicChain> RobotModel::ChainOf(std::span<const std::string> moving,
                                                   std::span<const FixedJoint> fixed) const {
  std::vector<ChainJoint> joints;
  std::vector<std::optional<int>> place(joints_.size());  // in `joints`
  std::vector<std::optional<double>> stands(joints_.size());
  for (const std::string& name : moving) {
    const std::optional<size_t> index = JointIndex(name);
    if (!index) return NoJoint(name);
    const RobotJoint& joint = joints_[*index];
    place[*index] = static_cast<int>(joints.size());
    joints.push_back({joint.name, joint.lower, joint.upper, joint.type == JointType::kContinuous});
  }
  for (const FixedJoint& joint : fixed) {
    const std::optional<size_t> index = JointIndex(joint.name);
    if (!index) return NoJoint(joint.name);
    stands[*index] = joint.position;
  }
  std::vector<ChainLink> links;
  for (const RobotLink& link : links_) {
    ChainLink& of_chain = links.emplace_back(static_cast<const ChainLink&>(link));
    if (link.joint < 0) continue;
    const auto index = static_cast<size_t>(link.joint);
    if (place[index]) {
      of_chain.joint = *place[index];
    } else if (stands[index]) {
      of_chain = {.parent = link.parent, .parent_from_link = ParentFromLink(link, *stands[index])};
    } else {
      return InvalidArgument("joint '", joints_[index].name, "' of the robot '", name_,
                             "' neither moves nor is fixed");
    }
  }
  return KinematicChain(std::move(joints), std::move(links));
}

absl::StatusOr<std::vector<double>> RobotModel::Positions(std::span<const std::string> names,
                                                          std::span<const double> values) const {
  if (names.size() != values.size()) throw std::invalid_argument("as many names as values");
  std::vector<std::optional<double>> positions(joints_.size());
  for (size_t i = 0; i < names.size(); ++i) {
    const std::optional<size_t> index = JointIndex(names[i]);
    if (!index) return NoJoint(names[i]);
    const RobotJoint& joint = joints_[*index];
    if (positions[*index]) {
      return InvalidArgument("joint '", names[i], "' is given twice");
    }
    const bool inside =
        values[i] >= joint.lower - kLimitTolerance && values[i] <= joint.upper + kLimitTolerance;
    if (!std::isfinite(values[i]) || (joint.type != JointType::kContinuous && !inside)) {
      return InvalidArgument("joint '", joint.name, "' cannot stand at ", values[i],
                             "; it moves from ", joint.lower, " to ", joint.upper);
    }
    positions[*index] = values[i];
  }
  std::vector<double> result;
  for (size_t i = 0; i < joints_.size(); ++i) {
    if (!positions[i]) {
      return InvalidArgument("joint '", joints_[i].name, "' of the robot '", name_,
                             "' has no position");
    }
    result.push_back(*positions[i]);
  }
  return result;
}

}  // namespace silhouette
