// SPDX-License-Identifier: Apache-2.0
// PartBalls: balls about a robot's parts, which are quickly looked up in a view's plane.
//
// Balls stand in lanes of eight, by the link that they move with; lanes that are left over repeat a
// ball. Single precision. A value; used by any number of threads.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "calib/robot/drawing/part_drawer.h"

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

// Where the balls are in the world at some joint values, and how far their parts are grown.
struct PlacedBalls {
  BallNumbers x, y, z;
  BallNumbers growth;  // radius of the part and its growth
  float slack = 0;     // metres that rounding may have moved a ball by
};

// What a view sees of the balls; one of each for a ball.
struct SeenBalls {
  // The number of the pixel that the centre is nearest to, twice; one more if the ball's centre, a
  // point of the part, is in the square of that pixel for certain.
  std::vector<int32_t> pixel;
  // Pixels about the centre of that pixel: if no square of the plane is as near, AddTouched meets
  // it nowhere with the piece of the part that the ball holds. Not a number or infinite: not known.
  std::vector<float> reach;
};

class PartBalls {
 public:
  explicit PartBalls(std::span<const RobotPart> parts);
  PartBalls() = default;

  size_t balls() const { return part_.size(); }
  size_t part(size_t ball) const { return part_[ball]; }
  // Metres; the ball's centre is in the hull of the part's points.
  float radius(size_t ball) const { return radius_[ball]; }

  // `growth`: by part, or empty.
  void Place(std::span<const Eigen::Isometry3d> base_from_link, std::span<const double> growth,
             PlacedBalls& placed) const;

 private:
  friend class BallLook;

  void Append(size_t part, size_t link, const Eigen::Vector3d& centre, double radius, double far);

  std::vector<size_t> part_;  // by ball
  std::vector<size_t> link_;  // by vector of balls
  BallNumbers x_, y_, z_;     // in the frame of the link
  BallNumbers radius_;        // of the ball; holds a piece of the part without its radius
  BallNumbers far_;           // how far any point of the part is from the ball's centre at most
  BallNumbers part_radius_;
  double reach_ = 0;  // how far a ball's centre is from its link's origin at most
};

// How balls appear in one view.
class BallLook {
 public:
  explicit BallLook(const PartDrawer& view);

  // Whether anything is known; else no ball is.
  bool bounded() const { return bounded_; }

  // One for each ball. `balls`: of which `placed` is.
  void See(const PartBalls& balls, const PlacedBalls& placed, SeenBalls& seen) const;

 private:
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
