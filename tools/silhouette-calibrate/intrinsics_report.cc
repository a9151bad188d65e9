#include "tools/silhouette-calibrate/intrinsics_report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace silhouette {
namespace {

std::string Line(const SolvedCamera& camera, size_t name) {
  const std::string start =
      absl::StrFormat("%-*s  %6d  %7d  %8d  %6.3f  ", static_cast<int>(name), camera.name,
                      camera.images, camera.corners, camera.outliers, camera.rms);
  const std::string lens =
      absl::StrFormat("%8.2f %8.2f  ", camera.intrinsics[0], camera.intrinsics[1]);
  if (camera.edge_sigma == 0) return absl::StrCat(start, lens, "given\n");
  return absl::StrCat(start, lens,
                      absl::StrFormat("%6.3f  %6.3f  %3.0f %%\n", camera.centre_sigma,
                                      camera.edge_sigma, 100 * camera.covered));
}

}  // namespace

std::string LensReportText(const LensSolution& solution, const std::vector<std::string>& files) {
  size_t name = 4;
  for (const SolvedCamera& camera : solution.cameras) name = std::max(name, camera.name.size());
  std::string text = absl::StrFormat(
      "%-*s  images  corners  left out  rms px   focal lengths px  centre    edge   seen\n",
      static_cast<int>(name), "view");
  for (const SolvedCamera& camera : solution.cameras) text += Line(camera, name);
  const bool predicted =
      std::any_of(solution.cameras.begin(), solution.cameras.end(),
                  [](const SolvedCamera& camera) { return camera.edge_sigma > 0; });
  if (predicted) {
    text += "centre, edge: standard deviation of a projection there, px, at the boards' distance\n";
  }
  for (const LensGroup& group : solution.groups) {
    if (solution.groups.size() > 1) {
      absl::StrAppend(
          &text,
          absl::StrJoin(group.cameras, ", ",
                        [&](std::string* out, size_t i) { out->append(solution.cameras[i].name); }),
          ": ");
    }
    absl::StrAppendFormat(&text, "residuals are %.2f times what the corners' sigma says",
                          group.noise);
    if (group.warp) {
      absl::StrAppendFormat(&text, "; the board is bent by %.2f mm along, %.2f mm across",
                            1000 * std::abs(group.warp->x()), 1000 * std::abs(group.warp->y()));
    }
    text += "\n";
  }
  for (const std::string& warning : solution.warnings) {
    absl::StrAppend(&text, "warning: ", warning, "\n");
  }
  for (const std::string& file : files) absl::StrAppend(&text, "wrote ", file, "\n");
  return text;
}

std::string LensReportJson(const LensSolution& solution, const std::vector<std::string>& files) {
  using Json = nlohmann::ordered_json;
  const auto number = [](double value) { return std::isfinite(value) ? Json(value) : Json(); };
  Json cameras = Json::array();
  for (const SolvedCamera& camera : solution.cameras) {
    cameras.push_back({{"view", camera.name},
                       {"lens_model", camera.lens_model},
                       {"intrinsics", camera.intrinsics},
                       {"group", camera.group},
                       {"images", camera.images},
                       {"corners", camera.corners},
                       {"outliers", camera.outliers},
                       {"rms_px", number(camera.rms)},
                       {"focal_length_sigma", number(camera.focal_length_sigma)},
                       {"centre_sigma_px", number(camera.centre_sigma)},
                       {"edge_sigma_px", number(camera.edge_sigma)},
                       {"covered", camera.covered},
                       {"distance", camera.distance}});
  }
  Json groups = Json::array();
  for (const LensGroup& group : solution.groups) {
    std::vector<std::string> names;
    for (const size_t camera : group.cameras) names.push_back(solution.cameras[camera].name);
    Json warp;
    if (group.warp) warp = {group.warp->x(), group.warp->y()};
    groups.push_back({{"views", names}, {"noise_per_sigma", number(group.noise)}, {"warp", warp}});
  }
  return Json{{"cameras", cameras},
              {"groups", groups},
              {"warnings", solution.warnings},
              {"files", files}}
             .dump(2) +
         "\n";
}

}  // namespace silhouette
