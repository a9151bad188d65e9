// SPDX-License-Identifier: Apache-2.0
// What speed and separation rest on, of one variant of a database: the space about the robot as the
// views see it, and the robot's body.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/mask.h"
#include "server/collision/obstacle_image.h"
#include "server/collision/possible_space.h"
#include "server/collision/robot_image_table.h"
#include "server/collision/separation.h"
#include "server/collision/space_distances.h"
#include "server/collision/voxel_space.h"
#include "server/scene/joint_position.h"
#include "server/scene/sound_basis.h"
#include "server/scene/sound_settings.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// Cannot be changed once made; used by any number of threads.
class SeparationBasis {
 public:
  // Voxels of the zone if the cell does not state their edge.
  static constexpr double kVoxelsByDefault = 1e6;

  // `cell` states separation; its robot and body count here, too. Of `sound`, made from the same.
  // `fixed_joint_tolerance`: as in LoadSettings.
  // InvalidArgument: the zone, the workspace or an edge cannot be, or as DrawnRobotOf
  // (drawn_cell.h).
  static absl::StatusOr<std::shared_ptr<const SeparationBasis>> Make(
      const SoundCell& cell, std::shared_ptr<const SoundBasis> sound,
      const storage::v1::CellDescription& description, const RobotImageTable& robot_images,
      const Calibration& calibration, double margin, double fixed_joint_tolerance);

  const SeparationSettings& settings() const { return settings_; }
  // Larger than the robot, tool and payload included, by its tolerance. Joints of the grid.
  const DrawnRobot& robot() const { return *robot_; }
  const VoxelGrid& grid() const { return space_.grid(); }
  // The share of the zone that no view sees.
  double unseen_share() const { return unseen_share_; }
  // Distances are at most this, metres.
  double range() const { return range_; }
  // Metres: the diameter of the least obstacle. From a beginning that is nearer to people no path
  // is said to lead away: something thinner, such as a hand that the robot hides, may be nearer
  // than the distance (docs/separation.md).
  double leave_from() const { return 2 * space_.least_obstacle(); }

  // From what may hold somebody in a scene: what PossibleSpace leaves of the zone. `near`: what it
  // leaves where the robot reaches, in the finer voxels of the sound presets. The other arguments
  // as those of ScenePossibleSpace::Get.
  SpaceDistances DistancesIn(const PossibleSpace& near, const ObstacleImages& images,
                             std::span<const JointPosition> joints,
                             std::span<const std::optional<Mask>> allowed,
                             int max_occluded_views) const;

 private:
  SeparationBasis(const SeparationCell& cell, std::shared_ptr<const SoundBasis> sound,
                  std::shared_ptr<const DrawnRobot> robot, VoxelSpace space, double range);

  SeparationSettings settings_;
  std::shared_ptr<const SoundBasis> sound_;
  std::shared_ptr<const DrawnRobot> robot_;
  VoxelSpace space_;
  VoxelSet counted_;  // where people may be and the robot does not reach
  // Beyond it people may be anywhere; nothing: they are not.
  std::optional<Eigen::AlignedBox3d> known_;
  bool unseen_is_empty_ = false;
  double unseen_share_ = 0;
  double range_;
};

}  // namespace silhouette
