// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawing/swept_bodies.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Places beside the axis: x along it, y away from it.
using Meridian = std::vector<Vector2d>;

// By which what stands for an arc may be beyond it: metres, and of its radius.
constexpr double kArcExcess = 0.001;
constexpr double kArcShare = 0.005;
// The greatest number of turning joints beyond the first whose ranges are cut into parts, up to 32
// each. Further joints, those at the tip, count as whole turns: a larger body.
constexpr size_t kMostFollowed = 2;
// Beyond its range a joint is taken to move, radians or metres: what its limits tolerate, and more.
constexpr double kBeyondLimit = 1e-5;

// What a joint adds to the link's place on its parent, beyond its range too.
struct Way {
  double low = 0;
  double high = 0;
};

Way WayOf(const ChainLink& link, std::span<const JointRange> ranges) {
  const JointRange& range = ranges[static_cast<size_t>(link.joint)];
  if (link.slides && range.turn) {
    throw std::invalid_argument("a slide that follows a joint that turns without end has no end");
  }
  const double beyond = kBeyondLimit * std::abs(link.factor);
  const double a = link.factor * range.lower + link.offset;
  const double b = link.factor * range.upper + link.offset;
  return {std::min(a, b) - beyond, std::max(a, b) + beyond};
}

Matrix3Xd MovedAlong(const Matrix3Xd& points, const Vector3d& axis, const Way& way) {
  Matrix3Xd both(3, 2 * points.cols());
  both << (points.colwise() + way.low * axis), (points.colwise() + way.high * axis);
  return both;
}

// The upper hull of the places, from the least x to the greatest.
void KeepUpperHull(Meridian& places) {
  std::ranges::sort(places, [](const Vector2d& a, const Vector2d& b) {
    return a.x() < b.x() || (a.x() == b.x() && a.y() > b.y());
  });
  size_t kept = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    const Vector2d place = places[i];
    if (kept > 0 && place.x() == places[kept - 1].x()) continue;
    while (kept >= 2) {
      const Vector2d along = places[kept - 1] - places[kept - 2];
      const Vector2d on = place - places[kept - 2];
      if (along.x() * on.y() - along.y() * on.x() < 0) break;
      --kept;
    }
    places[kept++] = place;
  }
  places.resize(kept);
}

// Calls `take` with points in the frame of `root`, whose joint stands at 0, that hold in their hull
// what `points`, in the frame of the link `at`, are in a part of all joint values; with all parts
// in turn.
template <typename Take>
void Sweep(const KinematicChain& chain, size_t root, size_t at, const Matrix3Xd& points,
           std::span<const JointRange> ranges, const Take& take) {
  if (at == root) return take(points);
  const ChainLink& link = chain.links()[at];
  const auto parent = static_cast<size_t>(link.parent);
  if (link.joint < 0) {
    return Sweep(chain, root, parent, link.parent_from_link * points, ranges, take);
  }
  const Way way = WayOf(link, ranges);
  if (link.slides) {
    return Sweep(chain, root, parent, link.parent_from_link * MovedAlong(points, link.axis, way),
                 ranges, take);
  }
  const Eigen::Index count = points.cols();
  double span = way.high - way.low;
  const bool turn = ranges[static_cast<size_t>(link.joint)].turn;
  if (turn || span > 2 * std::numbers::pi) span = 2 * std::numbers::pi;
  const Matrix3Xd along = link.axis * (link.axis.transpose() * points);
  const double radius = (points - along).colwise().norm().maxCoeff();
  // The tangents at an arc's ends meet this much farther out than the arc.
  const double excess = std::max(kArcExcess, kArcShare * radius);
  const double half = std::min(std::acos(radius / (radius + excess)), std::numbers::pi / 8);
  const auto parts = std::max(1, static_cast<int>(std::ceil(span / (2 * half))));
  const double step = span / parts;
  const Matrix3Xd corner = along + (points - along) / std::cos(step / 2);
  Matrix3Xd swept(3, 3 * count);
  for (int part = 0; part < parts; ++part) {
    const double from = way.low + part * step;
    const auto turned = [&](double angle, const Matrix3Xd& what) -> Matrix3Xd {
      const Eigen::Matrix3d by = Eigen::AngleAxisd(angle, link.axis).toRotationMatrix();
      return link.parent_from_link * (by * what).eval();
    };
    swept.leftCols(count) = turned(from, points);
    swept.middleCols(count, count) = turned(from + step / 2, corner);
    swept.rightCols(count) = turned(from + step, points);
    Sweep(chain, root, parent, swept, ranges, take);
  }
}

// How far from the axis something is at most, by place along it.
class Profile {
 public:
  Profile(double low, double high) : low_(low), width_((high - low) / kBins) { radius_.fill(-1); }

