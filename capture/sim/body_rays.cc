#include "capture/sim/body_rays.h"

#include <limits>

namespace silhouette {
namespace {

RTCRay RayOf(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tfar = std::numeric_limits<float>::infinity();
  ray.mask = ~0U;
  return ray;
}

}  // namespace

BodyRays::BodyRays(std::span<const BodyPart> parts) {
  for (const BodyPart& part : parts) frames_.push_back(part.frame);
  scene_.Add(parts);
  scene_.Commit();
}

void BodyRays::Place(const Poses& poses) {
  for (size_t i = 0; i < frames_.size(); ++i) scene_.Place(i, poses[frames_[i]]);
  scene_.Commit();
}

bool BodyRays::Meets(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray = RayOf(origin, direction);
  rtcOccluded1(scene_.scene(), &context, &ray);
  return ray.tfar < 0;
}

double BodyRays::FirstOn(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit hit{.ray = RayOf(origin, direction), .hit = {}};
  hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene_.scene(), &context, &hit);
  const bool met = hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  return met ? double{hit.ray.tfar} : std::numeric_limits<double>::infinity();
}

}  // namespace silhouette
