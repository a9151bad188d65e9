// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/sphere_cell.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace silhouette::paper {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr int kMostDraws = 1000;

// Numbers from 0 to 1 that are the same on every machine.
class RandomNumbers {
 public:
  explicit RandomNumbers(uint64_t seed) : state_(seed) {}

  // SplitMix64 (Steele, Lea, Flood 2014).
  double Next() {
    state_ += 0x9e3779b97f4a7c15;
    uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    z ^= z >> 31;
    return static_cast<double>(z >> 11) * 0x1p-53;
  }
  double Between(double from, double to) { return from + (to - from) * Next(); }
  // `from` to `to`, both included.
  int WholeBetween(int from, int to) {
    return std::min(to, from + static_cast<int>(Next() * (to - from + 1)));
  }

 private:
  uint64_t state_;
};

Spheres RandomObstacles(const RandomScenes& range, RandomNumbers& random) {
  Spheres spheres(static_cast<size_t>(random.WholeBetween(range.spheres[0], range.spheres[1])));
  for (Sphere& sphere : spheres) {
    sphere.radius = random.Between(range.radius[0], range.radius[1]);
    for (int axis = 0; axis < 3; ++axis) {
      sphere.centre[axis] = random.Between(-range.box, range.box);
    }
  }
  return spheres;
}

EpipolarBands BandsOf(std::span<const ParallelCamera> cameras) {
  std::vector<MaskSize> sizes;
  for (const ParallelCamera& camera : cameras) sizes.push_back(camera.mask_size());
  return EpipolarBands(CalibrationOf(cameras), sizes);
}

}  // namespace

ArmTable::ArmTable(const Settings& settings, Variant variant)
    : shape_(settings.arm), variant_(variant), steps_(settings.steps) {
  const double step = kTurn / steps_;
  for (int a = 0; a < steps_; ++a) {
    for (int b = 0; b < steps_; ++b) arms_.push_back(AtJoints({a * step, b * step}));
  }
}

std::array<size_t, 4> ArmTable::CellFrom(size_t index) const {
  const auto steps = static_cast<size_t>(steps_);
  const size_t a = index / steps;
  const size_t b = index % steps;
  const size_t next_a = (a + 1) % steps;
  const size_t next_b = (b + 1) % steps;
  return {index, a * steps + next_b, next_a * steps + b, next_a * steps + next_b};
}

std::array<double, 2> ArmTable::JointsIn(size_t index, std::array<double, 2> offset) const {
  const auto steps = static_cast<size_t>(steps_);
  return {(static_cast<double>(index / steps) + offset[0]) * kTurn / steps_,
          (static_cast<double>(index % steps) + offset[1]) * kTurn / steps_};
}

size_t ArmTable::CellOf(std::array<double, 2> q) const {
  const auto step = [&](double value) {
    return static_cast<size_t>(std::floor(value / kTurn * steps_)) % static_cast<size_t>(steps_);
  };
  return step(q[0]) * static_cast<size_t>(steps_) + step(q[1]);
}

size_t ArmTable::Nearest(std::array<double, 2> q) const {
  const auto step = [&](double value) {
    const long nearest = std::lround(value / kTurn * steps_) % steps_;
    return static_cast<size_t>(nearest < 0 ? nearest + steps_ : nearest);
  };
  return step(q[0]) * static_cast<size_t>(steps_) + step(q[1]);
}

ConfigurationSet ArmTable::Touching(std::span<const Sphere> obstacles) const {
  return Where([&](size_t i) { return Touch(arms_[i], obstacles); });
}

ConfigurationSet ArmTable::TouchingOffGrid(std::span<const Sphere> obstacles,
                                           std::span<const std::array<double, 2>> offsets) const {
  return Where([&](size_t i) { return Touch(AtJoints(JointsIn(i, offsets[i])), obstacles); });
}

SphereScene RandomScene(const Settings& settings, const ArmTable& arms, int number) {
  RandomNumbers random(settings.random.seed * 0x100000001b3 + static_cast<uint64_t>(number));
  SphereScene scene;
  std::vector<size_t> free;
  for (int draws = 0; free.empty(); ++draws) {
    if (draws == kMostDraws) {
      throw std::invalid_argument("random obstacles leave the robot no free configuration");
    }
    scene.obstacles = RandomObstacles(settings.random, random);
    for (size_t i = 0; i < arms.size(); ++i) {
      if (!Touch(arms.At(i), scene.obstacles)) free.push_back(i);
    }
  }
  scene.current = free[static_cast<size_t>(random.WholeBetween(0, int(free.size()) - 1))];
  // A free configuration of the grid has free ones around it, so that this ends.
  do {
    scene.current_off_grid = {random.Between(0, kTurn), random.Between(0, kTurn)};
  } while (Touch(arms.AtJoints(scene.current_off_grid), scene.obstacles));
  scene.offsets.resize(arms.size());
  for (std::array<double, 2>& offset : scene.offsets) offset = {random.Next(), random.Next()};
  return scene;
}

SphereCell::SphereCell(const ArmTable& arms, std::vector<ParallelCamera> cameras, Raster raster)
    : arms_(arms),
      cameras_(std::move(cameras)),
      raster_(raster),
      bands_(BandsOf(cameras_)),
      lines_(bands_),
      robot_images_(cameras_.size()) {
  for (size_t view = 0; view < cameras_.size(); ++view) {
    std::vector<Mask>& images = robot_images_[view];
    for (size_t i = 0; i < arms.size(); ++i) {
      images.push_back(ImageOf(cameras_[view], arms.At(i), raster));
    }
    on_grid_.emplace_back(images);
    std::vector<Mask>& unions = cell_images_.emplace_back();
    for (size_t i = 0; i < arms.size(); ++i) {
      const auto [c0, c1, c2, c3] = arms.CellFrom(i);
      unions.push_back(images[c0] | images[c1] | images[c2] | images[c3]);
    }
    in_cells_.emplace_back(unions);
  }
}

std::vector<ObstacleImage> SphereCell::Look(std::span<const Sphere> obstacles,
                                            size_t current) const {
  std::vector<ObstacleImage> images;
  for (int view = 0; view < views(); ++view) {
    const Mask& robot = RobotImages(view)[current];
    images.push_back(ObstacleImage::FromScene(ImageIn(view, obstacles) | robot, robot));
  }
  return images;
}

std::vector<ObstacleImage> SphereCell::LookOffGrid(std::span<const Sphere> obstacles,
                                                   std::array<double, 2> current) const {
  const Spheres robot = arms_.AtJoints(current);
  const size_t cell = arms_.CellOf(current);
  const auto [c0, c1, c2, c3] = arms_.CellFrom(cell);
  std::vector<ObstacleImage> images;
  for (int view = 0; view < views(); ++view) {
    const std::span<const Mask> at = RobotImages(view);
    images.push_back(ObstacleImage::FromScene(ImageIn(view, obstacles) | ImageIn(view, robot),
                                              CellImages(view)[cell],
                                              at[c0] & at[c1] & at[c2] & at[c3]));
  }
  return images;
}

}  // namespace silhouette::paper
