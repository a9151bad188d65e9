// SPDX-License-Identifier: Apache-2.0
// A world of spheres for tests: cameras that see them, and an arm that is made of them.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "calib/camera/camera_model.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"
#include "server/collision/collision_checker.h"
#include "server/collision/possible_space.h"

namespace silhouette::testing {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct Ball {
  Vector3d centre;
  double radius = 0;
};
using Balls = std::vector<Ball>;

inline bool Touch(std::span<const Ball> a, std::span<const Ball> b) {
  for (const Ball& each : a) {
    for (const Ball& other : b) {
      if ((each.centre - other.centre).norm() <= each.radius + other.radius) return true;
    }
  }
  return false;
}

inline double DistanceTo(std::span<const Ball> balls, const Vector3d& point) {
  double distance = 1e9;
  for (const Ball& ball : balls) {
    distance = std::min(distance, (point - ball.centre).norm() - ball.radius);
  }
  return distance;
}

// A camera that sees balls: any-touch, every pixel that shows any point of one; perhaps a few more.
class BallCamera {
 public:
  // Perspective.
  explicit BallCamera(const CameraModel& model)
      : size_{model.intrinsics().width, model.intrinsics().height},
        project_([model](const Vector3d& point) { return model.Project(point); }) {
    for (int y = 0; y < size_.height; ++y) {
      for (int x = 0; x < size_.width; ++x) {
        for (int i = 0; i < kSamples * kSamples; ++i) {
          const Vector2d pixel(x - 0.5 + (i % kSamples) / (kSamples - 1.0),
                               y - 0.5 + (i / kSamples) / (kSamples - 1.0));
          rays_.push_back(model.Ray(pixel).value());
        }
      }
    }
    centre_ = model.Centre();
    // Half the diagonal between samples, as an angle: along the axis it is largest.
    slack_ = std::numbers::sqrt2 / 2 / (kSamples - 1) /
             std::min(model.intrinsics().fx, model.intrinsics().fy) * 1.2;
  }

  // Parallel, along `direction`; the image shows [-1, 1]^2.
  BallCamera(const Vector3d& direction, int pixels) : size_{pixels, pixels} {
    const Vector3d forward = direction.normalized();
    const Vector3d above =
        std::abs(forward.z()) > 0.9 ? Vector3d::UnitY().eval() : Vector3d::UnitZ().eval();
    const Vector3d right = forward.cross(above).normalized();
    const Vector3d up = right.cross(forward);
    scale_ = pixels / 2.0;
    project_ = [right, up, scale = scale_](const Vector3d& point) {
      return Vector2d((point.dot(right) + 1) * scale - 0.5, (1 - point.dot(up)) * scale - 0.5);
    };
  }

  MaskSize size() const { return size_; }
  const std::function<std::optional<Vector2d>(const Vector3d&)>& project() const {
    return project_;
  }

  Mask See(std::span<const Ball> balls) const {
    return Mask::FromPredicate(size_, [&](int x, int y) {
      return std::any_of(balls.begin(), balls.end(),
                         [&](const Ball& ball) { return Shows(x, y, ball); });
    });
  }

 private:
  static constexpr int kSamples = 7;

  bool Shows(int x, int y, const Ball& ball) const {
    if (rays_.empty()) {
      const Vector2d image = *project_(ball.centre);
      const Vector2d off = ((Vector2d(x, y) - image).cwiseAbs().array() - 0.5).max(0.0);
      return off.norm() <= ball.radius * scale_ + 1e-9;
    }
    const Vector3d to = ball.centre - centre_;
    const double half_angle = std::asin(std::min(1.0, ball.radius / to.norm())) + slack_;
    const Vector3d* ray = rays_.data() + (y * size_.width + x) * kSamples * kSamples;
    const double with_pixel = std::cos(half_angle + 2 * kSamples * slack_) * to.norm();
    if (ray[kSamples * kSamples / 2].dot(to) < with_pixel) return false;
    const double least_cosine = std::cos(half_angle) * to.norm();
    for (int i = 0; i < kSamples * kSamples; ++i) {
      if (ray[i].dot(to) >= least_cosine) return true;
    }
    return false;
  }

  MaskSize size_;
  std::function<std::optional<Vector2d>(const Vector3d&)> project_;
  std::vector<Vector3d> rays_;
  Vector3d centre_ = Vector3d::Zero();
  double slack_ = 0;
  double scale_ = 1;
};

// A camera at `from` that looks at `at`, of whose image the shorter side spans `field` radians.
inline CameraModel LookingAt(const Vector3d& from, const Vector3d& at, MaskSize size, double field,
                             double k1 = 0) {
  const Vector3d forward = (at - from).normalized();
  const Vector3d above =
      std::abs(forward.z()) > 0.9 ? Vector3d::UnitY().eval() : Vector3d::UnitZ().eval();
  const Vector3d right = forward.cross(above).normalized();
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  world_from_camera.linear() << right, forward.cross(right), forward;
  world_from_camera.translation() = from;
  CameraIntrinsics intrinsics{.width = size.width, .height = size.height};
  intrinsics.fx = intrinsics.fy = std::min(size.width, size.height) / 2.0 / std::tan(field / 2);
  intrinsics.cx = (size.width - 1) / 2.0;
  intrinsics.cy = (size.height - 1) / 2.0;
  intrinsics.distortion[0] = k1;
  return CameraModel(intrinsics, world_from_camera.inverse());
}

// An arm of two links of balls about the origin: yaw, then pitch of the outer link.
inline Balls ArmAt(double q1, double q2) {
  constexpr double kLink = 0.36;
  const Vector3d along(std::cos(q1), std::sin(q1), 0);
  const Vector3d outer = std::cos(q2) * along + std::sin(q2) * Vector3d::UnitZ();
  Balls arm;
  for (int i = 0; i <= 4; ++i) arm.push_back({i / 4.0 * kLink * along, 0.07});
  for (int i = 1; i <= 4; ++i) arm.push_back({kLink * along + i / 4.0 * kLink * outer, 0.07});
  return arm;
}

inline const Eigen::AlignedBox3d kArmBox{Vector3d(-0.8, -0.8, -0.5), Vector3d(0.8, 0.8, 0.5)};

// Everything that does not change from scene to scene.
struct SphereWorld {
  static constexpr int kSteps = 20;

