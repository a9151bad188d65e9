// SPDX-License-Identifier: Apache-2.0
#include "tools/program/path_file.h"

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace silhouette {

absl::StatusOr<PathFile> ParsePath(std::string_view text, const std::string& file) {
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    PathFile path{.file = file, .joints = {}, .waypoints = {}};
    json.at("waypoints").get_to(path.waypoints);
    if (json.contains("joints")) json["joints"].get_to(path.joints);
    if (!path.waypoints.empty()) return path;
    return absl::InvalidArgumentError(file + ": the path has no waypoint");
  } catch (const nlohmann::json::parse_error& error) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": not JSON, at byte ", error.byte));
  } catch (const nlohmann::json::exception&) {
    return absl::InvalidArgumentError(
        file +
        ": a list of configurations under the key \"waypoints\" is expected, and with "
        "\"joints\" the list of their joints' names");
  }
}

absl::Status RequireJoints(const PathFile& path, const std::vector<std::string>& joints) {
  if (path.joints.empty() || path.joints == joints) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      path.file, ": the path is of the joints ", absl::StrJoin(path.joints, ", "),
      ", and the cell's configurations are of ", absl::StrJoin(joints, ", "), ", in this order"));
}

}  // namespace silhouette
