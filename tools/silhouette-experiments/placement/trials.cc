// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/placement/trials.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <random>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "capture/sim/contact.h"
#include "common/parallel/parallel.h"
#include "db/status/status_macros.h"
#include "server/collision/collision_checker.h"
#include "server/collision/epipolar_bands.h"
#include "tools/silhouette-experiments/placement/silhouettes.h"

namespace silhouette {
namespace {

using Random = std::mt19937_64;

constexpr int kMostAttempts = 200;  // to sample a scene that is a measure

double Between(double lower, double upper, Random& random) {
  return lower + (upper - lower) * std::generate_canonical<double, 53>(random);
}

size_t Below(size_t limit, Random& random) {
  return std::min(limit - 1, static_cast<size_t>(Between(0, static_cast<double>(limit), random)));
}

// `count` different numbers of the grid, or all of them.
std::vector<ConfigurationNumber> SampleNumbers(const ConfigurationGrid& grid, size_t count,
                                               Random& random) {
  std::vector<ConfigurationNumber> numbers;
  if (grid.size() <= count) {
    for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
      if (grid.Contains(number)) numbers.push_back(number);
    }
    return numbers;
  }
  while (numbers.size() < count) {
    const ConfigurationNumber number = Below(grid.number_limit(), random);
    if (!grid.Contains(number)) continue;
    if (std::find(numbers.begin(), numbers.end(), number) == numbers.end()) {
      numbers.push_back(number);
    }
  }
  return numbers;
}

// The configurations at the ends of all joints' ranges, where the robot reaches far.
std::vector<Configuration> ExtremeConfigurations(const ConfigurationGrid& grid) {
  std::vector<Configuration> extremes = {{}};
  for (const GridJoint& joint : grid.joints()) {
    std::vector<Configuration> longer;
    for (const Configuration& q : extremes) {
      for (double value : {joint.lower, joint.upper}) {
        longer.push_back(q);
        longer.back().push_back(value);
      }
    }
    extremes = std::move(longer);
  }
  return extremes;
}

struct Bounds {
  Eigen::AlignedBox3d box;
  std::vector<Eigen::Vector2d> footprint;

  void Add(std::span<const Solid> solids, const Poses& poses) {
    for (const Solid& solid : solids) {
      for (const Eigen::Vector3d& vertex : solid.mesh.vertices) {
        const Eigen::Vector3d point = poses[solid.frame] * vertex;
        box.extend(point);
        footprint.emplace_back(point.head<2>());
      }
    }
  }
};

// A ball, a capsule or a box as large as people and their hands, where the robot can reach.
Obstacle RandomObstacle(const PlacementSamples& samples, const Eigen::AlignedBox3d& reach,
                        Random& random) {
  const double radius = Between(samples.least_radius, samples.greatest_radius, random);
  Obstacle obstacle;
  switch (Below(3, random)) {
    case 0:
      obstacle.name = "ball";
      obstacle.mesh = SphereMesh(radius);
      break;
    case 1:
      obstacle.name = "capsule";
      obstacle.mesh = CapsuleMesh(radius, Between(radius, 5 * radius, random));
      break;
    default:
      obstacle.name = "box";
      obstacle.mesh =
          BoxMesh({2 * radius, Between(1, 3, random) * radius, Between(1, 5, random) * radius});
  }
  const Eigen::AngleAxisd turn(
      Between(0, 2 * std::numbers::pi, random),
      Eigen::Vector3d(Between(-1, 1, random), Between(-1, 1, random), Between(0.1, 1, random))
          .normalized());
  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    const double lower = axis == 2 ? std::max(0.0, reach.min()[axis]) : reach.min()[axis];
    middle[axis] = Between(lower, std::max(lower, reach.max()[axis]), random);
  }
  obstacle.world_from_obstacle = Eigen::Translation3d(middle) * turn;
  return obstacle;
}

std::vector<Eigen::Vector2d> HullOf(std::span<const Eigen::Vector2d> points) {
  std::vector<cv::Point2f> plane;
  for (const Eigen::Vector2d& point : points) {
    plane.emplace_back(static_cast<float>(point.x()), static_cast<float>(point.y()));
  }
  std::vector<cv::Point2f> corners;
  cv::convexHull(plane, corners);
  std::vector<Eigen::Vector2d> hull;
  for (const cv::Point2f& corner : corners) hull.emplace_back(corner.x, corner.y);
  return hull;
}

int64_t CountBits(const std::vector<uint64_t>& words) {
  int64_t count = 0;
  for (uint64_t word : words) count += std::popcount(word);
  return count;
}

// What stands in a sampled scene, and where the robot is.
struct SampledScene {
  std::vector<Obstacle> obstacles;
  std::vector<uint64_t> touching;  // one bit per configuration
  size_t current = 0;
};

