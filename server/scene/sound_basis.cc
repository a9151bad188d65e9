// SPDX-License-Identifier: Apache-2.0
#include "server/scene/sound_basis.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "server/collision/resolution.h"

namespace silhouette {
namespace {

// Steps of the body's distance fields in an edge of a voxel.
constexpr double kStepsPerEdge = 3;
constexpr double kLeastStep = 0.005;  // metres
// A camera image is looked at in the centres of its pixels: a rim that lies between them is missed.
constexpr double kRim = 0.5;  // camera pixels
// How often the edges of a box are halved at most to see whether the body touches it.
constexpr int kHalvings = 2;

// A joint moves by no more than this, radians or metres, on a way that begins at its value.
constexpr double kSameJoint = 1e-6;
// The body's movement while it leaves a place is resolved to this share of an edge of a voxel.
constexpr double kFineMovement = 0.125;

// The pixels that the robot covers in any, and in every configuration that is there.
struct CoveredPixels {
  CoveredPixels(const RobotImageTable& images, int view)
      : any(images.covered(view)), every(images.permanent(view)) {
    if (any.Empty()) every = ~any;
  }

  Mask any;
  Mask every;
};

absl::Status CheckCell(const SoundCell& sound) {
  const SoundSettings& settings = sound.settings;
  // As far as the model goes, such a robot would touch nothing.
  if (std::ranges::all_of(sound.robot->links(),
                          [&](const RobotLink& link) { return link.body().empty(); })) {
    return absl::InvalidArgumentError(
        absl::StrCat("sound: the robot '", sound.robot->name(),
                     "' has no visual or collision geometry in its URDF; add it, or leave the "
                     "section 'sound' out"));
  }
  if (!(settings.least_obstacle > 0) || !(sound.VoxelEdge() > 0) ||
      !(settings.model_tolerance >= 0) || !(sound.workspace.sizes().minCoeff() > 0)) {
    return absl::InvalidArgumentError(
        "sound: the least obstacle, the edge of the voxels and the workspace must be greater than "
        "0, the model's tolerance not below");
  }
  const double voxels = (sound.workspace.sizes() / sound.VoxelEdge()).prod();
  if (voxels <= SoundBasis::kMostVoxels) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "sound: the workspace has ", std::ceil(voxels / 1e6), " million voxels of ",
      sound.VoxelEdge(), " m, more than ", static_cast<int64_t>(SoundBasis::kMostVoxels / 1e6),
      " million; state a greater least_obstacle or voxel_edge, or a smaller workspace"));
}

}  // namespace

std::vector<VoxelView> ViewsOfSpace(const storage::v1::CellDescription& cell,
                                    const RobotImageTable& robot_images,
                                    const Calibration& calibration, double margin) {
  // Without segmentation settings the masks were made elsewhere, and show all that they touch.
  const double rim = cell.segmentation().empty() ? 0 : kRim;
  std::vector<VoxelView> views;
  for (int view = 0; view < robot_images.views(); ++view) {
    const MaskSize size = robot_images.mask_sizes()[static_cast<size_t>(view)];
    const Eigen::Vector2d camera_pixel(double(size.width) / cell.views(view).image_width(),
                                       double(size.height) / cell.views(view).image_height());
    views.push_back({.mask_size = size,
                     .project = [model = calibration.cameras.at(static_cast<size_t>(view))
                                             .ScaledTo(size.width, size.height)](
                                    const Eigen::Vector3d& point) { return model.Project(point); },
                     .margin = Eigen::Vector2d::Constant(margin) + rim * camera_pixel});
  }
  return views;
}

SoundBasis::SoundBasis(const SoundCell& sound, const RobotImageTable& robot_images,
                       std::vector<VoxelView> views)
    : robot_(sound.robot),
      whole_model_(sound.settings.whole_model),
      space_(sound.workspace, sound.settings.least_obstacle, std::move(views), sound.VoxelEdge()),
      body_(*sound.robot, {.geometry = sound.settings.geometry,
                           .tolerance = sound.settings.model_tolerance,
                           .payload_radius = sound.payload_radius,
                           .range = sound.settings.least_obstacle,
                           .step = std::max(sound.VoxelEdge() / kStepsPerEdge, kLeastStep)}) {
  if (sound.robot_may_leave) workspace_ = sound.workspace;
  for (const GridJoint& joint : robot_images.grid().joints()) {
    const std::optional<size_t> in_model = robot_->JointIndex(joint.name);
    if (!in_model) {
      throw std::invalid_argument("the model has no joint '" + joint.name + "' of the grid");
    }
    model_joints_.push_back(*in_model);
    const double step = joint.any() ? kDrawnWay : joint.step();
    most_way_.push_back(robot_images.drawn() ? std::min(step, kDrawnWay) : step);
  }
}

