// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/part_drawer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "calib/robot/drawing/convex_outline.h"

namespace silhouette {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kNear = 0.01;      // metres before the camera's plane; nothing is seen nearer
constexpr double kSag = 1.0 / 16;   // pixels that a chord may be off the image of its edge
constexpr double kRounding = 1e-4;  // pixels
constexpr int kMostChords = 64;     // of an edge

// Of what is above 0 and fits.
int CeilOf(double x) {
  const int whole = static_cast<int>(x);
  return whole < x ? whole + 1 : whole;
}

// Drops points inside the octagon of those that are farthest out: they are not on the hull.
void DropInner(std::vector<Vector2d>& points) {
  constexpr size_t kCorners = 8;
  if (points.size() <= kCorners) return;
  Vector2d corners[kCorners];  // along -x, -x - y, -y, x - y, and opposite ones
  double farthest[kCorners];
  std::fill_n(farthest, kCorners, -std::numeric_limits<double>::infinity());
  for (const Vector2d& p : points) {
    const double along[4] = {-p.x(), -p.x() - p.y(), -p.y(), p.x() - p.y()};
    for (size_t i = 0; i < kCorners; ++i) {
      const double at = i < 4 ? along[i] : -along[i - 4];
      if (!(at > farthest[i])) continue;
      farthest[i] = at;
      corners[i] = p;
    }
  }
  Vector2d normals[kCorners];  // inwards
  double offsets[kCorners];
  size_t sides = 0;
  for (size_t i = 0; i < kCorners; ++i) {
    const Vector2d along = corners[(i + 1) % kCorners] - corners[i];
    if (along.x() == 0 && along.y() == 0) continue;
    normals[sides] = {-along.y(), along.x()};
    offsets[sides] = normals[sides].dot(corners[i]);
    ++sides;
  }
  std::erase_if(points, [&](const Vector2d& p) {
    bool inside = true;
    for (size_t i = 0; i < sides; ++i) {
      inside &= normals[i].x() * p.x() + normals[i].y() * p.y() > offsets[i];
    }
    return inside;
  });
}

void RequireWords(MaskSize size, size_t points, size_t words) {
  if (points == 0) throw std::invalid_argument("a body to draw has no points");
  if (words != size.words()) throw std::invalid_argument("not the words of a mask of this view");
}

void SetBits(std::span<uint64_t> words, size_t first, size_t last) {
  const size_t begin = first / 64;
  const size_t end = last / 64;
  const uint64_t head = ~uint64_t{0} << (first % 64);
  const uint64_t tail = ~uint64_t{0} >> (63 - last % 64);
  if (begin == end) {
    words[begin] |= head & tail;
    return;
  }
  words[begin] |= head;
  for (size_t word = begin + 1; word < end; ++word) words[word] = ~uint64_t{0};
  words[end] |= tail;
}

bool AnyBit(MaskWords words, size_t first, size_t last) {
  const size_t begin = first / 64;
  const size_t end = last / 64;
  const uint64_t head = ~uint64_t{0} << (first % 64);
  const uint64_t tail = ~uint64_t{0} >> (63 - last % 64);
  if (begin == end) return (words[begin] & head & tail) != 0;
  uint64_t any = (words[begin] & head) | (words[end] & tail);
  for (size_t word = begin + 1; word < end; ++word) any |= words[word];
  return any != 0;
}

// Appends the vertices of the hull of `points`, between the planes z = low and z = high, and maybe
// points of the hull's inside.
void CutBetween(const std::vector<Vector3d>& points, double low, double high,
                std::vector<Vector3d>& cut) {
  for (const Vector3d& point : points) {
    if (point.z() >= low && point.z() <= high) cut.push_back(point);
  }
  for (const double plane : {low, high}) {
    if (!std::isfinite(plane)) continue;
    for (const Vector3d& below : points) {
      if (!(below.z() < plane)) continue;
      for (const Vector3d& above : points) {
        if (!(above.z() > plane)) continue;
        const double share = (plane - below.z()) / (above.z() - below.z());
        cut.push_back(below + share * (above - below));
        cut.back().z() = plane;
      }
    }
  }
}

// How far from its centre's image, at z = 1, a ball's image reaches at most: tan(b + a) - tan b for
// a ball of angular radius a whose centre is b off the axis.
double ReachOfBall(const Vector3d& centre, double radius) {
  const double off_axis = centre.head<2>().norm() / centre.z();
  const double tan_radius = radius / std::sqrt(centre.squaredNorm() - radius * radius);
  return tan_radius * (1 + off_axis * off_axis) / (1 - off_axis * tan_radius);
}

CameraModel Scaled(const CameraModel& camera, MaskSize size) {
  if (!size.valid()) throw std::invalid_argument("a mask of this size cannot be drawn");
  return camera.ScaledTo(size.width, size.height);
}

double Checked(double margin) {
  if (margin >= 0 && std::isfinite(margin)) return margin;
  throw std::invalid_argument("the margin of the calibration must not be negative");
}

}  // namespace

