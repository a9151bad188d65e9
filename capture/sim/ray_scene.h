// Embree, as the renderer needs it: rigid parts whose poses change from frame to frame.
#pragma once

#include <embree3/rtcore.h>

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

}  // namespace silhouette
