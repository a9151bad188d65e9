// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/settings.h"

#include <numbers>
#include <stdexcept>

#include "common/yaml/strict_yaml.h"
#include "tools/silhouette-experiments/paper/voxel_hull.h"

namespace silhouette::paper {
namespace {

constexpr size_t kMostCameras = 4;

double Positive(const YamlNode& node) {
  const double value = node.As<double>();
  if (!(value > 0) || value > 1e6) node.Fail("must be greater than 0");
  return value;
}

int Whole(const YamlNode& node, int least, int greatest) {
  const int value = node.As<int>();
  if (value < least || value > greatest) {
    node.Fail("must be from " + std::to_string(least) + " to " + std::to_string(greatest));
  }
  return value;
}

Eigen::Vector3d Vector(const YamlNode& node) {
  const std::vector<double> values = node.Values<double>(3);
  return {values[0], values[1], values[2]};
}

std::array<double, 2> Pair(const YamlNode& node) {
  const std::vector<double> values = node.Values<double>(2);
  return {values[0], values[1]};
}

ArmShape ReadArm(const YamlNode& node) {
  YamlMap map(node);
  ArmShape arm;
  const std::vector<YamlNode> links = map.Required("links").Items(2);
  arm.links = {Positive(links[0]), Positive(links[1])};
  arm.spheres_per_link = Whole(map.Required("spheres_per_link"), 2, 100);
  arm.sphere_radius = Positive(map.Required("sphere_radius"));
  map.Finish();
  return arm;
}

Sphere ReadSphere(const YamlNode& node) {
  YamlMap map(node);
  const Sphere sphere{Vector(map.Required("centre")), Positive(map.Required("radius"))};
  map.Finish();
  return sphere;
}

std::vector<ParallelCamera> ReadRig(const YamlNode& node, double half_width, int pixels) {
  std::vector<ParallelCamera> cameras;
  for (const YamlNode& item : node.Items()) {
    try {
      cameras.emplace_back(Vector(item), half_width, pixels);
    } catch (const std::invalid_argument& mistake) {
      item.Fail(mistake.what());
    }
  }
  if (cameras.empty() || cameras.size() > kMostCameras) node.Fail("must be one to four cameras");
  try {
    CalibrationOf(cameras);
  } catch (const std::invalid_argument& mistake) {
    node.Fail(mistake.what());
  }
  return cameras;
}

RandomScenes ReadRandomScenes(const YamlNode& node) {
  YamlMap map(node);
  RandomScenes scenes;
  scenes.seed = static_cast<uint64_t>(Whole(map.Required("seed"), 0, 1'000'000'000));
  scenes.count = Whole(map.Required("scenes"), 1, 100'000);
  const std::vector<YamlNode> spheres = map.Required("spheres").Items(2);
  scenes.spheres = {Whole(spheres[0], 1, 1000), Whole(spheres[1], 1, 1000)};
  const std::vector<YamlNode> radius = map.Required("radius").Items(2);
  scenes.radius = {Positive(radius[0]), Positive(radius[1])};
  scenes.box = Positive(map.Required("box"));
  if (scenes.spheres[0] > scenes.spheres[1]) spheres[0].Fail("must not be above the second");
  if (scenes.radius[0] > scenes.radius[1]) radius[0].Fail("must not be above the second");
  map.Finish();
  return scenes;
}

SoundSettings ReadSound(const YamlNode& node) {
  YamlMap map(node);
  SoundSettings sound;
  sound.least_radius = Positive(map.Required("least_radius"));
  sound.edge = Positive(map.Required("edge"));
  sound.occluded_scenes = Whole(map.Required("occluded_scenes"), 0, 1'000'000);
  sound.off_grid_scenes = Whole(map.Required("off_grid_scenes"), 0, 1'000'000);
  map.Finish();
  return sound;
}

ReconstructionSettings ReadReconstruction(const YamlNode& node) {
  YamlMap map(node);
  ReconstructionSettings reconstruction;
  const YamlNode voxels = map.Required("voxels");
  reconstruction.voxels.clear();
  for (const YamlNode& item : voxels.Items()) {
    reconstruction.voxels.push_back(Whole(item, 8, VoxelCube::kMostEdge));
  }
  if (reconstruction.voxels.empty()) voxels.Fail("must be at least one number");
  reconstruction.scenes = Whole(map.Required("scenes"), 1, 100'000);
  map.Finish();
  return reconstruction;
}

FloorPlan ReadFloorPlan(const YamlNode& node) {
  YamlMap map(node);
  FloorPlan plan;
  const std::vector<YamlNode> size = map.Required("size").Items(2);
  plan.size = {Positive(size[0]), Positive(size[1])};
  for (const YamlNode& item : map.Required("obstacles").Items()) {
    YamlMap rectangle(item);
    plan.obstacles.push_back({Pair(rectangle.Required("from")), Pair(rectangle.Required("to"))});
    rectangle.Finish();
  }
  const YamlNode cameras = map.Required("cameras");
  for (const YamlNode& item : cameras.Items()) {
    YamlMap camera(item);
    plan.cameras.push_back({camera.Get<std::string>("name"), Pair(camera.Required("at"))});
    camera.Finish();
  }
  if (plan.cameras.size() != 3) cameras.Fail("must be three cameras");
  map.Finish();
  return plan;
}

}  // namespace

Settings ReadSettings(const std::string& path) {
  YamlMap map(path.empty() ? YamlNode(YAML::Load(DefaultSettingsText()), "paper.yaml", "")
                           : YamlNode::FromFile(path));
  Settings settings;
  settings.half_width = Positive(map.Required("half_width"));
  settings.pixels = Whole(map.Required("pixels"), 8, 256);
  settings.arm = ReadArm(map.Required("robot"));
  settings.steps = Whole(map.Required("steps"), 3, 360);
  const YamlNode rigs_node = map.Required("rigs");
  YamlMap rigs(rigs_node);
  for (const std::string& name : rigs.Keys()) {
    settings.rigs[name] = ReadRig(rigs.Required(name), settings.half_width, settings.pixels);
  }
  if (settings.rigs.empty()) rigs_node.Fail("must have at least one rig");
  YamlMap figure7(map.Required("figure7"));
  for (const YamlNode& item : figure7.Required("obstacles").Items()) {
    settings.figure7.push_back(ReadSphere(item));
  }
  const std::vector<YamlNode> parked = figure7.Required("parked").Items(2);
  settings.parked = {parked[0].AsAngle(), parked[1].AsAngle()};
  figure7.Finish();
  settings.random = ReadRandomScenes(map.Required("random"));
  settings.sound = ReadSound(map.Required("sound"));
  settings.reconstruction = ReadReconstruction(map.Required("reconstruction"));
  settings.floor_plan = ReadFloorPlan(map.Required("figure1"));
  map.Finish();
  return settings;
}

}  // namespace silhouette::paper
