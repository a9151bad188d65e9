// SPDX-License-Identifier: Apache-2.0
// The simulated cell of §4.1: the arm at every configuration, scenes, and what the cameras of one
// rig see of them. Cannot be changed once made; used by any number of threads.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "server/collision/epipolar_bands.h"
#include "server/collision/obstacle_image.h"
#include "tools/silhouette-experiments/paper/bulk_checker.h"
#include "tools/silhouette-experiments/paper/settings.h"

namespace silhouette::paper {

// The arm at every configuration of its grid. A configuration's index is a * steps + b for step a
// of the first joint and b of the second.
class ArmTable {
 public:
  ArmTable(const Settings& settings, Variant variant);

  Variant variant() const { return variant_; }
  int steps() const { return steps_; }
  size_t size() const { return arms_.size(); }
  const Spheres& At(size_t index) const { return arms_[index]; }
  Spheres AtJoints(std::array<double, 2> q) const { return ArmAt(shape_, variant_, q[0], q[1]); }
  // The indices of the grid cell's corners whose lowest is `index`: the joints go round.
  std::array<size_t, 4> CellFrom(size_t index) const;
  // Joint values in that grid cell, `offset` steps above its lowest corner.
  std::array<double, 2> JointsIn(size_t index, std::array<double, 2> offset) const;
  // The index of the grid point nearest to the joint values.
  size_t Nearest(std::array<double, 2> q) const;
  // The index whose grid cell holds the joint values, not below 0.
  size_t CellOf(std::array<double, 2> q) const;

  // The configurations for which `holds(index)`.
  template <typename Holds>
  ConfigurationSet Where(Holds holds) const {
    ConfigurationSet set(WordsFor(size()), 0);
    for (size_t i = 0; i < size(); ++i) {
      if (holds(i)) Insert(set, i);
    }
    return set;
  }
  // The ideal test on the whole grid.
  ConfigurationSet Touching(std::span<const Sphere> obstacles) const;
  // And in every grid cell at JointsIn(index, offsets[index]).
  ConfigurationSet TouchingOffGrid(std::span<const Sphere> obstacles,
                                   std::span<const std::array<double, 2>> offsets) const;

 private:
  ArmShape shape_;
  Variant variant_;
  int steps_;
  std::vector<Spheres> arms_;
};

struct SphereScene {
  Spheres obstacles;
  // The index of a configuration of the grid that touches no obstacle.
  size_t current = 0;
  // Joint values of another that touches none, off the grid.
  std::array<double, 2> current_off_grid{};
  // Where in the grid cell that begins at each index a test configuration off the grid lies: shares
  // of the step.
  std::vector<std::array<double, 2>> offsets;
};

// Random scene `number`, 0 to settings.random.count - 1. Obstacles are drawn again where they leave
// the robot no free configuration on the grid. Throws std::invalid_argument if they always do.
SphereScene RandomScene(const Settings& settings, const ArmTable& arms, int number);

// One robot, one rig of cameras and one way to raster.
class SphereCell {
 public:
  // `arms` must outlive the cell.
  SphereCell(const ArmTable& arms, std::vector<ParallelCamera> cameras, Raster raster);

  const ArmTable& arms() const { return arms_; }
  int views() const { return static_cast<int>(cameras_.size()); }
  std::span<const ParallelCamera> cameras() const { return cameras_; }
  const EpipolarBands& bands() const { return bands_; }
  const LineTables& lines() const { return lines_; }
  Raster raster() const { return raster_; }

  // Per configuration of the grid.
  std::span<const Mask> RobotImages(int view) const {
    return robot_images_[static_cast<size_t>(view)];
  }
  // Their unions over the corners of the grid cell that begins at each configuration.
  std::span<const Mask> CellImages(int view) const {
    return cell_images_[static_cast<size_t>(view)];
  }
  // Per view: the robot images and the cell images.
  std::span<const TransposedImages> OnGrid() const { return on_grid_; }
  std::span<const TransposedImages> InCells() const { return in_cells_; }

  Mask ImageIn(int view, std::span<const Sphere> spheres) const {
    return ImageOf(cameras_[static_cast<size_t>(view)], spheres, raster_);
  }

  // The obstacle images of a scene, per view: with the robot at a configuration of the grid, and
  // anywhere.
  std::vector<ObstacleImage> Look(std::span<const Sphere> obstacles, size_t current) const;
  std::vector<ObstacleImage> LookOffGrid(std::span<const Sphere> obstacles,
                                         std::array<double, 2> current) const;

 private:
  const ArmTable& arms_;
  std::vector<ParallelCamera> cameras_;
  Raster raster_;
  EpipolarBands bands_;
  LineTables lines_;
  std::vector<std::vector<Mask>> robot_images_;
  std::vector<std::vector<Mask>> cell_images_;
  std::vector<TransposedImages> on_grid_;
  std::vector<TransposedImages> in_cells_;
};

}  // namespace silhouette::paper