// Nothing if the robot touches an obstacle at every configuration.
std::optional<SampledScene> SampleScene(const RobotModel& robot, const std::vector<Poses>& poses,
                                        const PlacementSamples& samples,
                                        const Eigen::AlignedBox3d& reach, uint64_t seed) {
  Random random(seed);
  SampledScene scene;
  const auto all = static_cast<int64_t>(poses.size());
  int64_t touching = 0;
  // A scene that blocks nothing, or nearly everything, is no measure.
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    scene.obstacles.clear();
    const auto spread = static_cast<size_t>(samples.most_obstacles - samples.least_obstacles);
    const size_t count = static_cast<size_t>(samples.least_obstacles) + Below(spread + 1, random);
    for (size_t i = 0; i < count; ++i) {
      scene.obstacles.push_back(RandomObstacle(samples, reach, random));
    }
    const ContactChecker checker(robot, scene.obstacles);
    const Poses obstacle_poses = ObstaclePoses(scene.obstacles, 0);
    scene.touching.assign((poses.size() + 63) / 64, 0);
    for (size_t q = 0; q < poses.size(); ++q) {
      if (checker.Check(poses[q], obstacle_poses).touching) {
        scene.touching[q / 64] |= uint64_t{1} << (q % 64);
      }
    }
    touching = CountBits(scene.touching);
    if (touching > 0 && touching < all * 9 / 10) break;
  }
  if (touching == all) return std::nullopt;
  do {
    scene.current = Below(poses.size(), random);
  } while ((scene.touching[scene.current / 64] >> (scene.current % 64) & 1) != 0);
  return scene;
}

bool Has(const CameraSet& set, int camera) {
  return std::find(set.begin(), set.end(), camera) != set.end();
}

// Replaces `best` by the best of `sets` if that is better; whether it was.
bool Improve(const std::vector<CameraSet>& sets, const Evaluate& evaluate, Selection& best) {
  const std::vector<Measures> measures = evaluate(sets);
  bool improved = false;
  for (size_t i = 0; i < sets.size(); ++i) {
    if (!best.cameras.empty() && !measures[i].BetterThan(best.measures)) continue;
    best = {sets[i], measures[i]};
    improved = true;
  }
  return improved;
}

}  // namespace

absl::StatusOr<Trials> Trials::Make(const RobotModel& robot, const ConfigurationGrid& grid,
                                    const PositionsAt& positions_at, const Places& places,
                                    const OnProgress& progress) {
  Random random(places.samples.seed);
  const std::vector<Solid> solids = SolidsOf(BodyPartsOf(robot));
  std::vector<Poses> poses;
  std::vector<Poses> looked_at;  // the extremes, too
  Bounds bounds;
  const auto pose_at = [&](const Configuration& q) -> absl::StatusOr<Poses> {
    ASSIGN_OR_RETURN(const auto positions, positions_at(q));
    return robot.LinkPoses(positions);
  };
  const auto numbers =
      SampleNumbers(grid, static_cast<size_t>(places.samples.configurations), random);
  for (ConfigurationNumber number : numbers) {
    ASSIGN_OR_RETURN(const Poses pose, pose_at(grid.At(number)));
    poses.push_back(pose);
  }
  looked_at = poses;
  for (const Configuration& q : ExtremeConfigurations(grid)) {
    ASSIGN_OR_RETURN(const Poses pose, pose_at(q));
    looked_at.push_back(pose);
  }
  for (const Poses& pose : looked_at) bounds.Add(solids, pose);

  Trials trials;
  trials.configurations_ = poses.size();
  trials.footprint_ = HullOf(bounds.footprint);
  for (size_t i = 0; i < places.candidates.size(); ++i) {
    const CameraModel& camera = places.candidates[i].camera;
    if (std::all_of(looked_at.begin(), looked_at.end(),
                    [&](const Poses& pose) { return IsWhole(solids, pose, camera); })) {
      trials.usable_.push_back(static_cast<int>(i));
      trials.cameras_.push_back(camera);
    }
  }
  if (trials.usable_.empty()) {
    return absl::FailedPreconditionError(
        "no place has the whole robot in its image; move the places away, or widen field_of_view");
  }

  std::atomic<uint64_t> done{0};
  const size_t scene_count = 2 * static_cast<size_t>(places.samples.scenes);
  const uint64_t total = scene_count + trials.cameras_.size();
  // What each scene consists of must not depend on which thread makes it.
  std::vector<uint64_t> seeds;
  for (size_t i = 0; i < scene_count; ++i) seeds.push_back(random());
  std::vector<SampledScene> scenes(scene_count);
  std::atomic<bool> always_touching{false};
  const bool sampled = ParallelWhile(scene_count, [&](size_t i) {
    auto scene = SampleScene(robot, poses, places.samples, bounds.box, seeds[i]);
    if (!scene) {
      always_touching = true;
      return false;
    }
    scenes[i] = *std::move(scene);
    return progress(++done, total);
  });
  if (always_touching) {
    return absl::FailedPreconditionError(
        "in a sampled scene the robot touches an obstacle at every configuration; allow fewer or "
        "smaller obstacles");
  }
  trials.robot_images_.resize(trials.cameras_.size());
  std::vector<std::vector<Mask>> foreground(trials.cameras_.size());
  std::vector<std::vector<Solid>> solid_obstacles;
  for (const SampledScene& scene : scenes) {
    solid_obstacles.push_back(SolidsOf(ObstacleParts(scene.obstacles)));
  }
  const auto draw = [&](size_t camera) {
    const CameraModel& model = trials.cameras_[camera];
    for (const Poses& pose : poses) {
      trials.robot_images_[camera].push_back(SilhouetteOf(solids, pose, model));
    }
    for (size_t i = 0; i < scene_count; ++i) {
      const Poses at = ObstaclePoses(scenes[i].obstacles, 0);
      foreground[camera].push_back(trials.robot_images_[camera][scenes[i].current] |
                                   SilhouetteOf(solid_obstacles[i], at, model));
    }
    return progress(++done, total);
  };
  if (!sampled || !ParallelWhile(trials.cameras_.size(), draw)) {
    return absl::AbortedError("stopped; start it again to have a result");
  }
  for (size_t i = 0; i < scene_count; ++i) {
    Scene& scene =
        trials.scenes_.emplace_back(Scene{scenes[i].current, std::move(scenes[i].touching), {}});
    for (size_t camera = 0; camera < trials.cameras_.size(); ++camera) {
      scene.obstacle_images.push_back(ObstacleImage::FromScene(
          foreground[camera][i], trials.robot_images_[camera][scene.current]));
    }
  }
  return trials;
}