PartDrawer::PartDrawer(const CameraModel& camera, MaskSize size, double margin)
    : camera_(Scaled(camera, size)),
      size_(size),
      margin_(Checked(margin)),
      window_(camera_, margin_),
      widened_(margin_ + kRounding + (window_.clear_of_fold() ? 0 : 0.5)),
      corners_(camera_, margin_) {}

void PartDrawer::PointsInCamera(const Eigen::Isometry3d& world_from_body,
                                const Eigen::Matrix3Xd& points, DrawingScratch& scratch) const {
  const Eigen::Isometry3d camera_from_body = camera_.camera_from_world() * world_from_body;
  const Eigen::Matrix3d turn = camera_from_body.linear();
  const Vector3d move = camera_from_body.translation();
  scratch.points.resize(static_cast<size_t>(points.cols()));
  const double* from = points.data();
  for (Vector3d& point : scratch.points) {
    for (int row = 0; row < 3; ++row) {
      point[row] =
          turn(row, 0) * from[0] + turn(row, 1) * from[1] + turn(row, 2) * from[2] + move[row];
    }
    from += 3;
  }
}

bool PartDrawer::CutNearPlane(double growth, double least, DrawingScratch& scratch) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  scratch.near.clear();
  CutBetween(scratch.points, -growth, least, scratch.near);
  Eigen::AlignedBox3d box;
  for (const Vector3d& point : scratch.near) box.extend(point);
  // All that is seen up to z = farthest is in this box.
  const double farthest = least + growth;
  const Vector2d low = (farthest * window_.box().min()).cwiseMin(0);
  const Vector2d high = (farthest * window_.box().max()).cwiseMax(0);
  const Vector3d reach = Vector3d::Constant(growth);
  const Eigen::AlignedBox3d seen(Vector3d(low.x(), low.y(), 0),
                                 Vector3d(high.x(), high.y(), farthest));
  if (!scratch.near.empty() &&
      seen.intersects(Eigen::AlignedBox3d(box.min() - reach, box.max() + reach))) {
    return false;
  }
  scratch.near.clear();
  CutBetween(scratch.points, least, kInfinity, scratch.near);
  std::swap(scratch.points, scratch.near);
  return true;
}

template <typename Take>
bool PartDrawer::ForEachRow(const DrawingScratch& scratch, Take take) const {
  for (int row = scratch.first_row; row <= scratch.last_row; ++row) {
    const auto at = static_cast<size_t>(row);
    const double low = scratch.left[at] - 0.5;
    const double high = scratch.right[at] + 0.5;
    if (!(low <= size_.width - 1) || !(high >= 0)) continue;
    const int left = low > 0 ? CeilOf(low) : 0;
    const int right = high < size_.width - 1 ? static_cast<int>(high) : size_.width - 1;
    if (left > right) continue;
    const size_t begin = at * static_cast<size_t>(size_.width);
    if (!take(begin + static_cast<size_t>(left), begin + static_cast<size_t>(right))) return false;
  }
  return true;
}

