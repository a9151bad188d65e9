// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/background.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace silhouette {
namespace {

constexpr double kTile = 0.5;      // metres between the joints of floor and walls
constexpr double kJoint = 0.012;   // width of a joint
constexpr double kSpeckle = 0.17;  // metres over which the texture changes

// A number from -1 to 1 for every lattice point.
double Lattice(uint64_t seed, int64_t u, int64_t v) {
  uint64_t x = seed * 0x9E3779B97F4A7C15u + static_cast<uint64_t>(u) * 0xBF58476D1CE4E5B9u +
               static_cast<uint64_t>(v) * 0x94D049BB133111EBu;
  x ^= x >> 31;
  x *= 0xD6E8FEB86659FD93u;
  x ^= x >> 29;
  return static_cast<double>(x >> 11) * 0x1p-52 - 1;
}

// Smooth noise from -1 to 1.
double Noise(uint64_t seed, double u, double v) {
  const double u0 = std::floor(u);
  const double v0 = std::floor(v);
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double a = smooth(u - u0);
  const double b = smooth(v - v0);
  const auto at = [&](int du, int dv) {
    return Lattice(seed, static_cast<int64_t>(u0) + du, static_cast<int64_t>(v0) + dv);
  };
  return (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

// How bright the room's surface is at (u, v) of a floor or wall, before light.
double Brightness(const SimulationSettings& settings, uint64_t surface, double u, double v) {
  const uint64_t seed = settings.seed * 8 + surface;
  const double speckle = 0.6 * Noise(seed, u / kSpeckle, v / kSpeckle) +
                         0.4 * Noise(seed + 1000, 7 * u / kSpeckle, 7 * v / kSpeckle);
  const auto off_joint = [](double x) {
    return std::abs(x / kTile - std::round(x / kTile)) * kTile;
  };
  const bool joint = std::min(off_joint(u), off_joint(v)) < kJoint / 2;
  return settings.room.brightness + settings.room.texture * (speckle - (joint ? 1 : 0));
}

// Where a ray from inside leaves the room.
struct Exit {
  double distance = 0;
  int axis = 0;        // whose wall it is
  bool upper = false;  // the wall at the greater coordinate

  // 0 to 5, one for every wall.
  uint64_t surface() const { return 2 * static_cast<uint64_t>(axis) + (upper ? 1 : 0); }
};

Exit LeaveRoom(const Room& room, const Eigen::Vector3d& from, const Eigen::Vector3d& ray) {
  Exit exit{.distance = std::numeric_limits<double>::infinity()};
  for (int axis = 0; axis < 3; ++axis) {
    if (ray[axis] == 0) continue;
    const bool upper = ray[axis] > 0;
    const double distance = ((upper ? room.upper : room.lower)[axis] - from[axis]) / ray[axis];
    if (distance < exit.distance) exit = {distance, axis, upper};
  }
  return exit;
}

}  // namespace

double Illumination(const Light& light, double cosine, bool in_shadow) {
  const double directed = (1 - light.ambient) * std::max(cosine, 0.0);
  return light.ambient + directed * (in_shadow ? 1 - light.shadow : 1);
}

Background MakeBackground(const CameraModel& camera, const SimulationSettings& settings) {
  const CameraIntrinsics& image = camera.intrinsics();
  const Eigen::Vector3d centre = camera.Centre();
  Background background;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      // The loader has seen that every pixel has a ray.
      const Eigen::Vector3d ray = camera.Ray({x, y}).value_or(Eigen::Vector3d::UnitZ());
      const Exit exit = LeaveRoom(settings.room, centre, ray);
      const Eigen::Vector3d point = centre + exit.distance * ray;
      const double brightness =
          255 * Brightness(settings, exit.surface(), point[(exit.axis + 1) % 3],
                           point[(exit.axis + 2) % 3]);
      const bool floor = exit.axis == 2 && !exit.upper;
      // The normal points into the room.
      const double cosine = (exit.upper ? 1 : -1) * settings.light.direction[exit.axis];
      background.ray.push_back(ray.cast<float>());
      background.distance.push_back(static_cast<float>(exit.distance));
      background.lit.push_back(
          static_cast<float>(brightness * Illumination(settings.light, cosine, false)));
      background.shadowed.push_back(
          floor ? static_cast<float>(brightness * Illumination(settings.light, cosine, true))
                : background.lit.back());
      background.receives_shadow.push_back(floor ? 1 : 0);
    }
  }
  return background;
}

}  // namespace silhouette
