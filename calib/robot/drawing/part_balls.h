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
  float slack = 0;  // metres that rounding may have moved a ball by
};

// A vector of balls as a view sees it.
struct SeenBalls {
  size_t vector = 0;
  uint32_t near = 0;  // a bit for each ball that may meet the view's plane
  // By ball: twice the number of the pixel whose centre is nearest to the ball's; one more if the
  // ball's centre, a point of the part, is in its square for certain.
  int32_t pixel[BallNumbers::kLanes] = {};
  // PlaneDistances::kUnits about the centre of that pixel: if no square of the plane is as near,
  // AddTouched meets it nowhere with the piece of the part that the ball holds. kUnknown: not
  // known.
  int32_t reach[BallNumbers::kLanes] = {};

  static constexpr int32_t kUnknown = 1 << 16;  // more than any distance
};

class PartBalls {
 public:
  explicit PartBalls(std::span<const RobotPart> parts);
  PartBalls() = default;

  size_t balls() const { return part_.size(); }
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

  std::vector<size_t> part_;  // by ball
  std::vector<size_t> link_;  // by vector of balls
  BallNumbers x_, y_, z_;     // in the frame of the link
  Extents balls_;             // of parts without their radius
  // By vector of balls:
  std::vector<std::array<float, 3>> middles_;
  Extents groups_;
  BallNumbers part_radius_;
  double reach_ = 0;  // how far a ball's centre is from its link's origin at most
};

// How balls appear in one view.
class BallLook {
 public:
  explicit BallLook(const PartDrawer& view);

  // Whether anything is known; else no ball is.
  bool bounded() const { return bounded_; }

  // Appends the vectors of balls of which some may meet a plane, in their order; others meet it
  // nowhere. `balls`: of which `placed` is. `distances`: of the plane.
  void FindNear(const PartBalls& balls, const PlacedBalls& placed, const PlaneDistances& distances,
                std::vector<SeenBalls>& seen) const;
  // Looks at each ball of one of them.
  void See(const PartBalls& balls, const PlacedBalls& placed, const PlaneDistances& distances,
           SeenBalls& seen) const;

 private:
  void SeeVector(const PartBalls::Extents& extents, const BallPlaces& placed, size_t i, float slack,
                 const PlaneDistances& distances, SeenBalls& seen) const;

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
  float bend_ = 0;
  float widened_ = 0;
  float rounding_ = 0;  // pixels
  int width_ = 0;
  int height_ = 0;
  bool rational_ = false;
};

}  // namespace silhouette
