// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/placement/places.h"

#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "capture/sim/simulation.h"
#include "capture/sim/yaml_values.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {
namespace {

// Candidates are identified by name, and by number in tables and pictures.
constexpr size_t kMostCandidates = 1000;

int AtLeastOne(YamlMap& map, const std::string& key, int default_value) {
  const auto node = map.Optional(key);
  if (!node) return default_value;
  const int value = node->As<int>();
  if (value < 1) node->Fail("at least 1 is expected");
  return value;
}

// The points that the cameras at one place look at: a camera for each.
std::vector<Eigen::Vector3d> ReadLookAt(const YamlNode& node) {
  const std::vector<YamlNode> items = node.Items();
  if (items.empty()) node.Fail("[x, y, z] or a list of such points is expected");
  if (!items[0].IsSequence()) return {ReadVector(node)};
  std::vector<Eigen::Vector3d> points;
  for (const YamlNode& item : items) points.push_back(ReadVector(item));
  return points;
}

class PlacesReader {
 public:
  explicit PlacesReader(const YamlNode& root) : map_(root) {}

  Places Read() {
    const std::vector<int> sides = map_.Required("mask_size").Values<int>(2);
    places_.mask_size = {sides[0], sides[1]};
    if (!places_.mask_size.valid()) {
      map_.Required("mask_size").Fail("each side of a mask is 1 to 1024 pixels");
    }
    const YamlNode field = map_.Required("field_of_view");
    places_.field_of_view = field.AsAngle();
    if (!(places_.field_of_view > 0 && places_.field_of_view < std::numbers::pi)) {
      field.Fail("an angle between 0 and 180 deg is expected");
    }
    places_.cameras = AtLeastOne(map_, "cameras", 4);
    if (const auto look_at = map_.Optional("look_at")) look_at_ = ReadLookAt(*look_at);
    if (const auto list = map_.Optional("places")) {
      for (const YamlNode& item : list->Items()) ReadPlace(item);
    }
    if (const auto boxes = map_.Optional("boxes")) {
      for (const YamlNode& item : boxes->Items()) ReadBox(item);
    }
    if (const auto samples = map_.Optional("samples")) ReadSamples(*samples);
    map_.Finish();
    if (places_.candidates.empty()) {
      map_.node().Fail("there is no place for a camera; name some under 'places' or 'boxes'");
    }
    return std::move(places_);
  }

 private:
  std::vector<Eigen::Vector3d> LookAtOf(YamlMap& map) {
    const auto own = map.Optional("look_at");
    if (!own && look_at_.empty()) map.node().Fail("there is no 'look_at', here or for all places");
    return own ? ReadLookAt(*own) : look_at_;
  }

  void ReadPlace(const YamlNode& node) {
    YamlMap map(node);
    const std::string name = map.Get<std::string>("name");
    const Eigen::Vector3d position = ReadVector(map.Required("position"));
    const std::vector<Eigen::Vector3d> look_at = LookAtOf(map);
    map.Finish();
    Add(node, name, position, look_at);
  }

  void ReadBox(const YamlNode& node) {
    YamlMap map(node);
    const std::string name = map.Get<std::string>("name");
    const Eigen::Vector3d lower = ReadVector(map.Required("lower"));
    const YamlNode upper_node = map.Required("upper");
    const Eigen::Vector3d upper = ReadVector(upper_node);
    if (!((upper - lower).minCoeff() >= 0)) upper_node.Fail("it lies below 'lower'");
    const YamlNode counts_node = map.Required("counts");
    const std::vector<int> counts = counts_node.Values<int>(3);
    const std::vector<Eigen::Vector3d> look_at = LookAtOf(map);
    map.Finish();
    for (int count : counts) {
      if (count < 1) counts_node.Fail("at least one place along each edge is expected");
    }
    int number = 0;
    for (int z = 0; z < counts[2]; ++z) {
      for (int y = 0; y < counts[1]; ++y) {
        for (int x = 0; x < counts[0]; ++x) {
          const auto share = [&](int i, int axis) {
            return counts[axis] == 1 ? 0.5 : static_cast<double>(i) / (counts[axis] - 1);
          };
          const Eigen::Vector3d shares(share(x, 0), share(y, 1), share(z, 2));
          Add(node, absl::StrCat(name, " ", ++number), lower + shares.cwiseProduct(upper - lower),
              look_at);
        }
      }
    }
  }

  void Add(const YamlNode& node, const std::string& name, const Eigen::Vector3d& position,
           const std::vector<Eigen::Vector3d>& look_at) {
    for (size_t i = 0; i < look_at.size(); ++i) {
      const std::string own = look_at.size() == 1 ? name : absl::StrCat(name, "/", i + 1);
      if (!names_.insert(own).second) node.Fail("there is another place called '" + own + "'");
      if (places_.candidates.size() == kMostCandidates) {
        node.Fail(absl::StrCat("there are more than ", kMostCandidates, " cameras to choose from"));
      }
      const Eigen::Vector3d along = look_at[i] - position;
      if (!(along.norm() > 1e-6)) node.Fail("a camera looks at its own place");
      const bool steep = along.cross(Eigen::Vector3d::UnitZ()).norm() < 1e-3 * along.norm();
      const Eigen::Vector3d up = steep ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
      const MaskSize size = places_.mask_size;
      const double focal = 0.5 * size.width / std::tan(0.5 * places_.field_of_view);
      const CameraIntrinsics intrinsics{.width = size.width,
                                        .height = size.height,
                                        .fx = focal,
                                        .fy = focal,
                                        .cx = 0.5 * (size.width - 1),
                                        .cy = 0.5 * (size.height - 1)};
      places_.candidates.push_back(
          {own, position, look_at[i], CameraModel(intrinsics, LookAt(position, look_at[i], up))});
    }
  }

  void ReadSamples(const YamlNode& node) {
    YamlMap map(node);
    PlacementSamples& samples = places_.samples;
    samples.configurations = AtLeastOne(map, "configurations", samples.configurations);
    if (samples.configurations > 4096) map.Required("configurations").Fail("at most 4096");
    samples.scenes = AtLeastOne(map, "scenes", samples.scenes);
    samples.seed = static_cast<uint64_t>(AtLeastOne(map, "seed", 1));
    if (const auto range = map.Optional("obstacles")) {
      const std::vector<int> counts = range->Values<int>(2);
      if (counts[0] < 1 || counts[1] < counts[0]) range->Fail("least and most, from 1 on");
      samples.least_obstacles = counts[0];
      samples.most_obstacles = counts[1];
    }
    if (const auto range = map.Optional("radius")) {
      const std::vector<double> radii = range->Values<double>(2);
      if (!(radii[0] > 0) || !(radii[1] >= radii[0])) range->Fail("least and greatest, in metres");
      samples.least_radius = radii[0];
      samples.greatest_radius = radii[1];
    }
    map.Finish();
  }

  YamlMap map_;
  Places places_;
  std::vector<Eigen::Vector3d> look_at_;
  std::set<std::string> names_;
};

}  // namespace

absl::StatusOr<Places> LoadPlaces(const std::string& path) {
  try {
    return PlacesReader(YamlNode::FromFile(path)).Read();
  } catch (const YamlError& error) {
    return absl::InvalidArgumentError(error.what());
  }
}

}  // namespace silhouette
