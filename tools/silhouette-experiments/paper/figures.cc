// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/figures.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tools/silhouette-experiments/paper/bulk_sound_checker.h"
#include "tools/silhouette-experiments/paper/sphere_cell.h"
#include "tools/silhouette-experiments/paper/study.h"
#include "tools/silhouette-experiments/paper/voxel_hull.h"

namespace silhouette::paper {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kManyMissing = 0.02;  // share of the configuration space
constexpr int kMostTries = 50;         // scenes that are searched for one

Json JsonOf(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

Json JsonOf(const Spheres& spheres) {
  Json list = Json::array();
  for (const Sphere& sphere : spheres) {
    list.push_back({{"centre", JsonOf(sphere.centre)}, {"radius", sphere.radius}});
  }
  return list;
}

Json JsonOf(const FloorPlan& plan) {
  Json json = {{"size", plan.size}, {"obstacles", Json::array()}, {"cameras", Json::array()}};
  for (const Rectangle& each : plan.obstacles) {
    json["obstacles"].push_back({{"from", each.from}, {"to", each.to}});
  }
  for (const FlatCamera& each : plan.cameras) {
    json["cameras"].push_back({{"name", each.name}, {"at", each.at}});
  }
  return json;
}

Json RowsOf(const ObstacleImage& image) {
  Json rows = Json::array();
  for (int y = 0; y < image.size().height; ++y) {
    std::string row;
    for (int x = 0; x < image.size().width; ++x) {
      row += image.obstacle().at(x, y)  ? 'o'
             : image.unknown().at(x, y) ? 'u'
             : image.error().at(x, y)   ? 'e'
                                        : '.';
    }
    rows.push_back(row);
  }
  return rows;
}

Json SetupOf(const Settings& settings, Variant variant, const std::string& rig) {
  const Spheres robot = ArmAt(settings.arm, variant, settings.parked[0], settings.parked[1]);
  Json setup = {{"variant", NameOf(variant)},
                {"rig", rig},
                {"half_width", settings.half_width},
                {"robot", JsonOf(robot)},
                {"obstacles", JsonOf(settings.figure7)},
                {"cameras", Json::array()}};
  for (const ParallelCamera& camera : settings.rigs.at(rig)) {
    const Mask arm = ImageOf(camera, robot, Raster::kTouch);
    const Mask scene = ImageOf(camera, settings.figure7, Raster::kTouch) | arm;
    setup["cameras"].push_back({{"direction", JsonOf(camera.direction())},
                                {"right", JsonOf(camera.right())},
                                {"up", JsonOf(camera.up())},
                                {"obstacle_image", RowsOf(ObstacleImage::FromScene(scene, arm))}});
  }
  return setup;
}

std::string BitsOf(const ConfigurationSet& set, size_t configurations) {
  std::string bits;
  for (size_t i = 0; i < configurations; ++i) bits += Contains(set, i) ? '1' : '0';
  return bits;
}

Json VerdictsOf(const Settings& settings, Variant variant, const std::string& rig) {
  const ArmTable arms(settings, variant);
  const SphereCell cell(arms, settings.rigs.at(rig), Raster::kTouch);
  const ViewSet all = (ViewSet{1} << cell.views()) - 1;
  BulkChecker bulk(cell.lines());
  SphereScene scene;
  ConfigurationSet truth;
  std::vector<ObstacleImage> images;
  const int tries = std::min(kMostTries, settings.random.count);
  for (int number = 0; number < tries; ++number) {
    scene = RandomScene(settings, arms, number);
    truth = arms.Touching(scene.obstacles);
    images = cell.Look(scene.obstacles, scene.current);
    bulk.Look(images, cell.OnGrid());
    const int64_t missing = CountWithout(truth, bulk.Occupied(Preset::kPaper, all, cell.views()));
    if (missing > kManyMissing * static_cast<double>(arms.size())) break;
  }
  Json reported;
  for (Preset preset : AllPresets()) {
    if (IsSound(preset)) continue;
    const int min_views = MinViewsOf(OwnThreshold(preset), cell.views());
    reported[NameOf(preset)] = BitsOf(bulk.Occupied(preset, all, min_views), arms.size());
  }
  const SoundSpace sound(cell, settings.sound);
  const Spheres& robot = arms.At(scene.current);
  const SoundVerdicts verdicts = CheckSound(sound, images, all, BodyOf(robot), &robot);
  reported[NameOf(Preset::kSoundPlanes)] = BitsOf(verdicts.planes, arms.size());
  reported[NameOf(Preset::kSound)] = BitsOf(verdicts.voxels, arms.size());
  const VoxelCube cube(cell.cameras(), settings.half_width, settings.reconstruction.voxels.back());
  for (RobotOut out : {RobotOut::kHull, RobotOut::kBody}) {
    const VoxelHull hull(cube, images, all, robot, out);
    reported[NameOf(out)] = BitsOf(Touching(hull, arms), arms.size());
  }
  const auto steps = static_cast<size_t>(arms.steps());
  return {{"variant", NameOf(variant)},
          {"rig", rig},
          {"views", cell.views()},
          {"steps", arms.steps()},
          {"current", {scene.current / steps, scene.current % steps}},
          {"occupied", BitsOf(truth, arms.size())},
          {"reported", reported}};
}

}  // namespace

Json FiguresOf(const Settings& settings, std::span<const Variant> variants,
               std::span<const std::string> rigs) {
  Json figures = {{"floor_plan", JsonOf(settings.floor_plan)},
                  {"setups", Json::array()},
                  {"verdicts", Json::array()}};
  for (Variant variant : variants) {
    for (const std::string& rig : rigs) {
      figures["setups"].push_back(SetupOf(settings, variant, rig));
      figures["verdicts"].push_back(VerdictsOf(settings, variant, rig));
    }
  }
  return figures;
}

}  // namespace silhouette::paper
