#include "tools/silhouette-experiments/hidden/study.h"

#include <algorithm>
#include <numbers>
#include <random>
#include <utility>

#include "server/scene/checker.h"

namespace silhouette::hidden_experiment {
namespace {

using Eigen::Vector3d;

constexpr int kRobots = 400;        // configurations that are tried
constexpr int kPlaces = 3000;       // places near the robot, for each
constexpr double kFarthest = 0.15;  // of the ball from the robot, metres
constexpr double kNearest = 0.005;
constexpr double kDeep = 0.02;  // of the deepest contact at least, about, metres

// Points all over a ball.
std::vector<Vector3d> PointsOn(const Vector3d& centre, double radius) {
  std::vector<Vector3d> points;
  for (const Vector3d& vertex : SphereMesh(radius).vertices) points.push_back(centre + vertex);
  return points;
}

class Search {
 public:
  Search(const HiddenCell& cell, double radius, uint64_t seed)
      : cell_(cell), radius_(radius), random_(seed), parts_(RobotParts(cell.robot())) {
    ball_.name = "hidden ball";
    ball_.mesh = SphereMesh(radius);
    contact_.emplace(cell.robot(), std::span(&ball_, 1));
  }

  std::optional<HiddenBall> Find() {
    for (int i = 0; i < kRobots; ++i) {
      const ConfigurationNumber number = RandomNumber();
      const Configuration robot = cell_.grid().At(number);
      const std::optional<Vector3d> centre = PlaceNear(number, cell_.LinkPosesAt(robot));
      if (!centre) continue;
      HiddenBall found{robot, *centre, radius_, Touching(*centre)};
      if (std::find(found.touches.begin(), found.touches.end(), true) != found.touches.end()) {
        return found;
      }
    }
    return std::nullopt;
  }

 private:
  double Between(double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random_);
  }
  template <typename Items>
  const auto& OneOf(const Items& items) {
    return items[std::uniform_int_distribution<size_t>(0, items.size() - 1)(random_)];
  }
  ConfigurationNumber RandomNumber() {
    std::uniform_int_distribution<ConfigurationNumber> any(0, cell_.grid().tiles() * kTileSize - 1);
    for (;;) {
      const ConfigurationNumber number = any(random_);
      if (cell_.grid().Contains(number)) return number;
    }
  }

  Poses PoseAt(const Vector3d& centre) const {
    Poses poses(1, Eigen::Isometry3d::Identity());
    poses[0].translation() = centre;
    return poses;
  }

  std::optional<Vector3d> PlaceNear(ConfigurationNumber number, const Poses& links) {
    for (int i = 0; i < kPlaces; ++i) {
      const BodyPart& part = OneOf(parts_);
      const Vector3d away(Between(-1, 1), Between(-1, 1), Between(-1, 1));
      const Vector3d centre = links[part.frame] * OneOf(part.mesh.vertices) +
                              (radius_ + Between(kNearest, kFarthest)) * away.normalized();
      if (centre.z() < radius_ || cell_.MayTouch(number, centre, radius_ + kNearest)) continue;
      if (Hidden(number, centre) && InTheWay(centre)) return centre;
    }
    return std::nullopt;
  }

  bool Hidden(ConfigurationNumber number, const Vector3d& centre) const {
    const RobotImageTable& images = cell_.database().robot_images();
    const auto covered = [&](size_t view, const Vector3d& point) {
      const auto pixel = cell_.cameras()[view].Project(point);
      if (!pixel || !cell_.cameras()[view].Contains(*pixel)) return false;
      const int x = static_cast<int>(std::lround(pixel->x()));
      const int y = static_cast<int>(std::lround(pixel->y()));
      const auto bit = static_cast<size_t>(y * cell_.cameras()[view].intrinsics().width + x);
      return (images.image(static_cast<int>(view), number)[bit / 64] >> (bit % 64) & 1) != 0;
    };
    for (size_t view = 0; view < cell_.cameras().size(); ++view) {
      if (!covered(view, centre)) return false;
    }
    const std::vector<Vector3d> points = PointsOn(centre, radius_);
    for (size_t view = 0; view < cell_.cameras().size(); ++view) {
      for (const Vector3d& point : points) {
        if (!covered(view, point)) return false;
      }
    }
    return true;
  }

  bool InTheWay(const Vector3d& centre) const {
    for (ConfigurationNumber number = 0; number < cell_.grid().tiles() * kTileSize; ++number) {
      if (cell_.grid().Contains(number) && cell_.MayTouch(number, centre, radius_ - kDeep)) {
        return true;
      }
    }
    return false;
  }

  std::vector<bool> Touching(const Vector3d& centre) const {
    std::vector<bool> touches(cell_.grid().tiles() * kTileSize, false);
    for (ConfigurationNumber number = 0; number < touches.size(); ++number) {
      if (!cell_.grid().Contains(number) || !cell_.MayTouch(number, centre, radius_)) continue;
      touches[number] =
          contact_->Check(cell_.LinkPosesAt(cell_.grid().At(number)), PoseAt(centre)).touching;
    }
    return touches;
  }

  const HiddenCell& cell_;
  const double radius_;
  std::mt19937_64 random_;
  Obstacle ball_;
  const std::vector<BodyPart> parts_;
  std::optional<ContactChecker> contact_;
};

}  // namespace

Obstacle ObstacleOf(const HiddenBall& ball) {
  Obstacle obstacle;
  obstacle.name = "hidden ball";
  obstacle.mesh = SphereMesh(ball.radius);
  obstacle.world_from_obstacle.translation() = ball.centre;
  return obstacle;
}

std::optional<HiddenBall> FindHiddenBall(const HiddenCell& cell, double radius, uint64_t seed) {
  return Search(cell, radius, seed).Find();
}

Tally& Tally::operator+=(const Tally& other) {
  touching += other.touching;
  found += other.found;
  clear += other.clear;
  kept += other.kept;
  return *this;
}

Tally Judge(const HiddenCell& cell, const Served& served, Preset preset,
            const std::vector<bool>& touches) {
  const std::vector<TileVerdicts> tiles = CheckAllTiles(served, {.preset = preset});
  Tally tally;
  for (ConfigurationNumber number = 0; number < touches.size(); ++number) {
    if (!cell.grid().Contains(number)) continue;
    const uint64_t place = number % kTileSize;
    const bool free = (tiles[number / kTileSize].free[place / 64] >> (place % 64) & 1) != 0;
    if (touches[number]) {
      ++tally.touching;
      tally.found += free ? 0 : 1;
    } else {
      ++tally.clear;
      tally.kept += free ? 1 : 0;
    }
  }
  return tally;
}

}  // namespace silhouette::hidden_experiment
