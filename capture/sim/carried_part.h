// What the simulated robot carries, by the variant: the section `parts` of
// simulation.yaml.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/robot_model.h"
#include "capture/sim/placed_shape.h"
#include "common/yaml/strict_yaml.h"

namespace silhouette {

struct CarriedPart {
  std::string link;   // of the robot
  PlacedShape shape;  // its pose is in the link's frame
};

// By the name of the variant.
using CarriedParts = std::map<std::string, std::vector<CarriedPart>>;

// The variant of a robot that carries nothing, where the file says nothing else of it.
inline constexpr char kBareVariant[] = "default";

// Paths of meshes are relative to the file. Throws YamlError.
CarriedParts ReadCarriedParts(const YamlNode& node);

// The robot with what it carries, for pictures and truth alike. Where there are no parts at all, it
// is the same for every variant. InvalidArgument: there are some, but none for `variant`; a part is
// on a link that the robot does not have.
absl::StatusOr<RobotModel> Carrying(const RobotModel& robot, const CarriedParts& parts,
                                    const std::string& variant);

}  // namespace silhouette