void PartDrawer::Project(double growth, DrawingScratch& scratch) const {
  scratch.projected.resize(scratch.points.size());
  double nearest = std::numeric_limits<double>::infinity();
  double farthest = 0;
  double off_axis = 0;  // squared
  for (size_t i = 0; i < scratch.points.size(); ++i) {
    const Vector3d& point = scratch.points[i];
    const double inverse = 1 / point.z();
    Vector2d& at = scratch.projected[i];
    at = {point.x() * inverse, point.y() * inverse};
    nearest = std::min(nearest, point.z());
    farthest = std::max(farthest, point.z());
    off_axis = std::max(off_axis, at.x() * at.x() + at.y() * at.y());
  }
  // What a ball's image reaches is between radius / depth and this: ReachOfBall.
  scratch.most_reach = growth * std::sqrt(1 + off_axis) / (nearest - growth);
  scratch.least_reach = growth / farthest;
}

// Whether an octagon about the projected, grown points meets the plane nowhere.
bool PartDrawer::IsClear(DrawingScratch& scratch, MaskWords plane) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double low[4] = {kInfinity, kInfinity, kInfinity, kInfinity};  // of x, y, x + y, x - y
  double high[4] = {-kInfinity, -kInfinity, -kInfinity, -kInfinity};
  for (const Vector2d& p : scratch.projected) {
    const double at[4] = {p.x(), p.y(), p.x() + p.y(), p.x() - p.y()};
    for (int i = 0; i < 4; ++i) {
      low[i] = std::min(low[i], at[i]);
      high[i] = std::max(high[i], at[i]);
    }
  }
  for (int i = 0; i < 4; ++i) {
    const double reach = 1.036 * scratch.most_reach * (i < 2 ? 1 : std::numbers::sqrt2);
    low[i] -= reach;
    high[i] += reach;
  }
  scratch.outline = {{high[0], high[2] - high[0]}, {high[2] - high[1], high[1]},
                     {low[3] + high[1], high[1]},  {low[0], low[0] - low[3]},
                     {low[0], low[2] - low[0]},    {low[2] - low[1], low[1]},
                     {high[3] + low[1], low[1]},   {high[0], high[0] - high[3]}};
  // More than what the outline's own edges bend by, and growth along both axes adds.
  scratch.widened_by =
      3 * kSag + 0.42 * std::min(kThin, 1.036 * scratch.most_reach * window_.stretch());
  window_.Clip(scratch.outline, scratch.clipped);
  if (scratch.outline.empty()) return true;
  TraceOutline(scratch);
  return ForEachRow(scratch,
                    [&](size_t first, size_t last) { return !AnyBit(plane, first, last); });
}

void PartDrawer::WidenedOutline(double growth, DrawingScratch& scratch) const {
  const double most = scratch.most_reach;
  scratch.widened_by = 0;
  constexpr double kAlike = 0.1;  // pixels
  if (growth == 0 || (most - scratch.least_reach) * window_.scale() < kAlike) {
    DropInner(scratch.projected);
    if (window_.clear_of_fold() && most * window_.stretch() <= kThin) {
      ConvexHull(scratch.projected, scratch.outline);
      scratch.widened_by = most * window_.stretch();
      return;
    }
    ConvexHull(scratch.projected, scratch.hull);
    WidenOutline(scratch.hull, most, scratch.outline);
    return;
  }
  // Near the camera, or far off its axis: each ball has a size of its own.
  const size_t points = scratch.points.size();
  scratch.projected.clear();
  for (size_t i = 0; i < points; ++i) {
    const Vector3d& point = scratch.points[i];
    AppendAround(point.head<2>() / point.z(), ReachOfBall(point, growth), scratch.projected);
  }
  DropInner(scratch.projected);
  ConvexHull(scratch.projected, scratch.outline);
}

