// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/parts.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"
#include "calib/robot/distance_field.h"
#include "calib/robot/mesh_parts.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

// A hull of many points is drawn with fewer, and grown by no more than kFineness, metres, if
// kMostPoints are enough for that.
constexpr double kFineness = 0.001;
constexpr size_t kMostPoints = 96;

// The points of the hull of a part and of what is certain of it, in the shape's frame.
struct DrawnShape {
  struct Hull {
    Matrix3Xd points;
    double radius = 0;
    Matrix3Xd inner;
  };
  std::vector<Hull> hulls;
  double excess = 0;
};

Matrix3Xd ColumnsOf(std::span<const Vector3d> points) {
  Matrix3Xd columns(3, static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) columns.col(static_cast<Eigen::Index>(i)) = points[i];
  return columns;
}

// The corners of a polygon whose sides and corners are no more than kFineness apart in their
// distance from the middle.
int CornersOf(double radius) {
  const double half = std::acos(radius / (radius + kFineness));
  return std::max(8, static_cast<int>(std::ceil(std::numbers::pi / half)));
}

// Two rings of points about z.
Matrix3Xd Rings(double radius, double length, int corners) {
  Matrix3Xd points(3, 2 * corners);
  for (int i = 0; i < corners; ++i) {
    const double angle = 2 * std::numbers::pi * i / corners;
    const Vector3d corner(radius * std::cos(angle), radius * std::sin(angle), length / 2);
    points.col(2 * i) = corner;
    points.col(2 * i + 1) = Vector3d(corner.x(), corner.y(), -corner.z());
  }
  return points;
}

class ShapeDrawer {
 public:
  ShapeDrawer(const PartSettings& settings, const std::string& link)
      : settings_(settings), link_(link) {}

  absl::StatusOr<DrawnShape> operator()(const BoxShape& box) const {
    const Vector3d inner = box.size - Vector3d::Constant(2 * settings_.tolerance);
    DrawnShape shape;
    shape.hulls.push_back({ColumnsOf(BoxMesh(box.size).vertices), 0, {}});
    if (inner.minCoeff() > 0) shape.hulls[0].inner = ColumnsOf(BoxMesh(inner).vertices);
    return shape;
  }

  absl::StatusOr<DrawnShape> operator()(const CylinderShape& cylinder) const {
    // A polygon about the circle without, one in it within.
    const int corners = CornersOf(cylinder.radius);
    const double outer = cylinder.radius / std::cos(std::numbers::pi / corners);
    const double radius = cylinder.radius - settings_.tolerance;
    const double length = cylinder.length - 2 * settings_.tolerance;
    DrawnShape shape;
    shape.hulls.push_back({Rings(outer, cylinder.length, corners), 0, {}});
    if (radius > 0 && length > 0) shape.hulls[0].inner = Rings(radius, length, corners);
    shape.excess = outer - cylinder.radius;
    return shape;
  }

  absl::StatusOr<DrawnShape> operator()(const SphereShape& sphere) const {
    DrawnShape shape;
    shape.hulls.push_back({Matrix3Xd::Zero(3, 1), sphere.radius, {}});
    const double inner = sphere.radius - settings_.tolerance;
    if (inner > 0) shape.hulls[0].inner = ColumnsOf(SphereMesh(inner).vertices);
    return shape;
  }

  absl::StatusOr<DrawnShape> operator()(const MeshShape& shape) const {
    const TriangleMesh& mesh = *shape.mesh;
    RETURN_IF_ERROR(Check(shape));
    const MeshPieces pieces = PiecesOf(mesh, settings_.most_excess, settings_.most_parts);
    if (pieces.hulls.empty()) {
      return InvalidArgument(NameOf(shape),
                             " is flat; give it a thickness, or take it out of the URDF");
    }
    DrawnShape drawn;
    const bool closed = IsClosed(mesh);
    for (const ConvexBody& hull : pieces.hulls) {
      const FewPoints few = FewPointsOf(hull, kFineness, kMostPoints);
      drawn.hulls.push_back({ColumnsOf(few.points), few.radius, {}});
      drawn.excess = std::max(drawn.excess, pieces.excess + few.radius);
      if (!closed) continue;
      const std::optional<ConvexBody> inner =
          Shrunk(hull, DepthOfSurface(mesh, hull) + settings_.tolerance);
      if (!inner) continue;
      const Vector3d middle = ColumnsOf(inner->vertices).rowwise().mean();
      if (Encloses(mesh, middle)) drawn.hulls.back().inner = ColumnsOf(inner->vertices);
    }
    return drawn;
  }

 private:
  std::string NameOf(const MeshShape& shape) const {
    return absl::StrFormat("link '%s': the mesh '%s'", link_, shape.path);
  }

  absl::Status Check(const MeshShape& shape) const {
    const TriangleMesh& mesh = *shape.mesh;
    const std::string name = NameOf(shape);
    if (mesh.triangles.size() > settings_.most_triangles) {
      return InvalidArgument(absl::StrFormat(
          "%s has %d triangles, at most %d can be drawn; simplify it, or use 'geometry: collision'",
          name, mesh.triangles.size(), settings_.most_triangles));
    }
    return absl::OkStatus();
  }