  // An upper hull, within low and high.
  void Add(const Meridian& hull) {
    const size_t first = BinOf(hull.front().x());
    const size_t last = BinOf(hull.back().x());
    for (size_t bin = first; bin <= last; ++bin) {
      for (const double edge : {Edge(bin), Edge(bin + 1)}) Raise(bin, RadiusAt(hull, edge));
    }
    for (const Vector2d& place : hull) Raise(BinOf(place.x()), place.y());
  }

  // Convex meridians that hold all that was added.
  std::vector<Meridian> ConvexPieces() const {
    std::vector<Piece> pieces = {PieceOf(0, kBins)};
    while (pieces.size() < kMostPieces) {
      double volume = 0;
      for (const Piece& piece : pieces) volume += piece.volume;
      double most_gain = kLeastGain * volume;
      size_t cut = pieces.size();
      Piece below;
      Piece above;
      for (size_t i = 0; i < pieces.size(); ++i) {
        for (size_t bin = pieces[i].first + 1; bin < pieces[i].end; ++bin) {
          Piece left = PieceOf(pieces[i].first, bin);
          Piece right = PieceOf(bin, pieces[i].end);
          const double gain = pieces[i].volume - left.volume - right.volume;
          if (gain <= most_gain) continue;
          most_gain = gain;
          cut = i;
          below = std::move(left);
          above = std::move(right);
        }
      }
      if (cut == pieces.size()) break;
      pieces[cut] = std::move(below);
      pieces.push_back(std::move(above));
    }
    std::vector<Meridian> meridians;
    for (Piece& piece : pieces) {
      if (!piece.outline.empty()) meridians.push_back(std::move(piece.outline));
    }
    return meridians;
  }

 private:
  static constexpr size_t kBins = 64;
  static constexpr size_t kMostPieces = 6;
  static constexpr double kLeastGain = 0.02;  // of the volume
  static constexpr int kDirections = 8;       // of half a turn

  struct Piece {
    size_t first = 0;
    size_t end = 0;
    Meridian outline;  // from the greatest x to the least
    double volume = 0;
  };

  double Edge(size_t bin) const { return low_ + static_cast<double>(bin) * width_; }

  size_t BinOf(double at) const {
    if (!(width_ > 0)) return 0;
    const double bin = std::floor((at - low_) / width_);
    return static_cast<size_t>(std::clamp(bin, 0.0, static_cast<double>(kBins - 1)));
  }

  void Raise(size_t bin, double radius) { radius_[bin] = std::max(radius_[bin], radius); }

  // Of the nearest place of the hull.
  static double RadiusAt(const Meridian& hull, double at) {
    if (at <= hull.front().x()) return hull.front().y();
    if (at >= hull.back().x()) return hull.back().y();
    const auto after =
        std::ranges::upper_bound(hull, at, {}, [](const Vector2d& p) { return p.x(); });
    const Vector2d& a = *(after - 1);
    const Vector2d& b = *after;
    return a.y() + (at - a.x()) / (b.x() - a.x()) * (b.y() - a.y());
  }

  // What lies in some bins, between tangents in kDirections.
  Piece PieceOf(size_t first, size_t end) const {
    constexpr double kStep = std::numbers::pi / kDirections;
    constexpr double kNone = -std::numeric_limits<double>::infinity();
    Piece piece{.first = first, .end = end, .outline = {}, .volume = 0};
    std::array<double, kDirections + 1> far;
    far.fill(kNone);
    for (size_t bin = first; bin < end; ++bin) {
      if (radius_[bin] < 0) continue;
      for (int i = 0; i <= kDirections; ++i) {
        const double along =
            std::max(std::cos(i * kStep) * Edge(bin), std::cos(i * kStep) * Edge(bin + 1));
        far[static_cast<size_t>(i)] =
            std::max(far[static_cast<size_t>(i)], along + std::sin(i * kStep) * radius_[bin]);
      }
    }
    if (far[0] == kNone) return piece;
    for (int i = 0; i < kDirections; ++i) {
      const double a = far[static_cast<size_t>(i)];
      const double b = far[static_cast<size_t>(i) + 1];
      const double x = (a * std::sin((i + 1) * kStep) - b * std::sin(i * kStep)) / std::sin(kStep);
      const double y = (b * std::cos(i * kStep) - a * std::cos((i + 1) * kStep)) / std::sin(kStep);
      piece.outline.emplace_back(x, std::max(y, 0.0));
    }
    for (size_t i = 1; i < piece.outline.size(); ++i) {
      const Vector2d& a = piece.outline[i - 1];
      const Vector2d& b = piece.outline[i];
      piece.volume += std::abs(a.x() - b.x()) * (a.y() * a.y() + a.y() * b.y() + b.y() * b.y()) *
                      std::numbers::pi / 3;
    }
    return piece;
  }