void PartDrawer::TraceSegment(const Vector2d& from, const Vector2d& to, double margin,
                              DrawingScratch& scratch) const {
  const Vector2d& top = from.y() < to.y() ? from : to;
  const Vector2d& bottom = from.y() < to.y() ? to : from;
  const double reach = margin + 0.5;
  // Compared before the conversion: what is far outside does not fit an int.
  const double above = top.y() - reach;
  const double below = bottom.y() + reach;
  if (!(above <= size_.height - 1) || !(below >= 0)) return;
  const int first = above > 0 ? CeilOf(above) : 0;
  const int last = below < size_.height - 1 ? static_cast<int>(below) : size_.height - 1;
  if (first > last) return;
  scratch.first_row = std::min(scratch.first_row, first);
  scratch.last_row = std::max(scratch.last_row, last);
  const double height = bottom.y() - top.y();
  // A line that is nearly level is taken for what it spans.
  const bool level = !(height > 1e-6);
  const double slope = level ? 0 : (bottom.x() - top.x()) / height;
  const double low = (level ? std::min(top.x(), bottom.x()) : top.x()) - margin;
  const double high = (level ? std::max(top.x(), bottom.x()) : top.x()) + margin;
  for (int row = first; row <= last; ++row) {
    const double enters = slope * std::max(row - reach - top.y(), 0.0);
    const double leaves = slope * std::min(row + reach - top.y(), height);
    double& left = scratch.left[static_cast<size_t>(row)];
    double& right = scratch.right[static_cast<size_t>(row)];
    left = std::min(left, low + std::min(enters, leaves));
    right = std::max(right, high + std::max(enters, leaves));
  }
}

// `at`: where `from` is in the image; on return, where `to` is.
void PartDrawer::TraceEdge(const Vector2d& from, const Vector2d& to, Vector2d& at,
                           DrawingScratch& scratch) const {
  const double bend = window_.bend() * (to - from).squaredNorm() / 8;  // off one chord
  const double margin = widened_ + scratch.widened_by;
  if (bend <= kSag) {
    const Vector2d after = PixelAt(camera_.intrinsics(), to);
    TraceSegment(at, after, margin + bend, scratch);
    at = after;
    return;
  }
  const int chords =
      std::clamp(static_cast<int>(std::ceil(std::sqrt(bend / kSag))), 1, kMostChords);
  for (int i = 1; i <= chords; ++i) {
    const Vector2d after = PixelAt(camera_.intrinsics(), from + (to - from) * i / chords);
    TraceSegment(at, after, margin + bend / (chords * chords), scratch);
    at = after;
  }
}

void PartDrawer::TraceOutline(DrawingScratch& scratch) const {
  // Only the rows of the drawing before are not clear.
  const auto height = static_cast<size_t>(size_.height);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (scratch.left.size() < height) {
    scratch.left.resize(height, kInfinity);
    scratch.right.resize(height, -kInfinity);
  }
  for (int row = scratch.first_row; row <= scratch.last_row; ++row) {
    scratch.left[static_cast<size_t>(row)] = kInfinity;
    scratch.right[static_cast<size_t>(row)] = -kInfinity;
  }
  scratch.first_row = size_.height;
  scratch.last_row = -1;
  Vector2d at = PixelAt(camera_.intrinsics(), scratch.outline.back());
  const Vector2d* before = &scratch.outline.back();
  for (const Vector2d& corner : scratch.outline) {
    TraceEdge(*before, corner, at, scratch);
    before = &corner;
  }
}