Measures Trials::MeasuresOf(const CameraSet& cameras, const Policy& policy, Scenes scenes) const {
  std::vector<MaskSize> sizes;
  Calibration calibration;
  for (int camera : cameras) {
    const CameraModel& model = cameras_[static_cast<size_t>(camera)];
    sizes.push_back({model.intrinsics().width, model.intrinsics().height});
    calibration.cameras.push_back(model);
  }
  // One joint whose values are the sampled configurations; they fit into one tile.
  const ConfigurationGrid grid({{.name = "sample",
                                 .lower = 0,
                                 .upper = configurations_ > 1 ? 1.0 : 0.0,
                                 .steps = static_cast<int>(configurations_)}});
  RobotImageTable::Builder builder(grid, sizes, configurations_);
  for (size_t q = 0; q < configurations_; ++q) {
    std::vector<Mask> masks;
    for (int camera : cameras) masks.push_back(robot_images_[static_cast<size_t>(camera)][q]);
    builder.Add(q, masks);
  }
  const RobotImageTable table = std::move(builder).Build();
  std::optional<EpipolarBands> bands;
  if (IsCalibrated(policy.preset)) bands.emplace(calibration, sizes);
  const TestSupport support{.bands = bands ? &*bands : nullptr};

  Measures measures;
  const size_t half = scenes_.size() / 2;
  const std::span<const Scene> all(scenes_);
  for (const Scene& scene : scenes == Scenes::kFresh ? all.subspan(half) : all.first(half)) {
    ObstacleImages images;
    for (int camera : cameras)
      images.emplace_back(scene.obstacle_images[static_cast<size_t>(camera)]);
    const TileVerdicts verdicts = CollisionChecker(table, images, policy, support).CheckTile(0);
    for (size_t word = 0; word < scene.touching.size(); ++word) {
      measures.occupied += std::popcount(scene.touching[word]);
      measures.missing += std::popcount(verdicts.free[word] & scene.touching[word]);
      measures.additional += std::popcount(verdicts.occupied[word] & ~scene.touching[word]);
    }
    measures.tested += static_cast<int64_t>(configurations_);
  }
  return measures;
}

std::vector<Selection> Select(int candidates, int count, const Evaluate& evaluate,
                              const std::function<bool()>& stop) {
  std::vector<Selection> selections;
  CameraSet before;
  while (static_cast<int>(selections.size()) < std::min(count, candidates)) {
    std::vector<CameraSet> larger;
    for (int camera = 0; camera < candidates; ++camera) {
      if (Has(before, camera)) continue;
      larger.push_back(before);
      larger.back().push_back(camera);
    }
    if (stop()) return selections;
    Selection best;
    Improve(larger, evaluate, best);
    // The camera just added was compared with all others already, if it was the only one.
    for (bool better = best.cameras.size() > 1; better;) {
      std::vector<CameraSet> exchanged;
      for (size_t place = 0; place < best.cameras.size(); ++place) {
        for (int camera = 0; camera < candidates; ++camera) {
          if (Has(best.cameras, camera)) continue;
          exchanged.push_back(best.cameras);
          exchanged.back()[place] = camera;
        }
      }
      if (stop()) return selections;
      better = !exchanged.empty() && Improve(exchanged, evaluate, best);
    }
    before = best.cameras;
    selections.push_back(std::move(best));
  }
  return selections;
}

}  // namespace silhouette
