// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/bulk_sound_checker.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace silhouette::paper {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

// All that the robot reaches.
AlignedBox3d WorkspaceOf(const ArmTable& arms) {
  AlignedBox3d box;
  for (size_t i = 0; i < arms.size(); ++i) {
    for (const Sphere& sphere : arms.At(i)) {
      box.extend(sphere.centre - Vector3d::Constant(sphere.radius));
      box.extend(sphere.centre + Vector3d::Constant(sphere.radius));
    }
  }
  return box;
}

std::vector<VoxelView> ViewsOf(const SphereCell& cell) {
  std::vector<VoxelView> views;
  for (int view = 0; view < cell.views(); ++view) {
    const ParallelCamera& camera = cell.cameras()[static_cast<size_t>(view)];
    Mask any(camera.mask_size());
    Mask every = ~any;
    for (const Mask& image : cell.RobotImages(view)) {
      any = any | image;
      every = every & image;
    }
    views.push_back({.mask_size = camera.mask_size(),
                     .project =
                         [camera](const Vector3d& point) {
                           return std::optional<Eigen::Vector2d>(camera.Project(point));
                         },
                     .swept = any,
                     .permanent = every});
  }
  return views;
}

bool Touches(const VoxelGrid& grid, const Sphere& sphere, int x, int y, int z) {
  return grid.Box(x, y, z).squaredExteriorDistance(sphere.centre) <= sphere.radius * sphere.radius;
}

// Appends the rows of voxels that a sphere touches.
void AppendRows(const VoxelGrid& grid, const Sphere& sphere, std::vector<SoundSpace::Row>& rows) {
  const auto voxel = [&](int axis, double at) {
    const double index = std::floor((at - grid.lower()[axis]) / grid.edge());
    return static_cast<int>(std::clamp(index, 0.0, grid.size(axis) - 1.0));
  };
  const auto lowest = [&](int axis) { return voxel(axis, sphere.centre[axis] - sphere.radius); };
  const auto highest = [&](int axis) { return voxel(axis, sphere.centre[axis] + sphere.radius); };
  for (int z = std::max(0, lowest(2) - 1); z <= highest(2); ++z) {
    for (int y = std::max(0, lowest(1) - 1); y <= highest(1); ++y) {
      int first = std::max(0, lowest(0) - 1);
      int last = highest(0);
      while (first <= last && !Touches(grid, sphere, first, y, z)) ++first;
      while (first <= last && !Touches(grid, sphere, last, y, z)) --last;
      if (first > last) continue;
      rows.push_back({static_cast<uint16_t>(y), static_cast<uint16_t>(z),
                      static_cast<uint16_t>(first), static_cast<uint16_t>(last)});
    }
  }
}

// Whether visit(x, y, z) holds for any voxel of the rows that is in the set.
template <typename Visit>
bool AnyTouched(const VoxelSet& set, std::span<const SoundSpace::Row> rows, Visit visit) {
  for (const SoundSpace::Row& row : rows) {
    const std::span<const uint64_t> words = set.row(row.y, row.z);
    for (size_t word = row.first / 64; word <= row.last / 64u; ++word) {
      uint64_t bits = words[word];
      if (word == row.first / 64) bits &= ~uint64_t{0} << (row.first % 64);
      if (word == row.last / 64u) bits &= ~uint64_t{0} >> (63 - row.last % 64);
      for (; bits != 0; bits &= bits - 1) {
        if (visit(static_cast<int>(word) * 64 + std::countr_zero(bits), row.y, row.z)) return true;
      }
    }
  }
  return false;
}

// The configurations whose images the planes of a part meet, in all views with an image.
ConfigurationSet MetByPlanes(const PossibleSpace& possible,
                             std::span<const TransposedImages> robot) {
  const size_t words = robot[0].words();
  ConfigurationSet met(words, 0);
  for (const PossibleSpace::Part& part : possible.parts()) {
    ConfigurationSet in_all(words, ~uint64_t{0});
    for (size_t view = 0; view < robot.size(); ++view) {
      if (!part.planes[view]) continue;
      ConfigurationSet in_view(words, 0);
      ForEachPixel(part.planes[view]->words(),
                   [&](size_t pixel) { Add(in_view, robot[view].Covering(pixel)); });
      if (part.beyond[view]) {
        ConfigurationSet shown(words, 0);
        for (size_t pixel = 0; pixel < robot[view].mask_size().pixels(); ++pixel) {
          Add(shown, robot[view].Covering(pixel));
        }
        for (size_t i = 0; i < words; ++i) in_view[i] |= ~shown[i];
      }
      for (size_t i = 0; i < words; ++i) in_all[i] &= in_view[i];
    }
    Add(met, in_all);
  }
  if (robot[0].configurations() % 64 != 0) {
    met.back() &= ~(~uint64_t{0} << (robot[0].configurations() % 64));
  }
  return met;
}