  // `carried`: radius of what the arm holds beside its outer link, and its model knows nothing of;
  // 0: it holds nothing. `the_pillars`: per view the pixels of something before the camera, which
  // are ignored; none: there is nothing.
  explicit SphereWorld(std::vector<BallCamera> the_cameras, double rho, double voxel,
                       double carried = 0, std::vector<Mask> the_pillars = {})
      : cameras(std::move(the_cameras)),
        pillars(std::move(the_pillars)),
        load(carried),
        table(Capture(cameras, pillars, carried)),
        space(kArmBox, rho, Views(), voxel) {}

  static ConfigurationGrid Grid() {
    return ConfigurationGrid({{"yaw", 0, 2 * std::numbers::pi, kSteps, true},
                              {"pitch", 0, 2 * std::numbers::pi, kSteps, true}});
  }
  static Balls Arm(ConfigurationNumber number) {
    const Configuration q = Grid().At(number);
    return ArmAt(q[0], q[1]);
  }
  // The arm and what it carries.
  static Balls Robot(ConfigurationNumber number, double carried) {
    Balls robot = Arm(number);
    if (carried > 0) robot.push_back({robot[6].centre, carried});
    return robot;
  }
  Balls Robot(ConfigurationNumber number) const { return Robot(number, load); }
  static std::vector<ConfigurationNumber> Configurations() {
    const ConfigurationGrid grid = Grid();
    std::vector<ConfigurationNumber> numbers;
    for (ConfigurationNumber number = 0; number < kTileSize * grid.tiles(); ++number) {
      if (grid.Contains(number)) numbers.push_back(number);
    }
    return numbers;
  }
  static RobotImageTable Capture(const std::vector<BallCamera>& cameras,
                                 const std::vector<Mask>& pillars, double carried) {
    std::vector<MaskSize> sizes;
    for (const BallCamera& camera : cameras) sizes.push_back(camera.size());
    RobotImageTable::Builder builder(Grid(), sizes);
    for (ConfigurationNumber number : Configurations()) {
      std::vector<Mask> masks;
      for (const BallCamera& camera : cameras) masks.push_back(camera.See(Robot(number, carried)));
      for (size_t view = 0; view < pillars.size(); ++view)
        masks[view] = masks[view] - pillars[view];
      builder.Add(number, masks);
    }
    return std::move(builder).Build();
  }
  std::vector<VoxelView> Views() const {
    std::vector<VoxelView> views;
    for (size_t view = 0; view < cameras.size(); ++view) {
      Mask swept(cameras[view].size());
      Mask permanent = ~swept;
      for (ConfigurationNumber number : Configurations()) {
        const Mask robot = (*table.Images(number))[view];
        swept = swept | robot;
        permanent = permanent & robot;
      }
      views.push_back(
          {cameras[view].size(), cameras[view].project(), Vector2d::Zero(), swept, permanent});
      if (!pillars.empty()) views.back().ignored = pillars[view];
    }
    return views;
  }

  ObstacleImages See(const Balls& obstacles, ConfigurationNumber present) const {
    ObstacleImages images;
    for (size_t view = 0; view < cameras.size(); ++view) {
      const Mask robot = (*table.Images(present))[view];
      images.push_back(ObstacleImage::FromScene(cameras[view].See(obstacles) | robot, robot));
      if (!pillars.empty()) images.back() = images.back()->Ignoring(pillars[view]);
    }
    return images;
  }
  static BodyDistance Body(ConfigurationNumber present) {
    return [arm = Arm(present)](const Vector3d& point) { return DistanceTo(arm, point); };
  }

  std::vector<BallCamera> cameras;
  std::vector<Mask> pillars;
  double load;
  RobotImageTable table;
  VoxelSpace space;
};

// Whether the voxel's centre, or all eighths', show that no point of it is as far as `limit` from
// the body.
inline bool WhollyBelow(const BodyDistance& body, const Eigen::AlignedBox3d& voxel, double limit) {
  const double half_diagonal = voxel.diagonal().norm() / 2;
  if (body(voxel.center()) + half_diagonal < limit) return true;
  if (!(body(voxel.center()) + half_diagonal / 2 < limit)) return false;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d to((corner & 1) - 0.5, (corner >> 1 & 1) - 0.5, (corner >> 2) - 0.5);
    const Vector3d eighth = voxel.center() + voxel.sizes().x() / 2 * to;
    if (!(body(eighth) + half_diagonal / 2 < limit)) return false;
  }
  return true;
}

// Seen by three parallel cameras.
inline SphereWorld ParallelWorld() {
  return SphereWorld({BallCamera(Vector3d(0, 0, -1), 40), BallCamera(Vector3d(1, 0, 0), 40),
                      BallCamera(Vector3d(-1, 1, -1), 40)},
                     0.06, 0.02);
}

// `count` balls at random places.
inline Balls SomeObstacles(int count, std::mt19937_64& random) {
  std::uniform_real_distribution<double> place(-0.75, 0.75);
  Balls obstacles;
  for (int i = 0; i < count; ++i) {
    obstacles.push_back({{place(random), place(random), 0.6 * place(random)}, 0.12});
  }
  return obstacles;
}

}  // namespace silhouette::testing
