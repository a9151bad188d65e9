// SPDX-License-Identifier: Apache-2.0
// What the sound presets rest on, of one generation of a database: space as the views see it, and
// the robot's own body.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "calib/robot/robot_body.h"
#include "server/collision/collision_checker.h"
#include "server/collision/possible_space.h"
#include "server/collision/robot_image_table.h"
#include "server/collision/voxel_space.h"
#include "server/scene/joint_position.h"
#include "server/scene/made_once.h"
#include "server/scene/sound_settings.h"
#include "server/scene/view_treatment.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// How the cameras see space, whatever the robot does. `margin`: as in SoundBasis::Make.
std::vector<VoxelView> ViewsOfSpace(const storage::v1::CellDescription& cell,
                                    const RobotImageTable& robot_images,
                                    const Calibration& calibration, double margin);

// Cannot be changed once made; used by any number of threads.
class SoundBasis {
 public:
  // Voxels that the workspace may have: what fits into memory.
  static constexpr double kMostVoxels = 1e8;

  // How far the joints of a drawn robot, whose grid may have hardly a step, move at most on a way
  // away from where it is: radians, metres. About a step of a grid of 10 cm.
  static constexpr double kDrawnWay = 0.1;

  // `calibration` must have a camera model per view. `margin`: pixels of the masks by which its
  // projection may err. `treatments`: of the views; what is ignored in captured images may hide the
  // robot. InvalidArgument: `sound` has a length that cannot be, a robot without geometry or
  // without a joint of the grid, or a least obstacle so small that there would be more voxels than
  // kMostVoxels.
  static absl::StatusOr<std::shared_ptr<const SoundBasis>> Make(
      const SoundCell& sound, const storage::v1::CellDescription& cell,
      const RobotImageTable& robot_images, const Calibration& calibration, double margin,
      std::span<const ViewTreatment> treatments);

  const VoxelSpace& space() const { return space_; }

  // TestSupport::workspace.
  const std::optional<Eigen::AlignedBox3d>& workspace() const { return workspace_; }

  // RobotBody::open_links().
  const std::vector<std::string>& open_links() const { return body_.open_links(); }

  // The least obstacle that the masks can tell from the robot, and by how much they must have more
  // pixels along each side for the one that is asked for (resolution.h).
  double resolvable_obstacle() const { return resolvable_obstacle_; }
  double mask_scale() const { return mask_scale_; }

  // The robot's own body; nothing is known of it if a joint of the model has no value. Refers to
  // this; a copy is to be used by one thread.
  BodyDistance RobotAt(std::span<const JointPosition> joints) const;

  // TestSupport::robot_may_touch while the robot stands at `joints`; null unless the model holds
  // the whole robot. What the robot does not touch now, it does not touch with the links that then
  // stand as they stand now. Between two configurations it is RobotBody::Between them: a box that
  // the robot touches at any place there is found. Refers to this.
  TestSupport::RobotMayTouch RobotMayTouch(std::span<const JointPosition> joints) const;

  // TestSupport::robot_may_meet while the robot stands at `joints`; null as above. `space`: of the
  // scene, and of this; must outlive it. A ball of the least obstacle that may be anywhere in space
  // is met only if a link moves towards it (PosedBody::MayMeet). For configurations up to one step
  // of the grid away along each joint; of a robot that is drawn, no farther than kDrawnWay.
  TestSupport::RobotMayMeet RobotMayMeet(std::span<const JointPosition> joints,
                                         const PossibleSpace& space) const;

 private:
  SoundBasis(const SoundCell& sound, const RobotImageTable& robot_images,
             std::vector<VoxelView> views);

  // Of the model's joints, in its order.
  struct ModelJoints {
    std::vector<double> positions;
    std::vector<double> half_ranges;
  };
  // Nothing if one has no value.
  std::optional<ModelJoints> JointsOf(std::span<const JointPosition> joints) const;
  // `now`, positions of the model's joints, with those of the grid at `q`.
  std::vector<double> PositionsAt(std::span<const double> now, std::span<const double> q) const;
  // The body between two configurations, other joints as they are now.
  PosedBody BodyBetween(std::span<const double> now, std::span<const double> from,
                        std::span<const double> to) const;
  // The body on its straight way from `now` to any configuration between the two; nothing if they
  // are more than a step of the grid away, or lie on either side of `now`.
  std::optional<PosedBody> BodyOnTheWay(std::span<const double> now, std::span<const double> from,
                                        std::span<const double> to) const;

  std::shared_ptr<const RobotModel> robot_;
  // By joint of the grid: its place among the joints of the model, and see RobotMayMeet.
  std::vector<size_t> model_joints_;
  std::vector<double> most_way_;
  bool whole_model_ = false;
  double resolvable_obstacle_ = 0;
  double mask_scale_ = 0;
  std::optional<Eigen::AlignedBox3d> workspace_;
  VoxelSpace space_;
  RobotBody body_;
};

// The possible space of one scene, found once for all who ask. Used by any number of threads. A
// copy starts empty.
class ScenePossibleSpace {
 public:
  // `basis`: of one of the variants of the scene's database. The other arguments belong to the
  // scene, and are always the same. `joints`, of the robot; `allowed`,
  // `max_occluded_views`: see PossibleSpace.
  const PossibleSpace& Get(const std::shared_ptr<const SoundBasis>& basis,
                           const ObstacleImages& images, std::span<const JointPosition> joints,
                           std::span<const std::optional<Mask>> allowed,
                           int max_occluded_views) const;

 private:
  // Of a variant's basis and max_occluded_views.
  EachMadeOnce<std::pair<std::shared_ptr<const SoundBasis>, int>, PossibleSpace> spaces_;
};

}  // namespace silhouette
