// SPDX-License-Identifier: Apache-2.0
// RobotModel::FromUrdf.
#include <urdf_model/model.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "calib/robot/drawing/kinematic_chain.h"
#include "calib/robot/mesh_path.h"
#include "calib/robot/robot_model.h"
#include "calib/robot/triangle_mesh.h"
#include "calib/robot/urdf_text.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// No link is as long as this, in metres.
constexpr double kMostLength = 100;
// Nor is a mesh as long,
constexpr double kMostMesh = 10;
// nor as short.
constexpr double kLeastMesh = 0.001;
// Nor is a joint moved by as many times the joint that it mimics.
constexpr double kMostMimic = 1000;
constexpr char kMimic[] = "; name a joint that moves by itself, or make it type=\"fixed\"";
constexpr char kTree[] = "; the links must form a tree: leave out a joint of the loop";

// Carries a status out of the depth of a file.
struct UrdfError {
  absl::Status status;
};

Eigen::Vector3d VectorOf(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

Eigen::Isometry3d PoseOf(const urdf::Pose& pose) {
  const urdf::Rotation& r = pose.rotation;
  return Eigen::Translation3d(VectorOf(pose.position)) *
         Eigen::Quaterniond(r.w, r.x, r.y, r.z).normalized();
}

bool MimicsAnother(const urdf::Joint& joint) {
  return joint.mimic != nullptr && joint.type != urdf::Joint::FIXED;
}

}  // namespace

class UrdfReader {
 public:
  UrdfReader(std::string path, std::span<const std::string> package_paths)
      : path_(std::move(path)), package_paths_(package_paths) {}

  RobotModel Read() {
    absl::StatusOr<urdf::ModelInterfaceSharedPtr> parsed = ParseUrdf(path_);
    if (!parsed.ok()) throw UrdfError{parsed.status()};
    urdf_ = *std::move(parsed);
    model_.name_ = urdf_->getName();
    RequireOneJointEach(*urdf_);
    AddLink(*urdf_->getRoot(), -1);
    for (const auto& entry : urdf_->links_) {
      const std::string& name = entry.first;
      if (std::ranges::any_of(model_.links_, [&](const auto& l) { return l.name == name; }))
        continue;
      Fail("link '" + name + "' is part of a loop of joints that does not hang on the base" +
           kTree);
    }
    for (const Mimic& mimic : mimics_) Resolve(mimic);
    model_.chain_ = ChainOfAll();
    return std::move(model_);
  }

 private:
  // A link whose joint mimics another.
  struct Mimic {
    size_t link;
    const urdf::Joint& joint;
  };

  [[noreturn]] void Fail(const std::string& message) const {
    throw UrdfError{InvalidArgument(path_ + ": " + message)};
  }

  // urdfdom reads links that hang on two joints; a loop of them has no end.
  void RequireOneJointEach(const urdf::ModelInterface& urdf) const {
    std::map<std::string, std::string> joints;  // by the link that hangs on it
    for (const auto& [name, joint] : urdf.joints_) {
      const auto [first, is_new] = joints.emplace(joint->child_link_name, name);
      if (is_new) continue;
      Fail("link '" + joint->child_link_name + "' hangs on two joints, '" + first->second +
           "' and '" + name + "', as in a loop" + kTree);
    }
  }

  void AddLink(const urdf::Link& urdf, int parent) {
    RobotLink link;
    link.name = urdf.name;
    link.parent = parent;
    if (parent >= 0) AddJoint(*urdf.parent_joint, link);
    for (const auto& visual : urdf.visual_array) {
      link.visual.push_back(Geometry(urdf.name, *visual));
      if (visual->material != nullptr) {
        const urdf::Color& colour = visual->material->color;
        link.visual.back().colour = Eigen::Vector3d(colour.r, colour.g, colour.b);
      }
    }
    for (const auto& collision : urdf.collision_array) {
      link.collision.push_back(Geometry(urdf.name, *collision));
    }
    model_.links_.push_back(std::move(link));
    const int index = static_cast<int>(model_.links_.size()) - 1;
    for (const auto& child : urdf.child_links) AddLink(*child, index);
  }

  void AddJoint(const urdf::Joint& urdf, RobotLink& link) {
    link.parent_from_link = PoseOf(urdf.parent_to_joint_origin_transform);
    RequireLength("the origin of joint '" + urdf.name + "'",
                  link.parent_from_link.translation().norm());
    if (urdf.type == urdf::Joint::FIXED) return;
    RobotJoint joint;
    joint.name = urdf.name;
    switch (urdf.type) {
      case urdf::Joint::REVOLUTE:
        joint.type = JointType::kRevolute;
        break;
      case urdf::Joint::CONTINUOUS:
        joint.type = JointType::kContinuous;
        break;
      case urdf::Joint::PRISMATIC:
        joint.type = JointType::kPrismatic;
        break;
      default:
        Fail("joint '" + urdf.name +
             "' is of a type that is not supported; make it fixed, or revolute, continuous or "
             "prismatic");
    }
    const Eigen::Vector3d axis = VectorOf(urdf.axis);
    if (!(axis.norm() > 1e-9)) Fail("the axis of joint '" + urdf.name + "' has no direction");
    link.axis = axis.normalized();
    link.slides = joint.type == JointType::kPrismatic;
    if (MimicsAnother(urdf)) {
      mimics_.push_back({model_.links_.size(), urdf});
      return;
    }
    ReadLimits(urdf, joint);
    link.joint = static_cast<int>(model_.joints_.size());
    model_.joints_.push_back(std::move(joint));
  }

