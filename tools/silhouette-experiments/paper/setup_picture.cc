// SPDX-License-Identifier: Apache-2.0
// Figure 6: the scene drawn by following rays, in parallel projection too.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"
#include "server/collision/obstacle_image.h"
#include "tools/silhouette-experiments/paper/pictures.h"

namespace silhouette::paper {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kWidth = 1000;
constexpr int kRim = 30;
constexpr int kOversampling = 2;
constexpr double kReach = 2.35;         // half the picture's width, in window half widths
constexpr double kPlaneDistance = 1.3;  // of the image planes from the origin, as a cube's sides
constexpr int kCaption = 17;
constexpr int kBelow = 16;            // of a caption's middle under its plane, in pixels
constexpr double kAxis = 0.35;        // length of the axes' arrows, in half widths
constexpr int kAxesFromRight = 160;   // pixels
constexpr double kFrameWidth = 0.01;  // likewise

constexpr Colour kFrame{150, 150, 150};

Colour Shaded(Colour colour, double light) {
  const auto part = [&](uint8_t value) {
    return static_cast<uint8_t>(std::clamp(value * light, 0.0, 255.0));
  };
  return {part(colour.red), part(colour.green), part(colour.blue)};
}

// A camera's image on a plane behind the scene.
struct ImagePlane {
  const ParallelCamera* camera;
  Vector3d middle;
  Picture image;
};

struct Body {
  Sphere sphere;
  Colour colour;
};

// Where the picture is looked from, and how points come into it.
class Viewpoint {
 public:
  explicit Viewpoint(const Vector3d& direction) : camera_(direction, 1, 64) {}

  const Vector3d& direction() const { return camera_.direction(); }

  // Makes the picture as large as `points` need.
  void Fit(const std::vector<Vector3d>& points) {
    for (const Vector3d& point : points) shown_.extend(Flat(point));
    scale_ = (kWidth - 2 * kRim) / shown_.sizes().x();
  }
  cv::Size size() const {
    return {kWidth, static_cast<int>(std::lround(shown_.sizes().y() * scale_)) + 2 * kRim};
  }
  // A point on the ray of a place in the picture.
  Vector3d OnRay(double x, double y) const {
    return (shown_.min().x() + (x - kRim) / scale_) * camera_.right() +
           (shown_.max().y() - (y - kRim) / scale_) * camera_.up();
  }
  cv::Point PixelOf(const Vector3d& point) const {
    const Vector2d flat = Flat(point);
    return {static_cast<int>(std::lround((flat.x() - shown_.min().x()) * scale_)) + kRim,
            static_cast<int>(std::lround((shown_.max().y() - flat.y()) * scale_)) + kRim};
  }

 private:
  Vector2d Flat(const Vector3d& point) const {
    return {point.dot(camera_.right()), point.dot(camera_.up())};
  }

  ParallelCamera camera_;
  Eigen::AlignedBox2d shown_;
  double scale_ = 1;
};

// The planes lie outside the cube of edge 2 kPlaneDistance, on the side that is farther away.
std::vector<ImagePlane> PlanesBehind(const Viewpoint& viewpoint, const Settings& settings,
                                     std::span<const ParallelCamera> cameras,
                                     const Spheres& robot) {
  std::vector<ImagePlane> planes;
  for (const ParallelCamera& camera : cameras) {
    const double side = camera.direction().dot(viewpoint.direction()) >= 0 ? 1 : -1;
    const double distance =
        kPlaneDistance * settings.half_width * camera.direction().cwiseAbs().sum();
    const Mask obstacle = ImageOf(camera, settings.figure7, Raster::kTouch);
    const Mask arm = ImageOf(camera, robot, Raster::kTouch);
    Picture image = PictureOf(arm, palette::kRobot, palette::kBackground);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        if (obstacle.at(x, y)) {
          image.at<cv::Vec3b>(y, x) = {palette::kObstacle.blue, palette::kObstacle.green,
                                       palette::kObstacle.red};
        }
      }
    }
    planes.push_back({&camera, side * distance * camera.direction(), image});
  }
  return planes;
}

