// Rays against rigid bodies, without light or sensor: what a perfect camera could see of them.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "capture/sim/body_part.h"
#include "capture/sim/ray_scene.h"

namespace silhouette {

// Bodies in one pose at a time. Tracing may go on in several threads at once, but not while they
// are placed.
class BodyRays {
 public:
  // Throws std::runtime_error if the ray tracer does not start.
  explicit BodyRays(std::span<const BodyPart> parts);

  // `poses`: of the parts' frames.
  void Place(const Poses& poses);

  // Whether the ray, which does not end, meets a body.
  bool Meets(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  // The distance, in units of `direction`'s length, of the first body on a ray; infinity if there
  // is none.
  double FirstOn(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

 private:
  RayScene scene_;
  std::vector<size_t> frames_;  // by part
};

}  // namespace silhouette
