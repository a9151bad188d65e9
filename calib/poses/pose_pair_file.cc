// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_pair_file.h"

#include "calib/poses/pose_notation.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

Eigen::Isometry3d ReadPose(const YamlNode& node, const PoseNotation& notation,
                           const std::vector<double>& values) {
  const absl::StatusOr<Eigen::Isometry3d> pose = notation.Pose(values);
  if (!pose.ok()) node.Fail(std::string(pose.status().message()));
  return *pose;
}

Eigen::Isometry3d ReadMatrix(const YamlNode& node) {
  static const PoseNotation matrix = PoseNotation::Named("matrix", "m").value();
  return ReadPose(node, matrix, node.Values<double>(16));
}

Eigen::Isometry3d ReadTransform(const YamlNode& node) {
  YamlMap map(node);
  std::vector<double> values;
  YamlMap translation(map.Required("translation"));
  for (const char* key : {"x", "y", "z"}) values.push_back(translation.Get<double>(key));
  YamlMap rotation(map.Required("rotation"));
  for (const char* key : {"x", "y", "z", "w"}) values.push_back(rotation.Get<double>(key));
  return ReadPose(node, PoseNotation(), values);
}

}  // namespace

absl::StatusOr<PairFile> PosePairsFromText(const std::string& text, const std::string& file) {
  try {
    const YamlNode root = YamlNode::FromText(text, file);
    const bool moveit = root.IsSequence();
    PairFile read{.pairs = {}, .easy_handeye = !moveit};
    std::vector<PosePair>& pairs = read.pairs;
    const YamlNode samples = moveit ? root : YamlMap(root).Required("samples");
    for (const YamlNode& sample : samples.Items()) {
      YamlMap map(sample);
      if (moveit) {
        pairs.push_back({ReadMatrix(map.Required("effector_wrt_world")),
                         ReadMatrix(map.Required("object_wrt_sensor"))});
      } else {
        pairs.push_back(
            {ReadTransform(map.Required("robot")), ReadTransform(map.Required("tracking"))});
      }
      map.Finish();
    }
    return read;
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  }
}

}  // namespace silhouette