ObstacleImages Chosen(std::span<const ObstacleImage> images, ViewSet views) {
  ObstacleImages chosen(images.size());
  for (size_t view = 0; view < images.size(); ++view) {
    if ((views >> view & 1) != 0) chosen[view] = images[view];
  }
  return chosen;
}

}  // namespace

SoundSpace::SoundSpace(const SphereCell& cell, const SoundSettings& settings)
    : cell_(cell),
      space_(WorkspaceOf(cell.arms()), settings.least_radius, ViewsOf(cell), settings.edge),
      per_link_(cell.arms().At(0).size() / 2) {
  const ArmTable& arms = cell.arms();
  const auto steps = static_cast<size_t>(arms.steps());
  const auto add = [&](const Sphere& sphere) {
    starts_.push_back(rows_.size());
    AppendRows(space_.grid(), sphere, rows_);
  };
  // The first link's depend on the first joint only.
  for (size_t a = 0; a < steps; ++a) {
    for (size_t i = 0; i < per_link_; ++i) add(arms.At(a * steps)[i]);
  }
  for (size_t index = 0; index < arms.size(); ++index) {
    for (size_t i = 0; i < per_link_; ++i) add(arms.At(index)[per_link_ + i]);
  }
  starts_.push_back(rows_.size());
}

BodyDistance BodyOf(std::span<const Sphere> robot) {
  return [robot](const Vector3d& point) {
    double distance = std::numeric_limits<double>::infinity();
    for (const Sphere& sphere : robot) {
      distance = std::min(distance, (point - sphere.centre).norm() - sphere.radius);
    }
    return distance;
  };
}

std::span<const SoundSpace::Row> SoundSpace::Touched(size_t index, size_t sphere) const {
  const auto steps = static_cast<size_t>(cell_.arms().steps());
  const size_t place = sphere < per_link_ ? index / steps * per_link_ + sphere
                                          : (steps + index) * per_link_ + sphere - per_link_;
  return {rows_.data() + starts_[place], rows_.data() + starts_[place + 1]};
}

SoundVerdicts CheckSound(const SoundSpace& sound, std::span<const ObstacleImage> images,
                         ViewSet views, const BodyDistance& body, const Spheres* robot) {
  const SphereCell& cell = sound.cell();
  const bool in_cells = robot == nullptr;
  const ObstacleImages chosen = Chosen(images, views);
  const PossibleSpace possible(sound.space(), chosen, body);
  const int all = sound.space().views();
  SoundVerdicts verdicts{MetByPlanes(possible, in_cells ? cell.InCells() : cell.OnGrid()), {}};
  verdicts.voxels.assign(verdicts.planes.size(), 0);
  const bool any_always_met = !possible.always_met().Empty();
  std::vector<MaskWords> words(images.size());
  const auto touches = [&](size_t index, const VoxelSet& set, auto visit) {
    const Spheres& there = cell.arms().At(index);
    for (size_t i = 0; i < there.size(); ++i) {
      if (!in_cells && there[i].centre == (*robot)[i].centre) continue;
      if (AnyTouched(set, sound.Touched(index, i), visit)) return true;
    }
    return false;
  };
  for (size_t index = 0; index < cell.arms().size(); ++index) {
    if (any_always_met && !Contains(verdicts.planes, index)) {
      const auto any = [](int, int, int) { return true; };
      if (in_cells || touches(index, possible.always_met(), any)) Insert(verdicts.planes, index);
    }
    if (!Contains(verdicts.planes, index)) continue;
    for (int view = 0; view < cell.views(); ++view) {
      const auto robot_images = in_cells ? cell.CellImages(view) : cell.RobotImages(view);
      words[static_cast<size_t>(view)] = robot_images[index].words();
    }
    const auto in_images = [&](int x, int y, int z) {
      return possible.VoxelMeets(words, all, x, y, z);
    };
    // In a grid cell, a voxel that the body at its lowest corner touches is the likeliest; else
    // any.
    if (touches(index, possible.remaining(), in_images) ||
        (in_cells && possible.VoxelsMeet(words, all))) {
      Insert(verdicts.voxels, index);
    }
  }
  return verdicts;
}

}  // namespace silhouette::paper