  // Finds the joint that moves a link in the end, and how.
  void Resolve(const Mimic& mimic) {
    RobotLink& link = model_.links_[mimic.link];
    const std::string& name = mimic.joint.name;
    const urdf::Joint* joint = &mimic.joint;
    for (size_t followed = 0; MimicsAnother(*joint); ++followed) {
      const urdf::JointMimic& by = *joint->mimic;
      if (followed == mimics_.size()) Fail("joint '" + name + "' mimics itself" + kMimic);
      if (!std::isfinite(by.multiplier) || !std::isfinite(by.offset)) {
        Fail("the multiplier or offset by which joint '" + joint->name +
             "' mimics another is not a number");
      }
      link.offset += link.factor * by.offset;
      link.factor *= by.multiplier;
      if (!(std::abs(link.factor) <= kMostMimic) || !(std::abs(link.offset) <= kMostMimic)) {
        Fail("joint '" + name + "' mimics another by a multiplier or offset above " +
             absl::StrCat(kMostMimic) + "; correct it");
      }
      const auto found = urdf_->joints_.find(by.joint_name);
      if (found == urdf_->joints_.end()) {
        Fail("joint '" + joint->name + "' mimics '" + by.joint_name + "', which is not there" +
             kMimic);
      }
      joint = found->second.get();
    }
    const std::optional<size_t> index = model_.JointIndex(joint->name);
    if (!index) Fail("joint '" + name + "' mimics '" + joint->name + "', which is fixed" + kMimic);
    // A whole turn leads back to where it was.
    const bool comes_back = !link.slides && link.factor == std::round(link.factor);
    if (model_.joints_[*index].type == JointType::kContinuous && !comes_back) {
      Fail("joint '" + name + "' mimics '" + joint->name +
           "', which turns without end; a turn later it is elsewhere; give '" + joint->name +
           "' limits, with type=\"revolute\"");
    }
    link.joint = static_cast<int>(*index);
    model_.followed_[name] = joint->name;
    KeepWithin(mimic.joint, link, model_.joints_[*index]);
  }

  // Narrows the limits of the joint that moves `link` to where the mimicking joint is within its
  // own. Files often leave those out, as 0 to 0.
  void KeepWithin(const urdf::Joint& mimicking, const RobotLink& link, RobotJoint& joint) const {
    if (mimicking.limits == nullptr || mimicking.type == urdf::Joint::CONTINUOUS) return;
    const double own[2] = {mimicking.limits->lower, mimicking.limits->upper};
    if (!std::isfinite(own[0]) || !std::isfinite(own[1]) || own[0] > own[1]) {
      Fail("the lower limit of joint '" + mimicking.name + "' exceeds its upper limit");
    }
    if (own[0] == own[1]) return;
    const auto beyond = [&] {
      Fail("joint '" + mimicking.name + "' is beyond its own limits wherever '" + joint.name +
           "', which it mimics, may stand; correct the limits, multiplier or offset");
    };
    if (joint.type == JointType::kContinuous) {
      if (link.factor != 0) {
        Fail("joint '" + mimicking.name + "' has limits, but mimics '" + joint.name +
             "', which turns without end; give '" + joint.name +
             "' limits, with type=\"revolute\"");
      }
      return;
    }
    if (link.factor == 0) {
      if (link.offset < own[0] - kLimitTolerance || link.offset > own[1] + kLimitTolerance)
        beyond();
      return;
    }
    const auto [low, high] =
        std::minmax({(own[0] - link.offset) / link.factor, (own[1] - link.offset) / link.factor});
    const double lower = std::max(joint.lower, low);
    const double upper = std::min(joint.upper, high);
    if (lower > upper + kLimitTolerance) beyond();
    joint.lower = std::min(lower, upper);
    joint.upper = upper;
  }

  KinematicChain ChainOfAll() const {
    std::vector<std::string> moving;
    for (const RobotJoint& joint : model_.joints_) moving.push_back(joint.name);
    return model_.ChainOf(moving, {}).value();
  }

  void ReadLimits(const urdf::Joint& urdf, RobotJoint& joint) const {
    if (joint.type == JointType::kContinuous) {
      joint.lower = -std::numbers::pi;
      joint.upper = std::numbers::pi;
      return;
    }
    if (urdf.limits == nullptr) Fail("joint '" + urdf.name + "' has no limits");
    joint.lower = urdf.limits->lower;
    joint.upper = urdf.limits->upper;
    if (!std::isfinite(joint.lower) || !std::isfinite(joint.upper) || joint.lower > joint.upper) {
      Fail("the lower limit of joint '" + urdf.name + "' exceeds its upper limit");
    }
    if (joint.type == JointType::kPrismatic) {
      RequireLength("the range of joint '" + urdf.name + "'", joint.upper - joint.lower);
    }
  }

