// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/ray_scene.h"

#include <limits>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

EmbreeScene MeshScene(RTCDevice device, const TriangleMesh& mesh) {
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                               mesh.vertices.size()));
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      vertices[3 * i + static_cast<size_t>(axis)] = static_cast<float>(mesh.vertices[i][axis]);
    }
  }
  auto* indices = static_cast<uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(uint32_t), mesh.triangles.size()));
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (size_t corner = 0; corner < 3; ++corner) {
      indices[3 * i + corner] = mesh.triangles[i][corner];
    }
  }
  rtcCommitGeometry(geometry);
  EmbreeScene scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcAttachGeometry(scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene.get());
  return scene;
}

}  // namespace

RayScene::RayScene() : device_(rtcNewDevice("threads=1,set_affinity=0")) {
  if (device_ == nullptr) throw std::runtime_error("the ray tracer Embree does not start");
  scene_.reset(rtcNewScene(device_.get()));
  rtcSetSceneFlags(scene_.get(),
                   static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_DYNAMIC | RTC_SCENE_FLAG_ROBUST));
}

size_t RayScene::Add(std::span<const BodyPart> parts) {
  const size_t first = parts_.size();
  for (const BodyPart& body : parts) {
    Part part;
    part.mesh = MeshScene(device_.get(), body.mesh);
    part.brightness = static_cast<float>(body.brightness);
    part.tint = body.tint.cast<float>();
    for (const Eigen::Vector3d& vertex : body.mesh.vertices) part.box.extend(vertex);
    part.instance = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(part.instance, part.mesh.get());
    rtcCommitGeometry(part.instance);
    rtcAttachGeometryByID(scene_.get(), part.instance, static_cast<unsigned>(parts_.size()));
    rtcReleaseGeometry(part.instance);
    parts_.push_back(std::move(part));
  }
  return first;
}

void RayScene::RemoveFrom(size_t first) {
  while (parts_.size() > first) {
    rtcDetachGeometry(scene_.get(), static_cast<unsigned>(parts_.size() - 1));
    parts_.pop_back();
  }
}

void RayScene::Place(size_t part, const Eigen::Isometry3d& world_from_part) {
  Part& moved = parts_[part];
  moved.world_from_part = world_from_part;
  const Eigen::Matrix4f matrix = world_from_part.matrix().cast<float>();
  rtcSetGeometryTransform(moved.instance, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, matrix.data());
  if (!moved.visible) rtcEnableGeometry(moved.instance);
  moved.visible = true;
  rtcCommitGeometry(moved.instance);
}

void RayScene::Hide(size_t part) {
  if (parts_[part].visible) rtcDisableGeometry(parts_[part].instance);
  parts_[part].visible = false;
}

void RayScene::Commit() { rtcCommitScene(scene_.get()); }

namespace {

RTCRay RayOf(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) {
  RTCRay ray{};
  ray.org_x = origin.x();
  ray.org_y = origin.y();
  ray.org_z = origin.z();
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.tfar = std::numeric_limits<float>::infinity();
  ray.mask = ~0U;
  return ray;
}

}  // namespace

bool RayScene::Meets(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray = RayOf(origin, direction);
  rtcOccluded1(scene_.get(), &context, &ray);
  return ray.tfar < 0;
}

RTCRayHit RayScene::First(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit hit{.ray = RayOf(origin, direction), .hit = {}};
  hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene_.get(), &context, &hit);
  return hit;
}

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
  return scene_.Meets(origin.cast<float>(), direction.cast<float>());
}

double BodyRays::FirstOn(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  const RTCRayHit hit = scene_.First(origin.cast<float>(), direction.cast<float>());
  const bool met = hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  return met ? double{hit.ray.tfar} : std::numeric_limits<double>::infinity();
}

}  // namespace silhouette
