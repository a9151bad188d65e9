// SPDX-License-Identifier: Apache-2.0
// PartDrawer: draws convex bodies into the mask of one view. Uses the standard library and Eigen
// alone.
//
// A body is the convex hull of some points. `Touched` is for what must not be missed: a superset of
// all pixels whose squares show a point of the grown body. `Covered` is for what must be certain:
// pixels whose whole squares show the body. Both count lens distortion, and hold for every camera
// that shows a point no more than `margin` pixels away, along either axis, from where the model
// does. Where the camera is in or beside the body, Touched sets all pixels and Covered none.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/robot/drawing/hull_edges.h"
#include "calib/robot/drawing/lens_window.h"
#include "calib/robot/drawing/projection.h"
#include "calib/robot/drawing/square_corners.h"
#include "db/mask/mask.h"

namespace silhouette {

// What a drawing needs room for. For one thread at a time; after a few drawings nothing allocates.
struct DrawingScratch {
  std::vector<Eigen::Vector3d> points;     // in the camera's frame
  std::vector<Eigen::Vector3d> near;       // those of them that are near the camera's plane
  std::vector<Eigen::Vector2d> projected;  // at z = 1
  std::vector<Eigen::Vector2d> pixels;     // of them
  std::vector<Eigen::Vector2d> hull;
  std::vector<Eigen::Vector2d> outline;  // the hull, widened and clipped
  std::vector<Eigen::Vector2d> clipped;
  std::vector<double> reaches;          // of the growth's images about the projected, at z = 1
  std::vector<Eigen::Vector2d> around;  // corners about these
  double least_reach = 0;               // of the growth's image, at z = 1
  double most_reach = 0;
  double widened_by = 0;      // pixels on every side that the outline does not hold yet
  std::vector<double> left;   // by row: the least x of the outline, in mask pixels
  std::vector<double> right;  // by row: the greatest
  int first_row = 0;          // with an outline
  int last_row = -1;
  std::pair<int, int> rows;  // the first and the last in which it is wanted
};

// The pixels of a view that bodies are tested against. A value.
class DrawnPlane {
 public:
  explicit DrawnPlane(Mask mask);

  MaskWords words() const { return mask_.words(); }
  // The first and the last that have a pixel; none has one: the last.
  std::pair<int, int> rows() const { return rows_; }

 private:
  Mask mask_;
  std::pair<int, int> rows_;
};

class PartDrawer {
 public:
  // Growth that is not more is a margin along both axes, pixels.
  static constexpr double kThin = 0.2;

  // `camera`: of any image size; masks of `size` show the same field. `margin`: the error of the
  // calibration, pixels of the mask. Throws std::invalid_argument if `size` is not valid, or the
  // margin is negative or not finite.
  PartDrawer(const CameraModel& camera, MaskSize size, double margin = 0);

  MaskSize size() const { return size_; }
  const CameraModel& camera() const { return camera_; }
  double margin() const { return margin_; }

  // Sets every pixel whose square may show a point of the body or one within `growth` metres of it.
  // `points`: at least one, as columns, metres. `edges`: of their hull; if it is empty, drawing
  // takes longer. `words`: of a mask of size(). Throws std::invalid_argument if `growth` is
  // negative or not finite, or a word is missing.
  //
  // Sets at most about 0.2 pixels more than the margin on every side, and the corners of the
  // growth, which is taken for a polygon about it (3.5 %).
  void AddTouched(const Eigen::Isometry3d& world_from_body, const Eigen::Matrix3Xd& points,
                  const HullEdges& edges, double growth, DrawingScratch& scratch,
                  std::span<uint64_t> words) const;

  // Whether AddTouched would set a pixel that `plane`, of a mask of size(), has.
  bool Meets(const Eigen::Isometry3d& world_from_body, const Eigen::Matrix3Xd& points,
             const HullEdges& edges, double growth, DrawingScratch& scratch,
             const DrawnPlane& plane) const;

  // Sets pixels in whose squares every ray meets the body.
  void AddCovered(const Eigen::Isometry3d& world_from_body, const Eigen::Matrix3Xd& points,
                  DrawingScratch& scratch, std::span<uint64_t> words) const;

  // Where AddTouched sets pixels, for those who want to know without drawing.
  struct Bounds {
    bool bounded = false;     // else nothing is known
    Eigen::AlignedBox2d box;  // at z = 1: what is beyond is cut off
    double circle = 0;        // the same, if it is not 0, beyond this distance from the axis
    double stretch = 0;       // pixels by which a step of 1 at z = 1 moves at most, within
    double shrink = 0;        // and at least
    double bend = 0;          // and by which it bends (second derivative)
    double widened = 0;       // pixels on every side, the margin included
  };
  Bounds bounds() const;

 private:
  // Keeps the part of the body that is before the camera. False: what is near the camera's plane
  // may be seen.
  bool CutNearPlane(double growth, double least, DrawingScratch& scratch) const;
  // The hull of the projected body, widened by the growth, as the outline; by so little growth that
  // pixels hardly show it, as a margin.
  void WidenedOutline(double growth, DrawingScratch& scratch) const;
  // Both ends at z = 1 and in the image.
  void TraceEdge(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                 const Eigen::Vector2d& from_pixel, const Eigen::Vector2d& to_pixel,
                 DrawingScratch& scratch) const;
  void TraceSegment(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double margin,
                    DrawingScratch& scratch) const;
  // What is touched: nothing, all, or the rows of the scratch. With a plane: nothing also if that
  // is easily seen not to be met.
  enum class Extent { kNothing, kAll, kRows };
  Extent Trace(const Eigen::Isometry3d& world_from_body, const Eigen::Matrix3Xd& points,
               const HullEdges& edges, double growth, DrawingScratch& scratch,
               MaskWords plane) const;
  // Whether an octagon about the projected, grown points meets the plane nowhere. `seen`: of the
  // points, at z = 1.
  bool IsClear(Octagon seen, DrawingScratch& scratch, MaskWords plane) const;
  // Whether the plane has no pixel in the wanted rows that edges between the projected points may
  // touch. `seen`: where these are at z = 1; `pixels`: in the image.
  bool IsClearOf(const Octagon& pixels, const Octagon& seen, const DrawingScratch& scratch,
                 MaskWords plane) const;
  void BeginRows(DrawingScratch& scratch) const;
  void TraceOutline(DrawingScratch& scratch) const;
  // The same from the projected points of a hull all of which is in the window.
  void TraceEdges(const HullEdges& edges, const Eigen::Vector3d& eye,
                  DrawingScratch& scratch) const;
  // Calls `take(first, last)` with the bits of each row of the scratch while it returns true;
  // whether it always did.
  template <typename Take>
  bool ForEachRow(const DrawingScratch& scratch, Take take) const;

  CameraModel camera_;  // of images of size_
  MaskSize size_;
  double margin_ = 0;  // pixels: of the calibration
  LensWindow window_;
  double widened_ = 0;  // pixels by which all outlines are widened: the margin, and rounding
  SquareCorners corners_;
};

}  // namespace silhouette