// What a ray from the viewpoint meets first.
Colour ColourOn(const Vector3d& from, const Vector3d& along, const std::vector<Body>& bodies,
                const std::vector<ImagePlane>& planes, double half_width) {
  double nearest = std::numeric_limits<double>::infinity();
  Colour colour = palette::kPaper;
  const Vector3d light = Vector3d(-0.4, -0.5, 0.9).normalized();
  for (const auto& [sphere, own] : bodies) {
    const Vector3d offset = from - sphere.centre;
    const double b = offset.dot(along);
    const double c = offset.squaredNorm() - sphere.radius * sphere.radius;
    const double root = b * b - c;
    if (root < 0 || -b - std::sqrt(root) >= nearest) continue;
    nearest = -b - std::sqrt(root);
    const Vector3d normal = (offset + nearest * along) / sphere.radius;
    colour = Shaded(own, 0.62 + 0.5 * std::max(0.0, normal.dot(light)));
  }
  for (const ImagePlane& plane : planes) {
    const ParallelCamera& camera = *plane.camera;
    const double slope = along.dot(camera.direction());
    if (std::abs(slope) < 1e-9) continue;
    const double distance = (plane.middle - from).dot(camera.direction()) / slope;
    if (distance >= nearest) continue;
    const Vector3d at = from + distance * along;
    const double out = std::max(std::abs(at.dot(camera.right())), std::abs(at.dot(camera.up())));
    if (out > half_width) continue;
    nearest = distance;
    if (out > half_width * (1 - kFrameWidth)) {
      colour = kFrame;
      continue;
    }
    const Vector2d pixel = camera.Project(at);
    const int x = std::clamp(static_cast<int>(std::lround(pixel.x())), 0, plane.image.cols - 1);
    const int y = std::clamp(static_cast<int>(std::lround(pixel.y())), 0, plane.image.rows - 1);
    const cv::Vec3b texel = plane.image.at<cv::Vec3b>(y, x);
    colour = {texel[2], texel[1], texel[0]};
  }
  return colour;
}

std::array<Vector3d, 4> CornersOf(const ImagePlane& plane, double half) {
  const Vector3d right = half * plane.camera->right();
  const Vector3d up = half * plane.camera->up();
  return {plane.middle - right + up, plane.middle + right + up, plane.middle + right - up,
          plane.middle - right - up};
}

// An arrow along `axis`, from a place in the picture.
void DrawAxis(Picture& picture, const Viewpoint& viewpoint, cv::Point from, const Vector3d& axis,
              const std::string& caption) {
  const cv::Point end = from + viewpoint.PixelOf(axis) - viewpoint.PixelOf(Vector3d::Zero());
  cv::arrowedLine(picture, from, end, BgrOf(palette::kInk), 2, cv::LINE_AA, 0, 0.12);
  DrawText(picture, caption, end + cv::Point(10, -8), {.height = kCaption});
}

// Under the lowest corner in the picture.
void DrawCaption(Picture& picture, const Viewpoint& viewpoint,
                 const std::array<Vector3d, 4>& corners, const std::string& caption) {
  cv::Point lowest = viewpoint.PixelOf(corners[0]);
  for (const Vector3d& corner : corners) {
    const cv::Point at = viewpoint.PixelOf(corner);
    if (at.y > lowest.y) lowest = at;
  }
  const int half_width = TextWidth(caption, kCaption) / 2;
  lowest.x = std::clamp(lowest.x, half_width, picture.cols - 1 - half_width);
  DrawText(picture, caption, lowest + cv::Point(0, kBelow),
           {.height = kCaption, .across = Align::kMiddle});
}

std::string DirectionOf(const ParallelCamera& camera) {
  const Vector3d d = camera.direction() / camera.direction().cwiseAbs().maxCoeff();
  return absl::StrFormat("(%.3g, %.3g, %.3g)", d.x() + 0.0, d.y() + 0.0, d.z() + 0.0);
}

}  // namespace

