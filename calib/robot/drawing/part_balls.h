// SPDX-License-Identifier: Apache-2.0
// PartBalls: balls about a robot's parts, which are quickly looked up in a view's plane.
//
// Balls stand in vectors of eight, by the link that they move with; lanes that are left over repeat
// a ball. A larger ball about those of a vector, its group, is looked up first. Single precision. A
// value; used by any number of threads.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "calib/robot/drawing/part_drawer.h"
#include "calib/robot/drawing/plane_distances.h"

namespace silhouette {

struct RobotPart;
class HullEdges;

// One number for each ball, or lane. Aligned for vectors of 32 bytes.
class BallNumbers {
 public:
  static constexpr size_t kLanes = 8;
  using Lanes [[gnu::vector_size(32), gnu::may_alias]] = float;

  size_t vectors() const { return vectors_.size(); }
  void resize(size_t vectors) { vectors_.resize(vectors); }
  Lanes& vector(size_t i) { return vectors_[i].lanes; }
  const Lanes& vector(size_t i) const { return vectors_[i].lanes; }
  float& operator[](size_t ball) {
    return reinterpret_cast<float*>(&vectors_[ball / kLanes].lanes)[ball % kLanes];
  }
  float operator[](size_t ball) const { return vectors_[ball / kLanes].lanes[ball % kLanes]; }

 private:
  struct alignas(32) Vector {
    Lanes lanes{};
  };
  std::vector<Vector> vectors_;
};

struct BallPlaces {
  BallNumbers x, y, z;
  BallNumbers growth;  // radius of the part and its growth; of a group, the greatest
};

// Where the balls are in the world at some joint values, and how far their parts are grown.
struct PlacedBalls : BallPlaces {
  BallPlaces groups;
  // By vector, a bit for each ball whose part is grown by more than half of its radius. Such a part
  // is nearly as round, and dear to draw.
  std::vector<uint32_t> grown;
  float slack = 0;  // metres that rounding may have moved a ball by
};

// A vector of balls as a view sees it.
struct SeenBalls {
  size_t vector = 0;
  // A bit for each ball. `near`: AddTouched may meet the view's plane with the piece of the part
  // that the ball holds. `shown`: it certainly does.
  uint32_t near = 0;
  uint32_t shown = 0;
  // By ball: PlaneDistances::kUnits by which it may reach into the plane; less than 0 if not near.
  int32_t depth[BallNumbers::kLanes] = {};
};

class PartBalls {
 public:
  // `edges`: of each part's points.
  PartBalls(std::span<const RobotPart> parts, std::span<const HullEdges> edges);
  PartBalls() = default;

  size_t balls() const { return part_.size(); }
  size_t vectors() const { return link_.size(); }
  size_t groups() const { return groups_.radius.vectors(); }  // vectors of them
  size_t part(size_t ball) const { return part_[ball]; }
  // Metres; the ball's centre is in the hull of the part's points.
  float radius(size_t ball) const { return balls_.radius[ball]; }

  // `growth`: by part, or empty.
  void Place(std::span<const Eigen::Isometry3d> base_from_link, std::span<const double> growth,
             PlacedBalls& placed) const;

 private:
  friend class BallLook;

  // How far pieces, and parts, are from the balls' centres at most.
  struct Extents {
    BallNumbers radius, far;
  };

  void Append(size_t part, size_t link, const Eigen::Vector3d& centre, double radius, double far);
  void Group();
  void Move(std::span<const Eigen::Isometry3d> base_from_link, PlacedBalls& placed) const;

  std::vector<size_t> part_;  // by ball
  std::vector<size_t> link_;  // by vector of balls
  BallNumbers x_, y_, z_;     // in the frame of the link
  Extents balls_;             // of parts without their radius
  BallNumbers depth_;         // of balls about the same centres that are within these
  BallNumbers part_radius_;
  // By vector of balls:
  std::vector<std::array<float, 3>> middles_;
  Extents groups_;
  BallNumbers group_radius_;  // of parts: the greatest
  double reach_ = 0;          // how far a ball's centre is from its link's origin at most
};

// How balls appear in one view.
class BallLook {
 public:
  explicit BallLook(const PartDrawer& view);

  // Whether anything is known; else no ball is.
  bool bounded() const { return bounded_; }

  // Which vectors of balls may meet a plane; the others meet it nowhere. Sets `near`, for each
  // vector of groups, to a bit for each group; returns how many it found. `balls`: of which
  // `placed` is. `distances`: of the plane.
  int FindNear(const PartBalls& balls, const PlacedBalls& placed, const PlaneDistances& distances,
               std::span<uint32_t> near) const;
  // Looks at each ball of one of them.
  void See(const PartBalls& balls, const PlacedBalls& placed, const PlaneDistances& distances,
           SeenBalls& seen) const;

 private:
  struct Sight;
  Sight SeeVector(const PartBalls::Extents& extents, const BallPlaces& placed, size_t i,
                  float slack, const PlaneDistances& distances) const;

  bool bounded_ = false;
  float turn_[9] = {};  // camera from world, row by row
  float move_[3] = {};
  float slack_ = 0;  // of the camera's place
  float lens_[8] = {};
  float focal_[2] = {};
  float centre_[2] = {};
  float low_[2] = {};  // the window at z = 1
  float high_[2] = {};
  float circle_ = 0;  // of the window; 0: it is the box
  float stretch_ = 0;
  float shrink_ = 0;
  float margin_ = 0;  // of the calibration
  float bend_ = 0;
  float widened_ = 0;
  float rounding_ = 0;  // pixels
  int width_ = 0;
  int height_ = 0;
  bool rational_ = false;
};

}  // namespace silhouette
