#include "capture/sim/carried_part.h"

#include <algorithm>
#include <filesystem>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace silhouette {

CarriedParts ReadCarriedParts(const YamlNode& node) {
  const std::string folder = std::filesystem::path(node.file()).parent_path().string();
  CarriedParts parts;
  YamlMap variants(node);
  for (const std::string& variant : variants.Keys()) {
    std::vector<CarriedPart>& carried = parts[variant];
    for (const YamlNode& item : variants.Required(variant).Items()) {
      YamlMap map(item);
      const std::string link = map.Get<std::string>("link");
      carried.push_back({link, ReadPlacedShape(map, "a part", folder)});
      map.Finish();
    }
  }
  return parts;
}

absl::StatusOr<RobotModel> Carrying(const RobotModel& robot, const CarriedParts& parts,
                                    const std::string& variant) {
  const auto found = parts.find(variant);
  if (found == parts.end()) {
    if (parts.empty() || variant == kBareVariant) return robot;
    return absl::InvalidArgumentError(absl::StrCat(
        "'parts' does not say what the robot carries in the variant '", variant, "', only in ",
        absl::StrJoin(parts, ", ",
                      [](std::string* out, const auto& known) {
                        absl::StrAppend(out, "'", known.first, "'");
                      }),
        "; state '", variant, ": []' if it is nothing"));
  }
  RobotModel carrying = robot;
  for (const CarriedPart& part : found->second) {
    const auto link = std::ranges::find(robot.links(), part.link, &RobotLink::name);
    if (link == robot.links().end()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "a part of the variant '", variant, "' is on the link '", part.link,
          "', which the robot does not have; its links are ",
          absl::StrJoin(robot.links(), ", ", [](std::string* out, const RobotLink& known) {
            absl::StrAppend(out, known.name);
          })));
    }
    carrying = carrying.WithBody(
        static_cast<size_t>(link - robot.links().begin()),
        {.shape = MeshShape{.path = "", .mesh = std::make_shared<TriangleMesh>(part.shape.mesh)},
         .link_from_shape = part.shape.pose,
         .colour = part.shape.brightness * part.shape.tint});
  }
  return carrying;
}

}  // namespace silhouette
