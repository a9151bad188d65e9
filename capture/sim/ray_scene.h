// SPDX-License-Identifier: Apache-2.0
// Embree, as the renderer needs it: rigid parts whose poses change from frame to frame.
#pragma once

#include <embree3/rtcore.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "capture/sim/body_part.h"

namespace silhouette {

// Ends of ownership of Embree's objects.
struct ReleaseEmbree {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using EmbreeDevice = std::unique_ptr<std::remove_pointer_t<RTCDevice>, ReleaseEmbree>;
using EmbreeScene = std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseEmbree>;

// Tracing may go on in several threads at once, but not while parts are placed or replaced.
class RayScene {
 public:
  // Metres off a surface at which rays begin, so that the surface does not shadow itself.
  static constexpr float kLift = 1e-4F;

  // Throws std::runtime_error if Embree cannot start.
  RayScene();

  // Adds parts; returns the number of the first, the others follow.
  size_t Add(std::span<const BodyPart> parts);

  // Takes away all parts from number `first` on.
  void RemoveFrom(size_t first);

  // Puts a part where it is in this frame, or takes it out of sight.
  void Place(size_t part, const Eigen::Isometry3d& world_from_part);
  void Hide(size_t part);

  // Makes the placements count.
  void Commit();

  RTCScene scene() const { return scene_.get(); }

  // Whether a ray, which does not end, meets a part.
  bool Meets(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const;
  // The first part on a ray: hit.instID[0] is its number, ray.tfar the distance in units of
  // `direction`'s length; hit.geomID is RTC_INVALID_GEOMETRY_ID if there is none.
  RTCRayHit First(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const;

  size_t parts() const { return parts_.size(); }
  bool visible(size_t part) const { return parts_[part].visible; }
  float brightness(size_t part) const { return parts_[part].brightness; }
  const Eigen::Vector3f& tint(size_t part) const { return parts_[part].tint; }
  const Eigen::Isometry3d& world_from_part(size_t part) const {
    return parts_[part].world_from_part;
  }
  // The part's box in its own frame.
  const Eigen::AlignedBox3d& box(size_t part) const { return parts_[part].box; }

 private:
  struct Part {
    EmbreeScene mesh;
    RTCGeometry instance = nullptr;  // owned by scene_; its number there is the part's
    Eigen::AlignedBox3d box;
    Eigen::Isometry3d world_from_part = Eigen::Isometry3d::Identity();
    float brightness = 0;
    Eigen::Vector3f tint = Eigen::Vector3f::Ones();
    bool visible = true;
  };

  EmbreeDevice device_;
  EmbreeScene scene_;
  std::vector<Part> parts_;
};

// Rays against rigid bodies, without light or sensor: what a perfect camera could see of them.

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