  // `what`: in front of "is ... m".
  void RequireLength(const std::string& what, double length, double most = kMostLength) const {
    if (length <= most) return;
    Fail(absl::StrCat(what, " is ", length, " m, more than ", most,
                      " m; lengths in URDF are metres: a mesh in millimetres needs "
                      "scale=\"0.001 0.001 0.001\""));
  }

  template <typename VisualOrCollision>
  LinkGeometry Geometry(const std::string& link, const VisualOrCollision& urdf) {
    if (urdf.geometry == nullptr) Fail("link '" + link + "' has an element without geometry");
    LinkGeometry geometry;
    geometry.link_from_shape = PoseOf(urdf.origin);
    RequireLength("a geometry's origin in link '" + link + "'",
                  geometry.link_from_shape.translation().norm());
    geometry.shape = ShapeOf(link, *urdf.geometry);
    return geometry;
  }

  Shape ShapeOf(const std::string& link, const urdf::Geometry& urdf) {
    switch (urdf.type) {
      case urdf::Geometry::BOX:
        return Checked(link, BoxShape{VectorOf(static_cast<const urdf::Box&>(urdf).dim)});
      case urdf::Geometry::CYLINDER: {
        const auto& cylinder = static_cast<const urdf::Cylinder&>(urdf);
        return Checked(link, CylinderShape{cylinder.radius, cylinder.length});
      }
      case urdf::Geometry::SPHERE:
        return Checked(link, SphereShape{static_cast<const urdf::Sphere&>(urdf).radius});
      case urdf::Geometry::MESH:
        return MeshOf(link, static_cast<const urdf::Mesh&>(urdf));
    }
    Fail("link '" + link + "' has a geometry of unknown type");
  }

  BoxShape Checked(const std::string& link, BoxShape box) const {
    if (!(box.size.minCoeff() > 0)) Fail("a box of link '" + link + "' has no size");
    RequireLength("a box of link '" + link + "'", box.size.maxCoeff());
    return box;
  }
  CylinderShape Checked(const std::string& link, CylinderShape cylinder) const {
    if (!(cylinder.radius > 0 && cylinder.length > 0)) {
      Fail("a cylinder of link '" + link + "' has no size");
    }
    RequireLength("a cylinder of link '" + link + "'", std::max(cylinder.radius, cylinder.length));
    return cylinder;
  }
  SphereShape Checked(const std::string& link, SphereShape sphere) const {
    if (!(sphere.radius > 0)) Fail("a sphere of link '" + link + "' has no size");
    RequireLength("a sphere of link '" + link + "'", sphere.radius);
    return sphere;
  }

  // Links that have the same mesh share it.
  MeshShape MeshOf(const std::string& link, const urdf::Mesh& urdf) {
    const auto of_link = [&](const absl::Status& status) {
      return UrdfError{absl::Status(
          status.code(), absl::StrCat(path_, ": link '", link, "': ", status.message()))};
    };
    const absl::StatusOr<std::string> found = MeshPath(urdf.filename, path_, package_paths_);
    if (!found.ok()) throw of_link(found.status());
    const std::string& path = *found;
    std::shared_ptr<const TriangleMesh>& shared =
        meshes_[{path, urdf.scale.x, urdf.scale.y, urdf.scale.z}];
    if (shared != nullptr) return MeshShape{path, shared};
    absl::StatusOr<TriangleMesh> mesh = LoadMesh(path, VectorOf(urdf.scale));
    if (!mesh.ok()) throw of_link(mesh.status());
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& vertex : mesh->vertices) box.extend(vertex);
    const double length = box.sizes().maxCoeff();
    RequireLength("the mesh '" + path + "' of link '" + link + "'", length, kMostMesh);
    if (length < kLeastMesh) {
      Fail(absl::StrCat("the mesh '", path, "' of link '", link, "' is ", length,
                        " m long, less than ", kLeastMesh,
                        " m; it seems to be scaled twice: a Collada file has a unit of its own"));
    }
    shared = std::make_shared<const TriangleMesh>(*std::move(mesh));
    return MeshShape{path, shared};
  }

  const std::string path_;
  const std::span<const std::string> package_paths_;
  urdf::ModelInterfaceSharedPtr urdf_;
  RobotModel model_;
  std::vector<Mimic> mimics_;
  // By path and scale.
  std::map<std::tuple<std::string, double, double, double>, std::shared_ptr<const TriangleMesh>>
      meshes_;
};

absl::StatusOr<RobotModel> RobotModel::FromUrdf(const std::string& path,
                                                std::span<const std::string> package_paths) {
  try {
    return UrdfReader(path, package_paths).Read();
  } catch (const UrdfError& error) {
    return error.status;
  }
}

}  // namespace silhouette
