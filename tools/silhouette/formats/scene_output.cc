#include "tools/silhouette/formats/scene_output.h"

#include <algorithm>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/files.h"
#include "common/picture/sheet.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/formats/output.h"

namespace silhouette {
namespace {

constexpr int kColumnWidth = 320;  // pixels

Json SceneOutputJsonOf(const client::Scene& scene) {
  Json json{{"scene_id", scene.id},       {"database_generation", scene.database_generation},
            {"time", Spoken(scene.time)}, {"skew_ms", absl::ToDoubleMilliseconds(scene.skew)},
            {"variant", scene.variant},   {"joints", Json::object()},
            {"views", Json::array()},     {"defects", Json::array()}};
  for (const client::JointPosition& joint : scene.joints) {
    json["joints"][joint.name] = joint.position;
  }
  for (const client::SceneView& view : scene.views) {
    json["views"].push_back({{"view", view.view},
                             {"capture_time", Spoken(view.capture_time)},
                             {"foreground_pixels", view.foreground_pixels},
                             {"obstacle_pixels", view.obstacle_pixels},
                             {"unknown_pixels", view.unknown_pixels},
                             {"error_pixels", view.error_pixels},
                             {"core_error_pixels", view.core_error_pixels},
                             {"margin_pixels", view.margin},
                             {"ignored_pixels", view.ignored_pixels}});
  }
  for (const client::SceneDefect& defect : scene.defects) {
    json["defects"].push_back({{"reason", NameOf(defect.reason)}, {"message", defect.message}});
  }
  return json;
}

std::string SceneOutputTextOf(const client::Scene& scene) {
  std::string text = absl::StrFormat(
      "scene %d of %s, skew %.1f ms, database generation %d\n", scene.id, Spoken(scene.time),
      absl::ToDoubleMilliseconds(scene.skew), scene.database_generation);
  if (!scene.variant.empty() && scene.variant != "default") {
    absl::StrAppend(&text, "variant ", scene.variant, "\n");
  }
  for (const client::JointPosition& joint : scene.joints) {
    absl::StrAppendFormat(&text, "%s = %.6g\n", joint.name, joint.position);
  }
  std::vector<std::vector<std::string>> rows = {
      {"view", "foreground", "obstacle", "unknown", "error", "core error", "margin", "ignored"}};
  for (const client::SceneView& view : scene.views) {
    rows.push_back({view.view, absl::StrCat(view.foreground_pixels),
                    absl::StrCat(view.obstacle_pixels), absl::StrCat(view.unknown_pixels),
                    absl::StrCat(view.error_pixels), absl::StrCat(view.core_error_pixels),
                    absl::StrFormat("%.2f", view.margin), absl::StrCat(view.ignored_pixels)});
  }
  absl::StrAppend(&text, Table(rows));
  for (const client::SceneDefect& defect : scene.defects) {
    absl::StrAppend(&text, "not free: ", defect.message, "\n");
  }
  return text;
}

absl::StatusOr<Picture> ReadCameraImage(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadWholeFile(file));
  const std::vector<uint8_t> buffer(bytes.begin(), bytes.end());
  Picture picture = buffer.empty() ? Picture() : cv::imdecode(buffer, cv::IMREAD_COLOR);
  if (picture.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("'", file, "' is not an image"));
  }
  return picture;
}

// Stretched to the column's width and `height`, pixels as rectangles.
Picture Stretched(const Picture& picture, int height, int interpolation) {
  Picture stretched;
  cv::resize(picture, stretched, cv::Size(kColumnWidth, height), 0, 0, interpolation);
  return stretched;
}

// The rows of one view, top to bottom.
struct Column {
  std::string view;
  Picture camera;  // empty: there is none
  Picture scene;
  Picture obstacle;
};

absl::StatusOr<Column> ColumnOf(const client::SceneView& view,
                                const std::map<std::string, std::string>& cameras) {
  if (!view.planes) {
    return absl::InternalError(absl::StrCat("the server sent no planes of view '", view.view, "'"));
  }
  const client::ScenePlanes& planes = *view.planes;
  Column column{.view = view.view, .camera = {}, .scene = {}, .obstacle = {}};
  // Masks are stretched to the shape of the camera image, so that places correspond.
  double shape = static_cast<double>(planes.scene.height()) / planes.scene.width();
  const auto file = cameras.find(view.view);
  if (file != cameras.end()) {
    ASSIGN_OR_RETURN(const auto camera, ReadCameraImage(file->second));
    shape = static_cast<double>(camera.rows) / camera.cols;
    column.camera = camera;
  }
  const int height = std::max(1, static_cast<int>(kColumnWidth * shape));
  if (!column.camera.empty()) column.camera = Stretched(column.camera, height, cv::INTER_AREA);
  column.scene = Stretched(PictureOf(planes.scene), height, cv::INTER_NEAREST);
  Picture obstacle = PictureOfPlanes(planes.obstacle, planes.unknown, planes.error);
  if (planes.ignored.size() == planes.unknown.size()) {
    obstacle = WithVeil(obstacle, planes.ignored & planes.unknown, palette::kIgnored, 1);
  }
  column.obstacle = Stretched(obstacle, height, cv::INTER_NEAREST);
  return column;
}

}  // namespace

void PrintScene(const client::Scene& scene, bool json) {
  if (json) {
    Print(SceneOutputJsonOf(scene));
  } else {
    std::cout << SceneOutputTextOf(scene) << std::flush;
  }
}

absl::StatusOr<Picture> PictureOfScene(const client::Scene& scene,
                                       const std::map<std::string, std::string>& cameras) {
  std::vector<CaptionedPicture> camera_row;
  std::vector<CaptionedPicture> scene_row;
  std::vector<CaptionedPicture> obstacle_row;
  for (const client::SceneView& view : scene.views) {
    ASSIGN_OR_RETURN(const Column column, ColumnOf(view, cameras));
    camera_row.push_back({column.camera, view.view + ": camera image"});
    scene_row.push_back({column.scene, view.view + ": scene image"});
    obstacle_row.push_back({column.obstacle, view.view + ": obstacle image"});
  }
  if (scene.views.empty()) return absl::InvalidArgumentError("the scene has no views to draw");
  std::vector<CaptionedPicture> pictures;
  if (!cameras.empty()) pictures = camera_row;
  pictures.insert(pictures.end(), scene_row.begin(), scene_row.end());
  pictures.insert(pictures.end(), obstacle_row.begin(), obstacle_row.end());
  SheetOptions options{.title = absl::StrCat("Scene ", scene.id),
                       .columns = static_cast<int>(scene.views.size()),
                       .legend = {{palette::kInk, "foreground"},
                                  {palette::kBackground, "background"},
                                  {palette::kObstacle, "obstacle"},
                                  {palette::kUnknown, "unknown (robot)"},
                                  {palette::kError, "error"}}};
  const bool ignores =
      std::any_of(scene.views.begin(), scene.views.end(),
                  [](const client::SceneView& view) { return view.ignored_pixels > 0; });
  if (ignores) options.legend.push_back({palette::kIgnored, "ignored (unknown)"});
  return ContactSheet(pictures, options);
}

}  // namespace silhouette
