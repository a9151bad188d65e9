// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/part_drawer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "calib/robot/drawing/convex_outline.h"
#include "db/mask/wider_vectors.h"

namespace silhouette {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Four [[gnu::vector_size(32)]] = double;

constexpr double kNear = 0.01;      // metres before the camera's plane; nothing is seen nearer
constexpr double kSag = 1.0 / 16;   // pixels that a chord may be off the image of its edge
constexpr double kRounding = 1e-4;  // pixels
constexpr int kMostChords = 64;     // of an edge
constexpr size_t kMoreRows = 3;     // below the image: what is left of a vector

// Of what is above 0 and fits.
int CeilOf(double x) {
  const int whole = static_cast<int>(x);
  return whole < x ? whole + 1 : whole;
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

// Widens rows, `first_at` and further below the top of a line, to what the line covers of them,
// `reach` above and below. `low`, `high`: beside the line's top.
SILHOUETTE_WIDER_VECTORS static void WidenRows(std::pair<int, int> rows, double first_at,
                                               double reach, double height, double slope,
                                               double low, double high, double* left,
                                               double* right) {
  const Four none = {};
  Four at = Four{0, 1, 2, 3} + first_at;
  for (int row = rows.first; row <= rows.second; row += 4, at += 4.0) {
    const Four from = at - reach;
    const Four to = at + reach;
    const Four enters = slope * (from > 0 ? from : none);
    const Four leaves = slope * (to < height ? to : none + height);
    const Four least = low + (enters < leaves ? enters : leaves);
    const Four most = high + (enters > leaves ? enters : leaves);
    Four lefts;
    Four rights;
    std::memcpy(&lefts, left + row, sizeof lefts);
    std::memcpy(&rights, right + row, sizeof rights);
    const auto taken = Four{0, 1, 2, 3} + row <= none + rows.second;
    lefts = taken & (least < lefts) ? least : lefts;
    rights = taken & (most > rights) ? most : rights;
    std::memcpy(left + row, &lefts, sizeof lefts);
    std::memcpy(right + row, &rights, sizeof rights);
  }
}

namespace {

void PlacePoints(const Eigen::Isometry3d& camera_from_body, const Eigen::Matrix3Xd& points,
                 DrawingScratch& scratch) {
  scratch.points.clear();
  for (const auto& point : points.colwise()) scratch.points.emplace_back(camera_from_body * point);
}

}  // namespace

DrawnPlane::DrawnPlane(Mask mask) : mask_(std::move(mask)), rows_(0, mask_.height() - 1) {
  const auto is_empty = [this](int y) {
    for (int x = 0; x < mask_.width(); ++x) {
      if (mask_.at(x, y)) return false;
    }
    return true;
  };
  auto& [first, last] = rows_;
  while (first < last && is_empty(first)) ++first;
  while (last > first && is_empty(last)) --last;
}

PartDrawer::PartDrawer(const CameraModel& camera, MaskSize size, double margin)
    : camera_(Scaled(camera, size)),
      size_(size),
      margin_(Checked(margin)),
      window_(camera_, margin_),
      widened_(margin_ + kRounding + (window_.clear_of_fold() ? 0 : 0.5)),
      corners_(camera_, margin_) {}

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

bool PartDrawer::IsClear(Octagon seen, DrawingScratch& scratch, MaskWords plane) const {
  auto& [low, high] = seen;
  for (size_t i = 0; i < 4; ++i) {
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

bool PartDrawer::IsClearOf(const Octagon& pixels, const Octagon& seen,
                           const DrawingScratch& scratch, MaskWords plane) const {
  const auto& [low, high] = pixels;
  const Vector2d extent(seen.high[0] - seen.low[0], seen.high[1] - seen.low[1]);
  // Chords are off an edge by this at most, and as much wider: TraceEdge. Squares reach half a
  // pixel, all of it along both axes.
  const double bend = window_.bend() * extent.squaredNorm() / 8;
  const double reach = widened_ + scratch.widened_by + 2 * bend + 0.5 + 1e-9;
  const double above = std::max<double>(low[1] - reach, scratch.rows.first);
  const double below = std::min<double>(high[1] + reach, scratch.rows.second);
  if (!(above <= below)) return true;
  for (int y = CeilOf(above); y <= below; ++y) {
    const double left = std::max({low[0] - reach, low[2] - 2 * reach - y, low[3] - 2 * reach + y});
    const double right =
        std::min({high[0] + reach, high[2] + 2 * reach - y, high[3] + 2 * reach + y});
    if (!(left <= size_.width - 1) || !(right >= 0)) continue;
    const int first = CeilOf(std::max(left, 0.0));
    const int last = static_cast<int>(std::min<double>(right, size_.width - 1));
    if (first > last) continue;
    const size_t begin = static_cast<size_t>(y) * static_cast<size_t>(size_.width);
    if (AnyBit(plane, begin + static_cast<size_t>(first), begin + static_cast<size_t>(last))) {
      return false;
    }
  }
  return true;
}

void PartDrawer::WidenedOutline(double growth, DrawingScratch& scratch) const {
  const double most = scratch.most_reach;
  scratch.widened_by = 0;
  constexpr double kAlike = 0.1;  // pixels
  scratch.reaches.clear();
  if (growth == 0 || (most - scratch.least_reach) * window_.scale() < kAlike) {
    DropInner(scratch.projected, scratch.reaches);
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
  for (const Vector3d& point : scratch.points) {
    scratch.reaches.push_back(ReachOfBall(point, growth));
  }
  DropInner(scratch.projected, scratch.reaches);
  scratch.around.clear();
  for (size_t i = 0; i < scratch.projected.size(); ++i) {
    AppendAround(scratch.projected[i], scratch.reaches[i], scratch.around);
  }
  scratch.reaches.clear();
  DropInner(scratch.around, scratch.reaches);
  ConvexHull(scratch.around, scratch.outline);
}

void PartDrawer::TraceSegment(const Vector2d& from, const Vector2d& to, double margin,
                              DrawingScratch& scratch) const {
  const Vector2d& top = from.y() < to.y() ? from : to;
  const Vector2d& bottom = from.y() < to.y() ? to : from;
  const double reach = margin + 0.5;
  // Compared before the conversion: what is far outside does not fit an int.
  const double above = top.y() - reach;
  const double below = bottom.y() + reach;
  const auto [top_row, bottom_row] = scratch.rows;
  if (!(above <= bottom_row) || !(below >= top_row)) return;
  const int first = above > top_row ? CeilOf(above) : top_row;
  const int last = below < bottom_row ? static_cast<int>(below) : bottom_row;
  if (first > last) return;
  scratch.first_row = std::min(scratch.first_row, first);
  scratch.last_row = std::max(scratch.last_row, last);
  const double height = bottom.y() - top.y();
  // A line that is nearly level is taken for what it spans.
  const bool level = !(height > 1e-6);
  const double slope = level ? 0 : (bottom.x() - top.x()) / height;
  const double low = (level ? std::min(top.x(), bottom.x()) : top.x()) - margin;
  const double high = (level ? std::max(top.x(), bottom.x()) : top.x()) + margin;
  WidenRows({first, last}, first - top.y(), reach, height, slope, low, high, scratch.left.data(),
            scratch.right.data());
}

void PartDrawer::TraceEdge(const Vector2d& from, const Vector2d& to, const Vector2d& from_pixel,
                           const Vector2d& to_pixel, DrawingScratch& scratch) const {
  const double bend = window_.bend() * (to - from).squaredNorm() / 8;  // off one chord
  const double margin = widened_ + scratch.widened_by;
  if (bend <= kSag) return TraceSegment(from_pixel, to_pixel, margin + bend, scratch);
  const int chords =
      std::clamp(static_cast<int>(std::ceil(std::sqrt(bend / kSag))), 1, kMostChords);
  Vector2d at = from_pixel;
  for (int i = 1; i <= chords; ++i) {
    const Vector2d after =
        i == chords ? to_pixel : PixelAt(camera_.intrinsics(), from + (to - from) * i / chords);
    TraceSegment(at, after, margin + bend / (chords * chords), scratch);
    at = after;
  }
}

// Only the rows of the drawing before are not clear.
void PartDrawer::BeginRows(DrawingScratch& scratch) const {
  const auto height = static_cast<size_t>(size_.height) + kMoreRows;
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
}

void PartDrawer::TraceEdges(const HullEdges& edges, const Vector3d& eye,
                            DrawingScratch& scratch) const {
  const std::vector<Vector2d>& projected = scratch.projected;
  BeginRows(scratch);
  edges.ForOutline(eye, [&](uint32_t a, uint32_t b) {
    TraceEdge(projected[a], projected[b], scratch.pixels[a], scratch.pixels[b], scratch);
  });
}

void PartDrawer::TraceOutline(DrawingScratch& scratch) const {
  BeginRows(scratch);
  const Vector2d* from = &scratch.outline.back();
  Vector2d from_pixel = PixelAt(camera_.intrinsics(), *from);
  for (const Vector2d& to : scratch.outline) {
    const Vector2d to_pixel = PixelAt(camera_.intrinsics(), to);
    TraceEdge(*from, to, from_pixel, to_pixel, scratch);
    from = &to;
    from_pixel = to_pixel;
  }
}

PartDrawer::Extent PartDrawer::Trace(const Eigen::Isometry3d& world_from_body,
                                     const Eigen::Matrix3Xd& points, const HullEdges& edges,
                                     double growth, DrawingScratch& scratch,
                                     MaskWords plane) const {
  if (!(growth >= 0) || !std::isfinite(growth)) {
    throw std::invalid_argument("a body cannot grow by less than nothing");
  }
  // As whole matrices, which the processor multiplies faster than a turn and a move.
  const Eigen::Isometry3d camera_from_body(camera_.camera_from_world().matrix() *
                                           world_from_body.matrix());
  ProjectedExtent seen = Project(camera_from_body, points, scratch.projected);
  if (!std::isfinite(seen.sum) || !std::isfinite(window_.scale()) ||
      !std::isfinite(window_.bend())) {
    return Extent::kAll;
  }
  if (seen.farthest + growth <= 0) return Extent::kNothing;  // behind the camera
  const double least = 2 * growth + kNear;
  const bool cut = seen.nearest < least;
  if (cut) {
    PlacePoints(camera_from_body, points, scratch);
    if (!CutNearPlane(growth, least, scratch)) return Extent::kAll;
    if (scratch.points.empty()) return Extent::kNothing;
    const Eigen::Map<const Eigen::Matrix3Xd> before(
        scratch.points.data()->data(), 3, static_cast<Eigen::Index>(scratch.points.size()));
    seen = Project(Eigen::Isometry3d::Identity(), before, scratch.projected);
  }
  // What a ball's image reaches is between radius / depth and this: ReachOfBall.
  scratch.most_reach = growth * std::sqrt(1 + seen.off_axis) / (seen.nearest - growth);
  scratch.least_reach = growth / seen.farthest;
  scratch.widened_by = scratch.most_reach * window_.stretch();
  const Octagon& octagon = seen.octagon;
  const bool known = !edges.empty() && edges.points() == points.cols();
  if (!cut && known && window_.clear_of_fold() && scratch.widened_by <= kThin &&
      window_.Holds({octagon.low[0], octagon.low[1]}, {octagon.high[0], octagon.high[1]})) {
    const Octagon pixels = PixelsAt(camera_.intrinsics(), scratch.projected, scratch.pixels);
    if (!plane.empty() && IsClearOf(pixels, octagon, scratch, plane)) return Extent::kNothing;
    const Vector3d eye = -camera_from_body.linear().transpose() * camera_from_body.translation();
    TraceEdges(edges, eye, scratch);
    return Extent::kRows;
  }
  if (!plane.empty() && window_.clear_of_fold() && IsClear(octagon, scratch, plane)) {
    return Extent::kNothing;
  }
  if (!cut) PlacePoints(camera_from_body, points, scratch);
  WidenedOutline(growth, scratch);
  window_.Clip(scratch.outline, scratch.clipped);
  if (scratch.outline.empty()) return Extent::kNothing;
  TraceOutline(scratch);
  return Extent::kRows;
}

void PartDrawer::AddTouched(const Eigen::Isometry3d& world_from_body,
                            const Eigen::Matrix3Xd& points, const HullEdges& edges, double growth,
                            DrawingScratch& scratch, std::span<uint64_t> words) const {
  RequireWords(size_, static_cast<size_t>(points.cols()), words.size());
  scratch.rows = {0, size_.height - 1};
  switch (Trace(world_from_body, points, edges, growth, scratch, {})) {
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
                       const HullEdges& edges, double growth, DrawingScratch& scratch,
                       const DrawnPlane& plane) const {
  const MaskWords words = plane.words();
  RequireWords(size_, static_cast<size_t>(points.cols()), words.size());
  scratch.rows = plane.rows();
  switch (Trace(world_from_body, points, edges, growth, scratch, words)) {
    case Extent::kNothing:
      return false;
    case Extent::kAll:
      return AnyBit(words, 0, size_.pixels() - 1);
    case Extent::kRows:
      break;
  }
  return !ForEachRow(scratch,
                     [&](size_t first, size_t last) { return !AnyBit(words, first, last); });
}

PartDrawer::Bounds PartDrawer::bounds() const {
  return {.bounded = window_.clear_of_fold() && std::isfinite(window_.scale()) &&
                     std::isfinite(window_.bend()) && std::isfinite(window_.stretch()),
          .box = window_.box(),
          .circle = window_.radius() > 0 ? 1.0014 * window_.radius() : 0,
          .stretch = window_.stretch(),
          .shrink = window_.shrink(),
          .bend = window_.bend(),
          .widened = widened_};
}

void PartDrawer::AddCovered(const Eigen::Isometry3d& world_from_body,
                            const Eigen::Matrix3Xd& points, DrawingScratch& scratch,
                            std::span<uint64_t> words) const {
  RequireWords(size_, static_cast<size_t>(points.cols()), words.size());
  const ProjectedExtent seen =
      Project(camera_.camera_from_world() * world_from_body, points, scratch.projected);
  if (!std::isfinite(seen.sum) || seen.nearest < kNear) return;
  ConvexHull(scratch.projected, scratch.hull);
  if (scratch.hull.size() < 3) return;
  corners_.AddInside(scratch.hull, words);
}

}  // namespace silhouette
