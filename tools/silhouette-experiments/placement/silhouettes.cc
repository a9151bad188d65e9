// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/placement/silhouettes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace silhouette {
namespace {

constexpr int kFiner = 4;         // sub-pixels along each side of a pixel
constexpr double kNear = 0.05;    // metres; what is nearer to the camera is cut off
constexpr int kFraction = 4;      // fractional bits of OpenCV's coordinates
constexpr double kFar = 1 << 20;  // sub-pixels; OpenCV's coordinates end

bool IsConvex(const TriangleMesh& mesh) {
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[triangle[0]];
    const Eigen::Vector3d normal =
        (mesh.vertices[triangle[1]] - a).cross(mesh.vertices[triangle[2]] - a);
    if (!(normal.norm() > 0)) continue;
    for (const Eigen::Vector3d& vertex : mesh.vertices) {
      if (normal.normalized().dot(vertex - a) > 1e-6) return false;
    }
  }
  return true;
}

using Polygon = std::vector<Eigen::Vector3d>;

// What of a triangle is farther away than kNear.
Polygon InFront(const std::array<Eigen::Vector3d, 3>& triangle) {
  Polygon polygon;
  for (size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d& from = triangle[i];
    const Eigen::Vector3d& to = triangle[(i + 1) % 3];
    if (from.z() >= kNear) polygon.push_back(from);
    if ((from.z() >= kNear) != (to.z() >= kNear)) {
      polygon.push_back(from + (to - from) * ((kNear - from.z()) / (to.z() - from.z())));
    }
  }
  return polygon;
}

// Draws into an image with kFiner x kFiner sub-pixels per pixel.
class Canvas {
 public:
  explicit Canvas(const CameraModel& camera)
      : intrinsics_(camera.intrinsics()),
        image_(cv::Mat::zeros(intrinsics_.height * kFiner, intrinsics_.width * kFiner, CV_8U)) {}

  void Draw(const Solid& solid, const Eigen::Isometry3d& camera_from_frame) {
    std::vector<Eigen::Vector3d> vertices;
    bool all_in_front = true;
    for (const Eigen::Vector3d& vertex : solid.mesh.vertices) {
      vertices.push_back(camera_from_frame * vertex);
      all_in_front = all_in_front && vertices.back().z() >= kNear;
    }
    if (solid.convex && all_in_front) return FillHull(vertices);
    Polygon hull;
    for (const auto& triangle : solid.mesh.triangles) {
      const Polygon polygon =
          InFront({vertices[triangle[0]], vertices[triangle[1]], vertices[triangle[2]]});
      if (solid.convex) {
        hull.insert(hull.end(), polygon.begin(), polygon.end());
      } else {
        FillHull(polygon);
      }
    }
    FillHull(hull);
  }

  Mask Reduced() const {
    return Mask::FromPredicate({intrinsics_.width, intrinsics_.height}, [&](int x, int y) {
      return cv::countNonZero(image_(cv::Rect(x * kFiner, y * kFiner, kFiner, kFiner))) > 0;
    });
  }

 private:
  void FillHull(const Polygon& points) {
    if (points.empty()) return;
    std::vector<cv::Point2f> projected;
    for (const Eigen::Vector3d& point : points) {
      const auto place = [](double pixel) {
        return static_cast<float>(std::clamp((pixel + 0.5) * kFiner - 0.5, -kFar, kFar));
      };
      projected.emplace_back(place(intrinsics_.fx * point.x() / point.z() + intrinsics_.cx),
                             place(intrinsics_.fy * point.y() / point.z() + intrinsics_.cy));
    }
    std::vector<cv::Point2f> hull;
    cv::convexHull(projected, hull);
    std::vector<cv::Point> corners;
    for (const cv::Point2f& point : hull) {
      corners.emplace_back(cvRound(point.x * (1 << kFraction)),
                           cvRound(point.y * (1 << kFraction)));
    }
    cv::fillConvexPoly(image_, corners, cv::Scalar(255), cv::LINE_8, kFraction);
  }

  const CameraIntrinsics intrinsics_;
  cv::Mat image_;
};

}  // namespace

std::vector<Solid> SolidsOf(std::span<const BodyPart> parts) {
  std::vector<Solid> solids;
  for (const BodyPart& part : parts) {
    solids.push_back({.frame = part.frame, .mesh = part.mesh, .convex = IsConvex(part.mesh)});
  }
  return solids;
}

Mask SilhouetteOf(std::span<const Solid> solids, const Poses& poses, const CameraModel& camera) {
  Canvas canvas(camera);
  for (const Solid& solid : solids) {
    canvas.Draw(solid, camera.camera_from_world() * poses[solid.frame]);
  }
  return canvas.Reduced();
}

bool IsWhole(std::span<const Solid> solids, const Poses& poses, const CameraModel& camera) {
  for (const Solid& solid : solids) {
    for (const Eigen::Vector3d& vertex : solid.mesh.vertices) {
      const auto pixel = camera.Project(poses[solid.frame] * vertex);
      if (!pixel || !camera.Contains(*pixel)) return false;
    }
  }
  return true;
}

}  // namespace silhouette