  double low_;
  double width_;
  std::array<double, kBins> radius_;  // negative: there is nothing
};

// Points whose hull holds what is round about an axis through the origin.
Matrix3Xd Round(const Meridian& outline, const Vector3d& axis) {
  constexpr int kCorners = 16;
  constexpr double kSame = 1e-6;  // metres
  const Vector3d across = axis.unitOrthogonal();
  const Vector3d up = axis.cross(across);
  std::vector<Vector3d> points;
  for (size_t i = 0; i < outline.size(); ++i) {
    if (i > 0 && outline[i] == outline[i - 1]) continue;
    const Vector3d centre = outline[i].x() * axis;
    if (outline[i].y() < kSame) {
      points.push_back(centre);
      if (outline[i].y() == 0) continue;
    }
    const double radius = outline[i].y() / std::cos(std::numbers::pi / kCorners);
    for (int corner = 0; corner < kCorners; ++corner) {
      const double angle = 2 * std::numbers::pi * corner / kCorners;
      points.emplace_back(centre + radius * (std::cos(angle) * across + std::sin(angle) * up));
    }
  }
  Matrix3Xd columns(3, static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) columns.col(static_cast<Eigen::Index>(i)) = points[i];
  return columns;
}

// Half of an octagon about a circle of that radius stands for a place.
void Grow(Meridian& places, double radius) {
  if (radius == 0) return;
  const double less = radius * std::tan(std::numbers::pi / 8);
  Meridian grown;
  for (const Vector2d& place : places) {
    for (const Vector2d& by : {Vector2d(-radius, less), Vector2d(-less, radius),
                               Vector2d(less, radius), Vector2d(radius, less)}) {
      grown.push_back(place + by);
    }
  }
  places = std::move(grown);
}

}  // namespace

// The bodies that parts sweep that move with `link` or a link beyond it, with few joints beyond.
static std::vector<RobotPart> SweptByFew(const KinematicChain& chain, size_t link,
                                         std::span<const RobotPart> parts,
                                         std::span<const JointRange> ranges) {
  const ChainLink& root = chain.links()[link];
  double radius = parts[0].radius;
  for (const RobotPart& part : parts) radius = std::min(radius, part.radius);
  std::vector<Meridian> hulls;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const RobotPart& part : parts) {
    Sweep(chain, link, part.moves_with, part.points, ranges, [&](const Matrix3Xd& points) {
      Meridian places;
      for (Eigen::Index i = 0; i < points.cols(); ++i) {
        const double along = root.axis.dot(points.col(i));
        places.emplace_back(along, (points.col(i) - along * root.axis).norm());
      }
      KeepUpperHull(places);
      Grow(places, part.radius - radius);
      KeepUpperHull(places);
      low = std::min(low, places.front().x());
      high = std::max(high, places.back().x());
      hulls.push_back(std::move(places));
    });
  }
  Profile profile(low, high);
  for (const Meridian& hull : hulls) profile.Add(hull);

  std::vector<RobotPart> bodies;
  for (const Meridian& outline : profile.ConvexPieces()) {
    Matrix3Xd points = Round(outline, root.axis);
    if (root.slides) points = MovedAlong(points, root.axis, WayOf(root, ranges));
    const auto parent = static_cast<size_t>(root.parent);
    bodies.push_back({.link = parent,
                      .moves_with = parent,
                      .points = root.parent_from_link * points,
                      .radius = radius + kBeyondLimit,
                      .inner = {}});
  }
  return bodies;
}

std::vector<RobotPart> SweptBodies(const KinematicChain& chain, size_t link,
                                   std::span<const RobotPart> parts,
                                   std::span<const JointRange> ranges) {
  std::vector<RobotPart> left(parts.begin(), parts.end());
  std::vector<RobotPart> few;
  while (!left.empty()) {
    std::map<size_t, std::vector<RobotPart>> at_tip;  // by link
    for (RobotPart& part : left) {
      std::vector<size_t> turning;
      for (size_t at = part.moves_with; at != link;) {
        const ChainLink& here = chain.links()[at];
        if (here.joint >= 0 && !here.slides) turning.push_back(at);
        at = static_cast<size_t>(here.parent);
      }
      auto& to = turning.size() > kMostFollowed ? at_tip[turning.front()] : few;
      to.push_back(std::move(part));
    }
    left.clear();
    for (const auto& [tip, moved] : at_tip) {
      for (RobotPart& body : SweptByFew(chain, tip, moved, ranges)) left.push_back(std::move(body));
    }
  }
  return SweptByFew(chain, link, few, ranges);
}

}  // namespace silhouette
