#include "calib/poses/survey_file.h"

#include <cmath>
#include <set>

#include "absl/status/status.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {
namespace {

Eigen::Matrix3d RotationOf(const YamlNode& node) {
  const std::vector<YamlNode> angles = node.Items(3);
  return (Eigen::AngleAxisd(angles[2].AsAngle(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(angles[1].AsAngle(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(angles[0].AsAngle(), Eigen::Vector3d::UnitX()))
      .matrix();
}

Eigen::Matrix3d QuaternionOf(const YamlNode& node) {
  const std::vector<double> values = node.Values<double>(4);
  const Eigen::Quaterniond rotation(values[3], values[0], values[1], values[2]);
  if (!(std::abs(rotation.norm() - 1) < 0.01)) {
    node.Fail("the quaternion x, y, z, w must have the length 1");
  }
  return rotation.normalized().matrix();
}

double SigmaOf(const YamlNode& node, double value) {
  if (!(value > 0) || !std::isfinite(value)) node.Fail("must be positive");
  return value;
}

SurveyedBoard ReadBoard(const YamlNode& node) {
  YamlMap map(node);
  SurveyedBoard board;
  board.board = map.Get<std::string>("board");
  const YamlNode position = map.Required("position");
  const std::vector<double> values = position.Values<double>(3);
  board.base_from_board.translation() = Eigen::Vector3d(values[0], values[1], values[2]);
  constexpr double kFarthest = 200;
  if (!(board.base_from_board.translation().norm() < kFarthest)) {
    position.Fail("is hundreds of metres away; give metres, not millimetres");
  }
  const std::optional<YamlNode> rotation = map.Optional("rotation");
  const std::optional<YamlNode> quaternion = map.Optional("quaternion");
  if (rotation && quaternion) quaternion->Fail("give either 'rotation' or 'quaternion'");
  if (rotation) board.base_from_board.linear() = RotationOf(*rotation);
  if (quaternion) board.base_from_board.linear() = QuaternionOf(*quaternion);
  if (const auto sigma = map.Optional("position_sigma")) {
    board.position_sigma = SigmaOf(*sigma, sigma->As<double>());
  }
  if (const auto sigma = map.Optional("rotation_sigma")) {
    board.rotation_sigma = SigmaOf(*sigma, sigma->AsAngle());
  }
  map.Finish();
  return board;
}

}  // namespace

absl::StatusOr<std::vector<SurveyedBoard>> SurveyFromText(const std::string& text,
                                                          const std::string& file) {
  try {
    std::vector<SurveyedBoard> boards;
    std::set<std::string> names;
    for (const YamlNode& node : YamlNode::FromText(text, file).Items()) {
      boards.push_back(ReadBoard(node));
      if (!names.insert(boards.back().board).second) {
        node.Fail("board '" + boards.back().board + "' is there twice");
      }
    }
    return boards;
  } catch (const YamlError& error) {
    return absl::InvalidArgumentError(error.what());
  }
}

}  // namespace silhouette
