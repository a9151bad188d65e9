// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace silhouette {

// How numbers state a pose: which they are, in which units, and how they make a rotation. All are
// poses base_from_flange, position first.
//
//   quaternion       tx ty tz qx qy qz qw    m
//   tum              as quaternion           without a line of names, after the frame or its time
//   rotation_vector  x y z rx ry rz          units are to be stated
//   rpy              x y z roll pitch yaw    units are to be stated; Rz(yaw) Ry(pitch) Rx(roll)
//   matrix           m00 m01 ... m23         unit is to be stated; row by row, maybe m30 ... m33
//   kuka             x y z a b c             mm, deg; Rz(a) Ry(b) Rx(c)
//   abb              x y z q1 q2 q3 q4       mm; q1 is the real part
//   ur               x y z rx ry rz          m, rad; rotation vector
//   staubli          x y z rx ry rz          mm, deg; Rx(rx) Ry(ry) Rz(rz)
//   fanuc            x y z w p r             mm, deg; Rz(r) Ry(p) Rx(w)
class PoseNotation {
 public:
  PoseNotation() = default;  // quaternion
  // One of Names(). `units`: of length and, where there are angles, of angles, as "mm,deg", "m,rad"
  // or "mm"; empty: the notation's own. InvalidArgument: no such notation or units, or none though
  // the notation has none of its own.
  static absl::StatusOr<PoseNotation> Named(const std::string& name, const std::string& units);
  static std::vector<std::string> Names();

  const std::string& name() const { return name_; }
  // Names of the numbers, in their order.
  const std::vector<std::string>& columns() const { return columns_; }

  // `values`: as many as columns(), of a matrix 12 or 16. InvalidArgument, a sentence without
  // place: other counts, a quaternion whose length is not 1 within a hundredth (it is made 1), a
  // matrix that is no pose (it is made one), a position that can only be in a smaller unit.
  absl::StatusOr<Eigen::Isometry3d> Pose(std::span<const double> values) const;

  // What speaks for another unit in all poses of a file together: InvalidArgument if the angles can
  // only be in degrees; and, unless the units were stated, if no position is farther than 2 cm from
  // the base, or the angles can only be in radians (none is greater than half a turn in them).
  // `rows`: each as for Pose().
  absl::Status CheckUnits(std::span<const std::vector<double>> rows) const;

 private:
  enum class Rotation { kQuaternion, kVector, kXyz, kZyx, kZyxReversed, kMatrix };
  struct Known;
  static const std::vector<Known>& All();

  absl::StatusOr<Eigen::Matrix3d> RotationOf(std::span<const double> values) const;
  bool has_angles() const {
    return rotation_ != Rotation::kQuaternion && rotation_ != Rotation::kMatrix;
  }

  std::string name_ = "quaternion";
  std::vector<std::string> columns_ = {"tx", "ty", "tz", "qx", "qy", "qz", "qw"};
  Rotation rotation_ = Rotation::kQuaternion;
  bool real_first_ = false;
  double metres_ = 1;   // in a unit of length
  double radians_ = 1;  // in a unit of angle
  bool units_stated_ = false;
};

}  // namespace silhouette
