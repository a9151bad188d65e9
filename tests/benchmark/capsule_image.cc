// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/capsule_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

namespace silhouette::benchmarks {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// The x that a shape takes within a row of pixels.
struct Extent {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void Add(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
  void AddDisc(const Disc& disc, double top) {
    const double off = std::max({0.0, top - disc.y, disc.y - (top + 1)});
    if (off > disc.radius) return;
    const double half = std::sqrt(disc.radius * disc.radius - off * off);
    Add(disc.x - half);
    Add(disc.x + half);
  }
};

// A side of the hull, from the upper to the lower end.
struct Side {
  Side(Vector2d p, Vector2d q) : upper(p), lower(q) {
    if (upper.y() > lower.y()) std::swap(upper, lower);
    const double height = lower.y() - upper.y();
    x_per_y = height > 0 ? (lower.x() - upper.x()) / height : 0;
  }
  double XAt(double y) const {
    if (y <= upper.y()) return upper.x();
    if (y >= lower.y()) return lower.x();
    return upper.x() + (y - upper.y()) * x_per_y;
  }
  void AddTo(Extent& extent, double top) const {
    if (top > lower.y() || top + 1 < upper.y()) return;
    extent.Add(XAt(top));
    extent.Add(XAt(top + 1));
  }

  Vector2d upper;
  Vector2d lower;
  double x_per_y = 0;
};

// The sides of the hull; nothing if one disc lies within the other.
std::optional<std::array<Side, 2>> SidesOf(const Disc& a, const Disc& b) {
  const Vector2d from(a.x, a.y);
  const Vector2d to(b.x, b.y);
  const Vector2d along = to - from;
  const double distance = along.norm();
  if (distance <= std::abs(a.radius - b.radius)) return std::nullopt;
  // The outward normal n of a tangent: n . from + a.radius = n . to + b.radius.
  const Vector2d unit = along / distance;
  const Vector2d across(-unit.y(), unit.x());
  const double sine = (a.radius - b.radius) / distance;
  const double cosine = std::sqrt(1 - sine * sine);
  const auto side = [&](double sign) {
    const Vector2d normal = sine * unit + sign * cosine * across;
    return Side(from + a.radius * normal, to + b.radius * normal);
  };
  return std::array{side(1), side(-1)};
}

// Sets the bits first..last.
void SetRun(std::span<uint64_t> words, size_t first, size_t last) {
  const uint64_t from = ~uint64_t{0} << (first % 64);
  const uint64_t to = ~uint64_t{0} >> (63 - last % 64);
  size_t word = first / 64;
  if (word == last / 64) {
    words[word] |= from & to;
    return;
  }
  words[word] |= from;
  while (++word < last / 64) words[word] = ~uint64_t{0};
  words[word] |= to;
}

}  // namespace

double DistanceTo(const Capsule& capsule, const Vector3d& point) {
  const Vector3d axis = capsule.to - capsule.from;
  const double length2 = axis.squaredNorm();
  const double at =
      length2 > 0 ? std::clamp((point - capsule.from).dot(axis) / length2, 0.0, 1.0) : 0;
  return (point - capsule.from - at * axis).norm() - capsule.radius;
}

PinholeView::PinholeView(const Vector3d& centre, const Vector3d& target, double half_width,
                         MaskSize size)
    : centre_(centre), focal_(size.width / (2 * half_width)), size_(size) {
  const Vector3d forward = (target - centre).normalized();
  const Vector3d right = forward.cross(Vector3d::UnitZ()).normalized();
  camera_from_world_ << right.transpose(), forward.cross(right).transpose(), forward.transpose();
}

Disc PinholeView::See(const Vector3d& ball, double radius) const {
  const Vector3d in_camera = camera_from_world_ * (ball - centre_);
  const double scale = focal_ / in_camera.z();
  return {size_.width / 2.0 + scale * in_camera.x(), size_.height / 2.0 + scale * in_camera.y(),
          scale * radius};
}

Vector3d PinholeView::Ray(double x, double y) const {
  const Vector3d in_camera(x - size_.width / 2.0, y - size_.height / 2.0, focal_);
  return (camera_from_world_.transpose() * in_camera).normalized();
}

void DrawHull(const Disc& a, const Disc& b, MaskSize size, std::span<uint64_t> words) {
  const std::optional<std::array<Side, 2>> sides = SidesOf(a, b);
  const double above = std::floor(std::min(a.y - a.radius, b.y - b.radius));
  const double below = std::floor(std::max(a.y + a.radius, b.y + b.radius));
  const int first = static_cast<int>(std::max(0.0, above));
  const int last = static_cast<int>(std::min(size.height - 1.0, below));
  for (int y = first; y <= last; ++y) {
    // The part of the hull within the row is convex: it touches a run of pixels.
    Extent extent;
    extent.AddDisc(a, y);
    extent.AddDisc(b, y);
    if (sides) {
      for (const Side& side : *sides) side.AddTo(extent, y);
    }
    if (extent.high < 0 || extent.low >= size.width || extent.low > extent.high) continue;
    const auto left = static_cast<size_t>(std::max(0.0, extent.low));
    const auto right = static_cast<size_t>(std::min(size.width - 1.0, extent.high));
    const size_t row = static_cast<size_t>(y) * static_cast<size_t>(size.width);
    SetRun(words, row + left, row + right);
  }
}

void Draw(const Capsule& capsule, const PinholeView& view, std::span<uint64_t> words) {
  DrawHull(view.See(capsule.from, capsule.radius), view.See(capsule.to, capsule.radius),
           view.size(), words);
}

Mask MaskOf(std::span<const Capsule> capsules, const PinholeView& view) {
  std::vector<uint64_t> words(view.size().words());
  for (const Capsule& capsule : capsules) Draw(capsule, view, words);
  return Mask::FromWords(view.size(), std::move(words));
}

}  // namespace silhouette::benchmarks
