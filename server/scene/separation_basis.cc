// SPDX-License-Identifier: Apache-2.0
#include "server/scene/separation_basis.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "calib/robot/drawn_cell.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Distances are looked at up to where the fastest level keeps its own with an image of this age, s.
constexpr double kOldImage = 0.5;

absl::StatusOr<std::shared_ptr<const DrawnRobot>> BodyOf(
    const SoundCell& cell, const storage::v1::CellDescription& description,
    const RobotImageTable& robot_images, const Calibration& calibration, double margin,
    double fixed_joint_tolerance) {
  if (robot_images.drawn() != nullptr) return robot_images.drawn();
  const DrawnCell drawn{
      .robot = cell.robot,
      .parts = {.geometry = cell.settings.geometry, .tolerance = cell.settings.model_tolerance},
      .payload_radius = cell.payload_radius,
      // The robot images' from where the cell has it, and the scene's from there.
      .fixed_joint_tolerance = 2 * fixed_joint_tolerance};
  std::vector<std::string> moving;
  for (const GridJoint& joint : robot_images.grid().joints()) moving.push_back(joint.name);
  std::vector<FixedJoint> fixed;
  for (const auto& joint : description.fixed_joints()) {
    fixed.push_back({joint.name(), joint.position()});
  }
  ASSIGN_OR_RETURN(DrawnRobot robot, DrawnRobotOf(drawn, moving, fixed, calibration,
                                                  robot_images.mask_sizes(), margin));
  return std::make_shared<const DrawnRobot>(std::move(robot));
}

Eigen::AlignedBox3d ZoneOf(const SoundCell& cell, double range) {
  Eigen::AlignedBox3d zone = cell.workspace;
  if (cell.separation->zone) return zone.extend(*cell.separation->zone);
  const Eigen::Vector3d around = Eigen::Vector3d::Constant(range);
  return {zone.min() - around, zone.max() + around};
}

double EdgeOf(const SoundCell& cell, const Eigen::AlignedBox3d& zone) {
  const double rho = cell.settings.least_obstacle;
  const double fitting = std::cbrt(zone.volume() / SeparationBasis::kVoxelsByDefault);
  return cell.separation->voxel_edge.value_or(std::clamp(fitting, rho / 6, rho / 3));
}

void KeepOnly(VoxelSet& voxels, const VoxelSet& kept) {
  for (size_t i = 0; i < voxels.words().size(); ++i) voxels.words()[i] &= kept.words()[i];
}

// The voxels of `grid` in which all is reached (VoxelSpace) by the robot.
VoxelSet WhollyIn(const VoxelSpace& space, const VoxelGrid& grid) {
  const OtherGrid other(grid, space.grid());
  const VoxelSet& reached = space.reached();
  VoxelSet in(grid);
  const auto all_reached = [&](std::pair<int, int> x, std::pair<int, int> y,
                               std::pair<int, int> z) {
    for (int at_z = z.first; at_z <= z.second; ++at_z) {
      for (int at_y = y.first; at_y <= y.second; ++at_y) {
        for (int at_x = x.first; at_x <= x.second; ++at_x) {
          if (!reached.at(at_x, at_y, at_z)) return false;
        }
      }
    }
    return true;
  };
  for (int z = 0; z < grid.size(2); ++z) {
    for (int y = 0; y < grid.size(1); ++y) {
      for (int x = 0; x < grid.size(0); ++x) {
        const Eigen::AlignedBox3d box = grid.Box(x, y, z);
        const Eigen::Vector3d low = (box.min() - space.grid().lower()) / space.grid().edge();
        const Eigen::Vector3d high = (box.max() - space.grid().lower()) / space.grid().edge();
        const bool inside = low.minCoeff() >= 0 && high.x() <= space.grid().size(0) &&
                            high.y() <= space.grid().size(1) && high.z() <= space.grid().size(2);
        if (inside && all_reached(other.Touched(0, x), other.Touched(1, y), other.Touched(2, z))) {
          in.Insert(x, y, z);
        }
      }
    }
  }
  return in;
}

}  // namespace

SeparationBasis::SeparationBasis(const SeparationCell& cell,
                                 std::shared_ptr<const SoundBasis> sound,
                                 std::shared_ptr<const DrawnRobot> robot, VoxelSpace space,
                                 double range)
    : settings_(cell.settings),
      sound_(std::move(sound)),
      robot_(std::move(robot)),
      space_(std::move(space)),
      range_(range) {
  VoxelSet seen = space_.reached();
  KeepOnly(seen, space_.seen());
  const auto all = static_cast<double>(space_.reached().Count());
  unseen_share_ = all > 0 ? 1 - static_cast<double>(seen.Count()) / all : 0;
  unseen_is_empty_ = cell.unseen_is_empty;
  counted_ = unseen_is_empty_ ? std::move(seen) : space_.reached();
  const VoxelSet near = WhollyIn(sound_->space(), space_.grid());
  for (size_t i = 0; i < near.words().size(); ++i) counted_.words()[i] &= ~near.words()[i];
}

absl::StatusOr<std::shared_ptr<const SeparationBasis>> SeparationBasis::Make(
    const SoundCell& cell, std::shared_ptr<const SoundBasis> sound,
    const storage::v1::CellDescription& description, const RobotImageTable& robot_images,
    const Calibration& calibration, double margin, double fixed_joint_tolerance) {
  ASSIGN_OR_RETURN(auto robot, BodyOf(cell, description, robot_images, calibration, margin,
                                      fixed_joint_tolerance));
  try {
    const SeparationCell& separation = *cell.separation;
    RequireValid(separation.settings);
    const SpeedLevel& fastest = separation.settings.levels.back();
    const double range = ProtectiveDistance(separation.settings, fastest, kOldImage) +
                         WayToStop(separation.settings, fastest, kOldImage);
    const Eigen::AlignedBox3d zone = ZoneOf(cell, range);
    const double edge = EdgeOf(cell, zone);
    if (zone.volume() / (edge * edge * edge) > SoundBasis::kMostVoxels) {
      throw std::invalid_argument(
          "the zone has too many voxels; state a smaller zone, or a "
          "greater voxel_edge");
    }
    VoxelSpace space(zone, cell.settings.least_obstacle,
                     ViewsOfSpace(description, robot_images, calibration, margin), edge);
    std::shared_ptr<SeparationBasis> basis(new SeparationBasis(
        separation, std::move(sound), std::move(robot), std::move(space), range));
    if (!separation.zone) basis->known_ = zone;
    return std::shared_ptr<const SeparationBasis>(std::move(basis));
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(absl::StrCat("separation: ", error.what()));
  }
}

SpaceDistances SeparationBasis::DistancesIn(const PossibleSpace& near, const ObstacleImages& images,
                                            std::span<const JointPosition> joints,
                                            std::span<const std::optional<Mask>> allowed,
                                            int max_occluded_views) const {
  VoxelSet people =
      PossibleVoxels(space_, images, sound_->RobotAt(joints), allowed, max_occluded_views)
          .remaining;
  KeepOnly(people, counted_);
  VoxelSet close = near.remaining();
  if (unseen_is_empty_) KeepOnly(close, near.space().seen());
  return SpaceDistances({{people, space_.grid()}, {close, near.space().grid()}}, range_, known_);
}

}  // namespace silhouette