absl::StatusOr<std::shared_ptr<const SoundBasis>> SoundBasis::Make(
    const SoundCell& sound, const storage::v1::CellDescription& cell,
    const RobotImageTable& robot_images, const Calibration& calibration, double margin,
    std::span<const ViewTreatment> treatments) {
  RETURN_IF_ERROR(CheckCell(sound));
  try {
    std::vector<VoxelView> views = ViewsOfSpace(cell, robot_images, calibration, margin);
    std::vector<CameraModel> cameras;
    double most_margin = 0;
    for (int view = 0; view < robot_images.views(); ++view) {
      VoxelView& seen = views[static_cast<size_t>(view)];
      CoveredPixels covered(robot_images, view);
      seen.swept = std::move(covered.any);
      seen.permanent = std::move(covered.every);
      const std::optional<Mask>& ignored = treatments[static_cast<size_t>(view)].ignored;
      if (ignored && robot_images.drawn() == nullptr) seen.ignored = *ignored;
      cameras.push_back(calibration.cameras[static_cast<size_t>(view)].ScaledTo(
          seen.mask_size.width, seen.mask_size.height));
      most_margin = std::max(most_margin, seen.margin.maxCoeff());
    }
    const std::shared_ptr<SoundBasis> basis(new SoundBasis(sound, robot_images, std::move(views)));
    const ResolutionInput resolution{.cameras = cameras,
                                     .margin = most_margin,
                                     .workspace = sound.workspace,
                                     .model_tolerance = sound.settings.model_tolerance};
    basis->resolvable_obstacle_ = ResolvableObstacle(resolution);
    basis->mask_scale_ = MaskScaleFor(resolution, sound.settings.least_obstacle);
    return std::shared_ptr<const SoundBasis>(basis);
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(absl::StrCat("sound: ", error.what()));
  }
}

std::optional<SoundBasis::ModelJoints> SoundBasis::JointsOf(
    std::span<const JointPosition> joints) const {
  ModelJoints found;
  for (const RobotJoint& joint : robot_->joints()) {
    const auto told = std::find_if(joints.begin(), joints.end(),
                                   [&](const JointPosition& at) { return at.name == joint.name; });
    if (told == joints.end()) return std::nullopt;
    found.positions.push_back(told->position);
    found.half_ranges.push_back(told->half_range);
  }
  return found;
}

BodyDistance SoundBasis::RobotAt(std::span<const JointPosition> joints) const {
  const std::optional<ModelJoints> now = JointsOf(joints);
  if (!now) return nullptr;
  return [body = body_.At(now->positions, now->half_ranges), hint = size_t{0}](
             const Eigen::Vector3d& point) mutable { return body.AtMost(point, hint); };
}

std::vector<double> SoundBasis::PositionsAt(std::span<const double> now,
                                            std::span<const double> q) const {
  std::vector<double> positions(now.begin(), now.end());
  for (size_t i = 0; i < q.size(); ++i) positions[model_joints_[i]] = q[i];
  return positions;
}

PosedBody SoundBasis::BodyBetween(std::span<const double> now, std::span<const double> from,
                                  std::span<const double> to) const {
  const std::vector<double> lower = PositionsAt(now, from);
  if (std::ranges::equal(from, to)) return body_.At(lower);
  return body_.Between(lower, PositionsAt(now, to), space_.grid().edge() / 2);
}

// The body at one place, or between two, after the other.
struct TestBody {
  uint64_t owner = 0;
  Configuration from = {};
  Configuration to = {};
  PosedBody body;
  size_t hint = 0;

  // Whether it may touch a point of a box that is not inside the robot now. Eighths are looked at
  // as balls around them, which hold less than one ball around all of the box.
  bool MayTouch(const Eigen::AlignedBox3d& box, const PosedBody& present, int halvings) {
    const Eigen::Vector3d centre = box.center();
    const double radius = box.diagonal().norm() / 2;
    if (!body.MayReach(centre, radius)) return false;
    if (present.AtMost(centre, hint) + radius <= 0) return false;
    if (halvings == 0) return true;
    for (int corner = 0; corner < 8; ++corner) {
      Eigen::AlignedBox3d eighth(centre);
      eighth.extend(box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
      if (MayTouch(eighth, present, halvings - 1)) return true;
    }
    return false;
  }
};

// The body while it leaves the place where it touches nothing.
struct LeavingBody {
  PosedBody body;
  const PosedBody& present;
  double radius = 0;  // of the least obstacle
  double voxel = 0;   // edge
  size_t hint = 0;