Picture SetupPicture(const Settings& settings, Variant variant, const std::string& rig) {
  const std::vector<ParallelCamera>& cameras = settings.rigs.at(rig);
  const double half = settings.half_width;
  Viewpoint viewpoint({0.5, 1.0, -1.0});
  const Spheres robot = ArmAt(settings.arm, variant, settings.parked[0], settings.parked[1]);
  std::vector<Body> bodies;
  for (const Sphere& sphere : robot) bodies.push_back({sphere, palette::kRobot});
  for (const Sphere& sphere : settings.figure7) bodies.push_back({sphere, palette::kObstacle});
  const std::vector<ImagePlane> planes = PlanesBehind(viewpoint, settings, cameras, robot);

  std::vector<Vector3d> shown;
  for (const ImagePlane& plane : planes) {
    const std::array<Vector3d, 4> corners = CornersOf(plane, half);
    shown.insert(shown.end(), corners.begin(), corners.end());
  }
  viewpoint.Fit(shown);
  const cv::Size size = viewpoint.size();
  Picture large = BlankPicture(size.width * kOversampling, size.height * kOversampling);
  const Vector3d start = -100 * half * viewpoint.direction();
  for (int y = 0; y < large.rows; ++y) {
    for (int x = 0; x < large.cols; ++x) {
      const Vector3d from =
          start + viewpoint.OnRay((x + 0.5) / kOversampling, (y + 0.5) / kOversampling);
      const Colour colour = ColourOn(from, viewpoint.direction(), bodies, planes, half);
      large.at<cv::Vec3b>(y, x) = {colour.blue, colour.green, colour.red};
    }
  }
  Picture picture;
  cv::resize(large, picture, size, 0, 0, cv::INTER_AREA);
  std::string directions = "The cameras look along";
  for (size_t i = 0; i < planes.size(); ++i) {
    const ParallelCamera& camera = *planes[i].camera;
    DrawCaption(picture, viewpoint, CornersOf(planes[i], half), absl::StrCat("camera ", i + 1));
    absl::StrAppend(&directions, i == 0 ? " " : ", ", i + 1, ": ", DirectionOf(camera));
  }
  const cv::Point corner(picture.cols - kAxesFromRight, picture.rows - kRim);
  DrawAxis(picture, viewpoint, corner, kAxis * half * Vector3d::UnitX(), "x");
  DrawAxis(picture, viewpoint, corner, kAxis * half * Vector3d::UnitY(), "y");
  DrawAxis(picture, viewpoint, corner, kAxis * half * Vector3d::UnitZ(), "z");
  return ContactSheet({{picture, directions}},
                      {.title = absl::StrCat("Figure 6: robot, obstacle and the cameras' images (",
                                             NameOf(variant), ", rig ", rig, ")"),
                       .columns = 1,
                       .legend = {{palette::kRobot, "robot"}, {palette::kObstacle, "obstacle"}}});
}

Picture ViewsPicture(const Settings& settings, Variant variant, const std::string& rig) {
  const Spheres robot = ArmAt(settings.arm, variant, settings.parked[0], settings.parked[1]);
  std::vector<CaptionedPicture> scenes;
  std::vector<CaptionedPicture> obstacles;
  for (const ParallelCamera& camera : settings.rigs.at(rig)) {
    const Mask arm = ImageOf(camera, robot, Raster::kTouch);
    const Mask scene = ImageOf(camera, settings.figure7, Raster::kTouch) | arm;
    const ObstacleImage image = ObstacleImage::FromScene(scene, arm);
    const int factor = std::max(1, 256 / scene.width());
    const std::string name = absl::StrCat("camera ", scenes.size() + 1);
    scenes.push_back({Enlarged(PictureOf(scene), factor), name + ": scene image"});
    obstacles.push_back(
        {Enlarged(PictureOfPlanes(image.obstacle(), image.unknown(), image.error()), factor),
         name + ": obstacle image"});
  }
  const auto columns = static_cast<int>(scenes.size());
  scenes.insert(scenes.end(), obstacles.begin(), obstacles.end());
  return ContactSheet(
      scenes, {.title = absl::StrCat("What the cameras see (", NameOf(variant), ", rig ", rig, ")"),
               .columns = columns,
               .legend = {{palette::kInk, "foreground"},
                          {palette::kBackground, "background"},
                          {palette::kObstacle, "obstacle"},
                          {palette::kUnknown, "unknown"}}});
}

}  // namespace silhouette::paper
