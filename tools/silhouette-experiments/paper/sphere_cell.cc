// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/sphere_cell.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace silhouette::paper {
namespace {

constexpr double kSphereCellTurn = 2 * std::numbers::pi;

EpipolarBands BandsOf(std::span<const ParallelCamera> cameras) {
  std::vector<MaskSize> sizes;
  for (const ParallelCamera& camera : cameras) sizes.push_back(camera.mask_size());
  return EpipolarBands(CalibrationOf(cameras), sizes);
}

}  // namespace

ArmTable::ArmTable(const Settings& settings, Variant variant)
    : shape_(settings.arm), variant_(variant), steps_(settings.steps) {
  const double step = kSphereCellTurn / steps_;
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
  return {(static_cast<double>(index / steps) + offset[0]) * kSphereCellTurn / steps_,
          (static_cast<double>(index % steps) + offset[1]) * kSphereCellTurn / steps_};
}

size_t ArmTable::CellOf(std::array<double, 2> q) const {
  const auto step = [&](double value) {
    return static_cast<size_t>(std::floor(value / kSphereCellTurn * steps_)) %
           static_cast<size_t>(steps_);
  };
  return step(q[0]) * static_cast<size_t>(steps_) + step(q[1]);
}

size_t ArmTable::Nearest(std::array<double, 2> q) const {
  const auto step = [&](double value) {
    const long nearest = std::lround(value / kSphereCellTurn * steps_) % steps_;
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
    std::vector<Mask> unions;
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
  const auto [c0, c1, c2, c3] = arms_.CellFrom(arms_.CellOf(current));
  std::vector<ObstacleImage> images;
  for (int view = 0; view < views(); ++view) {
    const std::span<const Mask> at = RobotImages(view);
    images.push_back(ObstacleImage::FromScene(ImageIn(view, obstacles) | ImageIn(view, robot),
                                              at[c0] | at[c1] | at[c2] | at[c3],
                                              at[c0] & at[c1] & at[c2] & at[c3]));
  }
  return images;
}

}  // namespace silhouette::paper