  const PartSettings& settings_;
  const std::string& link_;
};

struct IsRoundAbout {
  // The shape's frame as seen from the joint's, whose axis is a line through its origin.
  const Eigen::Isometry3d& link_from_shape;
  const Vector3d& axis;

  bool OnAxis() const { return axis.cross(link_from_shape.translation()).norm() < 1e-6; }
  bool operator()(const SphereShape&) const { return OnAxis(); }
  bool operator()(const CylinderShape&) const {
    return OnAxis() && axis.cross(link_from_shape.linear().col(2)).norm() < 1e-6;
  }
  bool operator()(const auto&) const { return false; }
};

// Moves what is round about its joint's axis to the link before.
void MoveWithLinkBefore(const RobotModel& robot, const LinkGeometry& geometry,
                        std::span<RobotPart> parts) {
  size_t at = parts[0].link;
  Eigen::Isometry3d here_from_shape = geometry.link_from_shape;
  for (;;) {
    const RobotLink& link = robot.links()[at];
    if (link.parent < 0) break;
    if (link.joint >= 0 &&
        (link.slides || !std::visit(IsRoundAbout{here_from_shape, link.axis}, geometry.shape))) {
      break;
    }
    here_from_shape = link.parent_from_link * here_from_shape;
    at = static_cast<size_t>(link.parent);
    for (RobotPart& part : parts) {
      part.moves_with = at;
      part.points = (link.parent_from_link * part.points).eval();
      if (part.inner.cols() > 0) part.inner = (link.parent_from_link * part.inner).eval();
    }
  }
}

}  // namespace

absl::StatusOr<RobotParts> RobotParts::Of(const RobotModel& robot, const PartSettings& settings) {
  // Meshes take long: each by itself, and once for all links that have it.
  using Drawing = std::shared_future<absl::StatusOr<DrawnShape>>;
  std::map<const TriangleMesh*, Drawing> meshes;
  std::vector<std::vector<Drawing>> shapes;
  for (const RobotLink& link : robot.links()) {
    auto& of_link = shapes.emplace_back();
    for (const LinkGeometry& geometry : link.body(settings.geometry)) {
      const auto draw = [&] {
        return std::visit(ShapeDrawer(settings, link.name), geometry.shape);
      };
      const auto* const mesh = std::get_if<MeshShape>(&geometry.shape);
      if (mesh == nullptr) {
        of_link.push_back(std::async(std::launch::deferred, draw).share());
        continue;
      }
      Drawing& drawing = meshes[mesh->mesh.get()];
      if (!drawing.valid()) drawing = std::async(std::launch::async, draw).share();
      of_link.push_back(drawing);
    }
  }
  RobotParts result;
  result.excess_.assign(robot.links().size(), 0);
  for (size_t i = 0; i < robot.links().size(); ++i) {
    const RobotLink& link = robot.links()[i];
    for (size_t k = 0; k < shapes[i].size(); ++k) {
      const LinkGeometry& geometry = link.body(settings.geometry)[k];
      ASSIGN_OR_RETURN(const DrawnShape shape, shapes[i][k].get());
      const size_t first = result.parts_.size();
      for (const DrawnShape::Hull& hull : shape.hulls) {
        RobotPart part{.link = i,
                       .moves_with = i,
                       .points = geometry.link_from_shape * hull.points,
                       .radius = hull.radius,
                       .inner = {}};
        if (hull.inner.cols() > 0) part.inner = geometry.link_from_shape * hull.inner;
        result.parts_.push_back(std::move(part));
      }
      MoveWithLinkBefore(robot, geometry, std::span(result.parts_).subspan(first));
      result.excess_[i] = std::max(result.excess_[i], shape.excess);
    }
  }
  if (result.parts_.empty()) {
    return InvalidArgument(
        "the robot '", robot.name(),
        "' has no visual or collision geometry: nothing of it can be drawn; give its "
        "links visual or collision geometry in the URDF");
  }
  return result;
}

absl::StatusOr<DrawnRobot> DrawnRobotOf(const RobotModel& robot, const PartSettings& settings,
                                        std::span<const std::string> moving,
                                        std::span<const FixedJoint> fixed,
                                        const Calibration& calibration,
                                        std::span<const MaskSize> mask_sizes, double margin) {
  if (!(margin >= 0) || !std::isfinite(margin)) {
    return InvalidArgument("the margin of the calibration must not be negative");
  }
  if (calibration.cameras.size() != mask_sizes.size()) {
    return InvalidArgument("the calibration has no camera model for each view");
  }
  ASSIGN_OR_RETURN(KinematicChain chain, robot.ChainOf(moving, fixed));
  ASSIGN_OR_RETURN(const RobotParts parts, RobotParts::Of(robot, settings));
  std::vector<PartDrawer> views;
  for (size_t view = 0; view < mask_sizes.size(); ++view) {
    views.emplace_back(calibration.cameras[view], mask_sizes[view], margin);
  }
  return DrawnRobot(std::move(chain), parts.parts(), std::move(views));
}

}  // namespace silhouette
