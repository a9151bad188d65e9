// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/tag_projection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace silhouette {
namespace {

constexpr int kMostDraws = 20000;  // for one frame
constexpr double kLeastSigma = 1e-3;

bool FacesCamera(const CameraModel& camera, const Eigen::Isometry3d& world_from_board,
                 const Eigen::Vector3d& point_on_board, double most_tilt) {
  const Eigen::Vector3d to_camera =
      (camera.Centre() - world_from_board * point_on_board).normalized();
  const Eigen::Vector3d normal = -world_from_board.linear().col(2);
  return normal.dot(to_camera) > std::cos(most_tilt);
}

std::optional<std::vector<Eigen::Vector2d>> ProjectTag(const CameraModel& camera,
                                                       const Eigen::Isometry3d& world_from_board,
                                                       const MarkCorners& corners,
                                                       const TagProjectionSettings& settings) {
  const Eigen::Vector3d middle = (corners.front() + corners[corners.size() / 2]) / 2;
  if (!FacesCamera(camera, world_from_board, middle, settings.most_tilt)) return std::nullopt;
  std::vector<Eigen::Vector2d> pixels;
  for (const Eigen::Vector3d& corner : corners) {
    const auto pixel = camera.Project(world_from_board * corner);
    if (!pixel) return std::nullopt;
    const Eigen::Vector2d inner(camera.intrinsics().width - 1 - settings.border,
                                camera.intrinsics().height - 1 - settings.border);
    if ((pixel->array() < settings.border).any() || (pixel->array() > inner.array()).any()) {
      return std::nullopt;
    }
    pixels.push_back(*pixel);
  }
  for (size_t i = 0; pixels.size() == 4 && i < 4; ++i) {
    if ((pixels[(i + 1) % 4] - pixels[i]).norm() < settings.least_size) return std::nullopt;
  }
  return pixels;
}

Eigen::Isometry3d DrawPose(std::span<const NamedCamera> cameras, const Board& board,
                           const BoardPlaces& places, Chance& chance) {
  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    middle[axis] = chance.Uniform(places.volume.min()[axis], places.volume.max()[axis]);
  }
  Eigen::Vector3d towards = Eigen::Vector3d::Zero();
  for (const NamedCamera& camera : cameras) {
    towards += chance.Uniform() * (camera.model.Centre() - middle).normalized();
  }
  const Eigen::Vector3d axis = towards.cross(chance.Direction()).normalized();
  const double tilt = chance.Uniform(0, places.tilt);
  const Eigen::Vector3d normal = Eigen::AngleAxisd(tilt, axis) * towards.normalized();
  return HeldAt(board, middle, normal, chance.Uniform(-std::numbers::pi, std::numbers::pi));
}

}  // namespace

Eigen::Isometry3d HeldAt(const Board& board, const Eigen::Vector3d& middle,
                         const Eigen::Vector3d& normal, double turn) {
  Eigen::Isometry3d world_from_board = Eigen::Isometry3d::Identity();
  world_from_board.linear() =
      Eigen::Quaterniond::FromTwoVectors(-Eigen::Vector3d::UnitZ(), normal).toRotationMatrix() *
      Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  world_from_board.translation() = middle - world_from_board.linear() * MiddleOf(board);
  return world_from_board;
}

Eigen::Vector3d MiddleOf(const Board& board) {
  return {board.extent().x() / 2, board.extent().y() / 2, 0};
}

std::vector<TagSighting> ProjectTags(const NamedCamera& camera, const std::string& frame,
                                     const Board& board, const Eigen::Isometry3d& world_from_board,
                                     const TagProjectionSettings& settings, Chance& chance) {
  std::vector<TagSighting> sightings;
  for (int tag = board.first_mark(); board.HasTag(tag); ++tag) {
    const auto pixels = ProjectTag(camera.model, world_from_board, board.CornersOf(tag), settings);
    if (!pixels) continue;
    TagSighting sighting{.frame = frame,
                         .view = camera.view,
                         .family = board.family(),
                         .tag = tag,
                         .corners = *pixels,
                         .sigma = std::max(settings.sigma, kLeastSigma)};
    for (Eigen::Vector2d& corner : sighting.corners) {
      const double x = chance.Normal();
      corner += settings.sigma * Eigen::Vector2d(x, chance.Normal());
    }
    sightings.push_back(std::move(sighting));
  }
  return sightings;
}

BoardFrames DrawBoardFrames(std::span<const NamedCamera> cameras, const Board& board,
                            const BoardPlaces& places, size_t frames,
                            const TagProjectionSettings& settings, uint64_t seed) {
  Chance chance(seed);
  BoardFrames drawn;
  for (size_t f = 0; f < frames; ++f) {
    const std::string frame = absl::StrFormat("%04d", f + 1);
    bool found = false;
    for (int draw = 0; draw < kMostDraws && !found; ++draw) {
      const Eigen::Isometry3d pose = DrawPose(cameras, board, places, chance);
      std::vector<TagSighting> seen;
      size_t views = 0;
      for (const NamedCamera& camera : cameras) {
        const auto tags = ProjectTags(camera, frame, board, pose, settings, chance);
        if (2 * tags.size() >= static_cast<size_t>(board.tags())) ++views;
        seen.insert(seen.end(), tags.begin(), tags.end());
      }
      if (views < places.least_views) continue;
      found = true;
      drawn.frames.push_back(frame);
      drawn.world_from_board.push_back(pose);
      drawn.sightings.insert(drawn.sightings.end(), seen.begin(), seen.end());
    }
    if (!found) {
      throw std::invalid_argument(absl::StrCat("no pose of the board '", board.description().name,
                                               "' in the volume is seen by ", places.least_views,
                                               " cameras"));
    }
  }
  return drawn;
}

}  // namespace silhouette