  // Whether it may meet a ball that has its centre in a box, of the voxel's size or larger; eighths
  // of a voxel as above.
  bool MayMeet(const Eigen::AlignedBox3d& box, int halvings) {
    const Eigen::Vector3d centre = box.center();
    const double room = box.diagonal().norm() / 2;
    if (present.AtMost(centre, hint) + room < radius) return false;
    if (box.sizes().x() > 1.5 * voxel) return body.MayReach(centre, room + radius);
    if (!body.MayMeet(centre, room, radius)) return false;
    if (halvings == 0) return true;
    for (int corner = 0; corner < 8; ++corner) {
      Eigen::AlignedBox3d eighth(centre);
      eighth.extend(box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
      if (MayMeet(eighth, halvings - 1)) return true;
    }
    return false;
  }
};

TestSupport::RobotMayTouch SoundBasis::RobotMayTouch(std::span<const JointPosition> joints) const {
  const std::optional<ModelJoints> now = JointsOf(joints);
  if (!whole_model_ || !now) return nullptr;
  static std::atomic<uint64_t> last_owner = 0;
  return [this, now = now->positions, present = body_.At(now->positions, now->half_ranges),
          owner = ++last_owner](std::span<const double> from, std::span<const double> to,
                                const Eigen::AlignedBox3d& box) {
    // A place is asked about many boxes, by one thread.
    thread_local TestBody test;
    if (test.owner != owner || !std::ranges::equal(test.from, from) ||
        !std::ranges::equal(test.to, to)) {
      test = {owner,
              {from.begin(), from.end()},
              {to.begin(), to.end()},
              BodyBetween(now, from, to).MovedFrom(present)};
    }
    return test.MayTouch(box, present, kHalvings);
  };
}

std::optional<PosedBody> SoundBasis::BodyOnTheWay(std::span<const double> now,
                                                  std::span<const double> from,
                                                  std::span<const double> to) const {
  for (size_t i = 0; i < from.size(); ++i) {
    const double start = now[model_joints_[i]];
    const double farthest = std::max(std::abs(from[i] - start), std::abs(to[i] - start));
    if (!(farthest <= most_way_[i] + kSameJoint)) return std::nullopt;
  }
  const std::vector<double> one = PositionsAt(now, from);
  const std::vector<double> other = PositionsAt(now, to);
  std::vector<double> end;
  for (size_t j = 0; j < now.size(); ++j) {
    const auto [least, most] = std::minmax(one[j], other[j]);
    if (least < now[j] - kSameJoint && most > now[j] + kSameJoint) return std::nullopt;
    const bool moves = most > now[j] + kSameJoint || least < now[j] - kSameJoint;
    end.push_back(!moves ? now[j] : most > now[j] + kSameJoint ? most : least);
  }
  return body_.Between(now, end, kFineMovement * space_.grid().edge());
}

TestSupport::RobotMayMeet SoundBasis::RobotMayMeet(std::span<const JointPosition> joints,
                                                   const PossibleSpace& space) const {
  const std::optional<ModelJoints> now = JointsOf(joints);
  if (!whole_model_ || !now) return nullptr;
  return [this, &space, now = now->positions, present = body_.At(now->positions, now->half_ranges)](
             std::span<const double> from, std::span<const double> to) {
    const std::optional<PosedBody> body = BodyOnTheWay(now, from, to);
    if (!body) return true;
    LeavingBody leaving{.body = body->MovedFrom(present),
                        .present = present,
                        .radius = space_.least_obstacle(),
                        .voxel = space_.grid().edge()};
    return space.AnyCentre(
        [&](const Eigen::AlignedBox3d& box) { return leaving.MayMeet(box, kHalvings); });
  };
}

const PossibleSpace& ScenePossibleSpace::Get(const std::shared_ptr<const SoundBasis>& basis,
                                             const ObstacleImages& images,
                                             std::span<const JointPosition> joints,
                                             std::span<const std::optional<Mask>> allowed,
                                             int max_occluded_views) const {
  return spaces_.Get({basis, max_occluded_views}, [&] {
    return PossibleSpace(basis->space(), images, basis->RobotAt(joints), allowed,
                         max_occluded_views);
  });
}

}  // namespace silhouette
