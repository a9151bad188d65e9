// SPDX-License-Identifier: Apache-2.0
// RobotModel: a robot as a URDF file describes it - the joints that move, the links' geometry, and
// where the links are for given joint values.
//
// Frames: `base` is the root link's frame; a pose `a_from_b` takes points in b to points in a.
// Lengths in metres, angles in radians. A model cannot be changed once made and can be read by any
// number of threads.
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/robot/drawing/kinematic_chain.h"
#include "calib/robot/triangle_mesh.h"

namespace silhouette {

// A joint that stands still, and where.
struct FixedJoint {
  std::string name;
  double position = 0;  // radians; prismatic: metres
};

enum class JointType { kRevolute, kContinuous, kPrismatic };

// A joint that moves.
struct RobotJoint {
  std::string name;
  JointType type = JointType::kRevolute;
  // Between them the joints that mimic it are within their limits, too. A continuous one: -pi, pi.
  double lower = 0;
  double upper = 0;
};

struct BoxShape {
  Eigen::Vector3d size = Eigen::Vector3d::Zero();  // edge lengths
};
struct CylinderShape {  // about z
  double radius = 0;
  double length = 0;
};
struct SphereShape {
  double radius = 0;
};
struct MeshShape {
  std::string path;
  std::shared_ptr<const TriangleMesh> mesh;  // scaled
};
using Shape = std::variant<BoxShape, CylinderShape, SphereShape, MeshShape>;

// The triangles of a shape in its own frame.
TriangleMesh Tessellate(const Shape& shape);

struct LinkGeometry {
  Shape shape;
  Eigen::Isometry3d link_from_shape = Eigen::Isometry3d::Identity();
  std::optional<Eigen::Vector3d> colour;  // red, green, blue, 0..1, if the file states it
};

enum class BodyGeometry { kVisual, kCollision };

// A link as it hangs on its parent by the joints of RobotModel::joints(), and what it looks like. A
// link behind a joint that mimics another is moved by that other one, with ChainLink's factor and
// offset.
struct RobotLink : ChainLink {
  std::string name;
  std::vector<LinkGeometry> visual;
  std::vector<LinkGeometry> collision;

  // What stands for the link; one without geometry of this kind takes the other. The visual one is
  // what the robot looks like and is.
  const std::vector<LinkGeometry>& body(BodyGeometry kind = BodyGeometry::kVisual) const {
    const bool takes_visual = kind == BodyGeometry::kVisual ? !visual.empty() : collision.empty();
    return takes_visual ? visual : collision;
  }
};

class RobotModel {
 public:
  // Reads a URDF file and its meshes (MeshPath). NotFound: the file, a package or a mesh is not
  // there. InvalidArgument: it is not URDF but xacro, say, or has a joint that floats, is planar,
  // has no valid limits or mimics what it cannot. The message names what is meant and what would
  // mend it.
  static absl::StatusOr<RobotModel> FromUrdf(const std::string& path,
                                             std::span<const std::string> package_paths = {});

  const std::string& name() const { return name_; }

  // Joints that move by themselves, from the base outward: the order of all joint values. Those
  // that mimic another are not among them.
  const std::vector<RobotJoint>& joints() const { return joints_; }
  // Index in joints(); nothing if there is none of that name.
  std::optional<size_t> JointIndex(const std::string& name) const;

  // InvalidArgument: that no joint of this name moves by itself, which joint it follows if it
  // mimics one, and which joints there are.
  absl::Status NoJoint(const std::string& name) const;

  // Every link stands after its parent; the first is the base.
  const std::vector<RobotLink>& links() const { return links_; }
  // By link, whether a joint moves it and no link hangs on it: there tool and payload are.
  std::vector<bool> Outermost() const;

  // The same robot with one more body on a link, by its index in links().
  RobotModel WithBody(size_t link, LinkGeometry body) const;

  // `base_from_link` of every link, in the order of links(). `positions`: one value per joint, in
  // the order of joints(); limits are not looked at. Throws std::invalid_argument if there are more
  // or fewer values.
  std::vector<Eigen::Isometry3d> LinkPoses(std::span<const double> positions) const;

  // The chain that moves with the joints `moving`, in their order, while the others stand at
  // `fixed`; its links are in the order of links(). InvalidArgument if a name is not a joint of the
  // model, or a joint of the model is in neither.
  absl::StatusOr<KinematicChain> ChainOf(std::span<const std::string> moving,
                                         std::span<const FixedJoint> fixed) const;

  // Values in the order of joints(), looked up by name. InvalidArgument if a joint of the model has
  // no value, a name is not a joint of the model (NoJoint) or stands twice, or a value is beyond
  // the joint's limits by more than a millionth. As many values as names, else
  // std::invalid_argument is thrown.
  absl::StatusOr<std::vector<double>> Positions(std::span<const std::string> names,
                                                std::span<const double> values) const;

 private:
  friend class UrdfReader;
  RobotModel() = default;

  std::string name_;
  std::vector<RobotJoint> joints_;
  std::map<std::string, std::string> followed_;  // by joint that mimics another: which it follows
  std::vector<RobotLink> links_;
  KinematicChain chain_{{}, {}};  // of all joints
};

}  // namespace silhouette