PartDrawer::Extent PartDrawer::Trace(const Eigen::Isometry3d& world_from_body,
                                     const Eigen::Matrix3Xd& points, double growth,
                                     DrawingScratch& scratch, MaskWords plane) const {
  if (!(growth >= 0) || !std::isfinite(growth)) {
    throw std::invalid_argument("a body cannot grow by less than nothing");
  }
  PointsInCamera(world_from_body, points, scratch);
  double nearest = std::numeric_limits<double>::infinity();
  double farthest = -nearest;
  double sum = 0;  // finite if all are; where it is too large, so is the body
  for (const Vector3d& point : scratch.points) {
    nearest = std::min(nearest, point.z());
    farthest = std::max(farthest, point.z());
    sum += std::abs(point.x()) + std::abs(point.y()) + std::abs(point.z());
  }
  if (!std::isfinite(sum) || !std::isfinite(window_.scale()) || !std::isfinite(window_.bend()))
    return Extent::kAll;
  if (farthest + growth <= 0) return Extent::kNothing;  // behind the camera
  const double least = 2 * growth + kNear;
  if (nearest < least && !CutNearPlane(growth, least, scratch)) return Extent::kAll;
  if (scratch.points.empty()) return Extent::kNothing;

  Project(growth, scratch);
  if (!plane.empty() && window_.clear_of_fold() && IsClear(scratch, plane)) return Extent::kNothing;
  WidenedOutline(growth, scratch);
  window_.Clip(scratch.outline, scratch.clipped);
  if (scratch.outline.empty()) return Extent::kNothing;
  TraceOutline(scratch);
  return Extent::kRows;
}

void PartDrawer::AddTouched(const Eigen::Isometry3d& world_from_body,
                            const Eigen::Matrix3Xd& points, double growth, DrawingScratch& scratch,
                            std::span<uint64_t> words) const {
  RequireWords(size_, static_cast<size_t>(points.cols()), words.size());
  switch (Trace(world_from_body, points, growth, scratch, {})) {
    case Extent::kNothing:
      return;
    case Extent::kAll:
      return SetBits(words, 0, size_.pixels() - 1);
    case Extent::kRows:
      ForEachRow(scratch, [&](size_t first, size_t last) {
        SetBits(words, first, last);
        return true;
      });
  }
}

bool PartDrawer::Meets(const Eigen::Isometry3d& world_from_body, const Eigen::Matrix3Xd& points,
                       double growth, DrawingScratch& scratch, MaskWords plane) const {
  RequireWords(size_, static_cast<size_t>(points.cols()), plane.size());
  switch (Trace(world_from_body, points, growth, scratch, plane)) {
    case Extent::kNothing:
      return false;
    case Extent::kAll:
      return AnyBit(plane, 0, size_.pixels() - 1);
    case Extent::kRows:
      break;
  }
  return !ForEachRow(scratch,
                     [&](size_t first, size_t last) { return !AnyBit(plane, first, last); });
}

PartDrawer::Bounds PartDrawer::bounds() const {
  return {.bounded = window_.clear_of_fold() && std::isfinite(window_.scale()) &&
                     std::isfinite(window_.bend()) && std::isfinite(window_.stretch()),
          .box = window_.box(),
          .circle = window_.radius() > 0 ? 1.0014 * window_.radius() : 0,
          .stretch = window_.stretch(),
          .bend = window_.bend(),
          .widened = widened_};
}

void PartDrawer::AddCovered(const Eigen::Isometry3d& world_from_body,
                            const Eigen::Matrix3Xd& points, DrawingScratch& scratch,
                            std::span<uint64_t> words) const {
  RequireWords(size_, static_cast<size_t>(points.cols()), words.size());
  PointsInCamera(world_from_body, points, scratch);
  scratch.projected.clear();
  for (const Vector3d& point : scratch.points) {
    if (!(point.z() >= kNear)) return;
    scratch.projected.emplace_back(point.head<2>() / point.z());
  }
  ConvexHull(scratch.projected, scratch.hull);
  if (scratch.hull.size() < 3) return;
  corners_.AddInside(scratch.hull, words);
}

}  // namespace silhouette
