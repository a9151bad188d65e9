// SPDX-License-Identifier: Apache-2.0
// HullEdges: the edges of the convex hull of a body's points, and which of them bound what an eye
// sees of it. Uses the standard library and Eigen alone.
//
// A value; used by any number of threads.
#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

namespace silhouette {

class HullEdges {
 public:
  // Of more points nothing is known: finding their edges takes their number to the third power.
  static constexpr Eigen::Index kMostPoints = 256;

  HullEdges() = default;
  // `points`: as columns, finite, metres. They may lie in a plane or on a line.
  explicit HullEdges(const Eigen::Matrix3Xd& points);

  // Nothing is known, or the hull is a point.
  bool empty() const { return edges_.empty(); }
  size_t size() const { return edges_.size(); }
  // How many there were.
  Eigen::Index points() const { return points_; }

  // How far a point is within the hull, metres, to 1 um; 0: it is not for certain.
  double DepthOf(const Eigen::Vector3d& point) const;

  // Calls `take(a, b)` with the numbers of the points at both ends of each edge where faces that
  // `eye` sees meet others. The images of these edges, in no order, are the outline of the image of
  // the hull, to 0.1 um; some within it may be among them. `eye`: outside the hull.
  template <typename Take>
  void ForOutline(const Eigen::Vector3d& eye, const Take& take) const {
    for (size_t i = 0; i < faces_.size(); ++i) {
      for (uint32_t bits = OutlineOf(faces_[i], eye); bits != 0; bits &= bits - 1) {
        const size_t edge = kLanes * i + static_cast<size_t>(std::countr_zero(bits));
        if (edge < edges_.size()) take(edges_[edge][0], edges_[edge][1]);
      }
    }
  }

 private:
  static constexpr size_t kLanes = 4;
  using Four [[gnu::vector_size(32)]] = double;

  // The planes of the two faces at each of four edges: normal * point + offset > 0 outside.
  struct Faces {
    std::array<std::array<Four, 4>, 2> planes;
  };

  // A bit for each edge.
  static uint32_t OutlineOf(const Faces& faces, const Eigen::Vector3d& eye);
  // Adds the edge between two points if it is one.
  void Add(const Eigen::Matrix3Xd& points, Eigen::Index a, Eigen::Index b);

  std::vector<std::array<uint32_t, 2>> edges_;
  std::vector<Faces> faces_;  // of kLanes edges
  Eigen::Index points_ = 0;
};

}  // namespace silhouette
