// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/formats/pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "common/picture/files.h"
#include "common/picture/image_file.h"
#include "common/picture/palette.h"
#include "common/picture/sheet.h"
#include "db/mask/interpolation.h"
#include "db/status/status_macros.h"
#include "silhouette/messages.h"

namespace silhouette {
namespace {

constexpr int kColumnWidth = 320;   // pixels
constexpr int kPictureWidth = 256;  // pixels, on the sheet of an explanation

absl::StatusOr<Picture> ReadCameraImage(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadWholeFile(file));
  Picture picture = ImageOfBytes(bytes, cv::IMREAD_COLOR);
  if (picture.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("'", file, "' is not an image, or is cut off"));
  }
  return picture;
}

Picture Stretched(const Picture& picture, cv::Size size, int interpolation) {
  Picture stretched;
  cv::resize(picture, stretched, size, 0, 0, interpolation);
  return stretched;
}

// The rows of one view, top to bottom.
struct ViewColumn {
  std::string view;
  Picture camera;  // empty: there is none
  Picture scene;
  Picture obstacle;
};

absl::StatusOr<ViewColumn> ColumnOf(const v1::SceneView& view,
                                    const std::map<std::string, std::string>& cameras) {
  if (!view.has_obstacle()) {
    return absl::InternalError(
        absl::StrCat("the server sent no planes of view '", view.view(), "'"));
  }
  const Mask scene = client::FromMessage(view.scene());
  const Mask unknown = client::FromMessage(view.unknown());
  ViewColumn column{.view = view.view(), .camera = {}, .scene = {}, .obstacle = {}};
  // Masks are stretched to the shape of the camera image, so that places correspond.
  double shape = static_cast<double>(scene.height()) / scene.width();
  const auto file = cameras.find(view.view());
  if (file != cameras.end()) {
    ASSIGN_OR_RETURN(const auto camera, ReadCameraImage(file->second));
    shape = static_cast<double>(camera.rows) / camera.cols;
    column.camera = camera;
  }
  const cv::Size size(kColumnWidth, std::max(1, static_cast<int>(kColumnWidth * shape)));
  if (!column.camera.empty()) column.camera = Stretched(column.camera, size, cv::INTER_AREA);
  column.scene = Stretched(PictureOf(scene), size, cv::INTER_NEAREST);
  Picture obstacle = PictureOfPlanes(client::FromMessage(view.obstacle()), unknown,
                                     client::FromMessage(view.error()));
  if (view.has_ignored()) {
    const Mask ignored = client::FromMessage(view.ignored());
    if (ignored.size() == unknown.size()) {
      obstacle = WithVeil(obstacle, ignored & unknown, palette::kIgnored, 1);
    }
  }
  column.obstacle = Stretched(obstacle, size, cv::INTER_NEAREST);
  return column;
}

// One image of a view, and what it is called.
struct NamedPng {
  const char* name;
  const std::string& png;
};

std::vector<NamedPng> ExplainImagesOf(const client::ViewPictures& view) {
  return {{"scene", view.scene_png},
          {"obstacle", view.obstacle_png},
          {"intersection", view.intersection_png},
          {"collision", view.collision_png}};
}

// Around the pixels of a mask that is stretched to the whole of the picture.
void DrawOutline(Picture& picture, const std::optional<Mask>& mask) {
  if (!mask) return;
  cv::Mat stretched;
  cv::resize(MaskImage(*mask), stretched, picture.size(), 0, 0, cv::INTER_NEAREST);
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(stretched, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
  cv::drawContours(picture, outlines, -1, BgrOf(palette::kPaper), 3);
  cv::drawContours(picture, outlines, -1, BgrOf(palette::kRobot), 1);
}

// The row of a view on the sheet of an explanation.
absl::StatusOr<std::vector<CaptionedPicture>> RowOf(const client::ViewPictures& view,
                                                    const ExplanationNotes& notes) {
  const auto shape = notes.shapes.find(view.view);
  const double of_camera = shape == notes.shapes.end() ? 1 : shape->second;
  const cv::Size size(kPictureWidth, std::max(1, static_cast<int>(kPictureWidth * of_camera)));
  std::vector<CaptionedPicture> row;
  const auto add = [&](const Picture& picture, const std::string& name, int interpolation) {
    Picture shown = picture.empty() ? BlankPicture(size.width, size.height)
                                    : Stretched(picture, size, interpolation);
    DrawOutline(shown, view.robot);
    const std::string what = picture.empty() ? "no " + name : name;
    row.push_back({shown, absl::StrCat(view.view, ": ", what, " image")});
  };
  if (!notes.cameras.empty()) {
    Picture camera;
    if (const auto file = notes.cameras.find(view.view); file != notes.cameras.end()) {
      ASSIGN_OR_RETURN(camera, ReadCameraImage(file->second));
    }
    add(camera, "camera", cv::INTER_AREA);
  }
  for (const auto& [name, png] : ExplainImagesOf(view))
    add(ImageOfBytes(png, cv::IMREAD_COLOR), name, cv::INTER_NEAREST);
  return row;
}

constexpr double kTurn = 2 * std::numbers::pi;

double Degrees(double radians) { return radians * 180 / std::numbers::pi; }

bool InMetres(const ChartedJoints& charted, size_t joint) {
  return joint < charted.slides.size() && charted.slides[joint].value_or(false);
}

// A value of a joint as the chart shows it.
double Shown(const ChartedJoints& charted, size_t joint, double value) {
  return InMetres(charted, joint) ? value : Degrees(value);
}

ChartAxis AxisOf(const ChartedJoints& charted, size_t number) {
  const GridJoint& joint = charted.grid.joints()[number];
  const double last = joint.continuous ? joint.upper - joint.step() : joint.upper;
  return {.label = joint.name,
          .unit = InMetres(charted, number) ? "m" : "deg",
          .first = Shown(charted, number, joint.lower),
          .last = Shown(charted, number, last),
          .cells = joint.steps};
}

// Where the chart of a continuous joint begins: the rim of its first cell.
double RimOf(const GridJoint& joint) { return joint.lower - joint.step() / 2; }

// In which turn of the chart `value` lies.
double TurnOf(const GridJoint& joint, double value) {
  return joint.continuous ? std::floor((value - RimOf(joint)) / kTurn) : 0;
}

// The places on the way from `a` to `b`, as shares of it, where a continuous joint goes over the
// rim, in order.
std::vector<double> RimCrossings(const ConfigurationGrid& grid, const Configuration& a,
                                 const Configuration& b) {
  std::vector<double> crossings;
  for (size_t j = 0; j < a.size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    const double first = std::min(TurnOf(joint, a[j]), TurnOf(joint, b[j]));
    const double last = std::max(TurnOf(joint, a[j]), TurnOf(joint, b[j]));
    for (double turn = first + 1; turn <= last; ++turn) {
      crossings.push_back((RimOf(joint) + turn * kTurn - a[j]) / (b[j] - a[j]));
    }
  }
  std::sort(crossings.begin(), crossings.end());
  return crossings;
}

// `q` in the chart, as seen from `inside`, a place of the same piece of the path.
ChartPoint PointFrom(const ChartedJoints& charted, const Configuration& q,
                     const Configuration& inside) {
  std::array<double, 2> values{};
  for (size_t j = 0; j < values.size(); ++j) {
    values[j] = Shown(charted, j, q[j] - TurnOf(charted.grid.joints()[j], inside[j]) * kTurn);
  }
  return {values[0], values[1]};
}

// From kTight (share 0) to kFree (share 1).
Colour ShadeOf(double share) {
  const auto between = [&](uint8_t tight, uint8_t free) {
    return static_cast<uint8_t>(std::lround(tight + share * (free - tight)));
  };
  return {between(palette::kTight.red, palette::kFree.red),
          between(palette::kTight.green, palette::kFree.green),
          between(palette::kTight.blue, palette::kFree.blue)};
}

// Free cells that exceed no level come after unknown and occupied ones, then those that exceed the
// first, and so on.
constexpr uint8_t kUnknownClass = 0;
constexpr uint8_t kOccupiedClass = 1;
constexpr uint8_t kFirstFreeClass = 2;

std::vector<LegendEntry> ClearanceClasses(const client::ConfigurationSpace& space) {
  const std::vector<double>& levels = space.clearance_levels();
  // The shades are for those levels that are exceeded.
  const std::vector<uint64_t> above = space.CountAbove();
  const auto exceeded = std::ranges::count_if(above, [](uint64_t count) { return count > 0; });
  std::vector<LegendEntry> classes = {
      {palette::kUnknown, "unknown"},
      {palette::kOccupied, "occupied"},
      {palette::kTight, absl::StrCat("free, clearance up to ", levels.front(), " px")}};
  for (size_t i = 0; i < levels.size(); ++i) {
    classes.push_back(
        {ShadeOf(std::min(1.0, static_cast<double>(i + 1) / static_cast<double>(exceeded))),
         absl::StrCat("above ", levels[i], " px")});
  }
  return classes;
}

uint8_t ClearanceClassOf(const client::ClearanceBound& bound, const std::vector<double>& levels) {
  if (bound.state == client::State::kUnknown) return kUnknownClass;
  if (bound.state == client::State::kOccupied) return kOccupiedClass;
  if (!bound.exceeds) return kFirstFreeClass;
  const auto level = std::ranges::find(levels, *bound.exceeds);
  return static_cast<uint8_t>(kFirstFreeClass + 1 + (level - levels.begin()));
}

uint8_t ClassOf(client::State state) {
  if (state == client::State::kUnknown) return kUnknownCell;
  return state == client::State::kFree ? kFreeCell : kOccupiedCell;
}

}  // namespace

absl::StatusOr<Picture> PictureOfScene(const v1::Scene& scene,
                                       const std::map<std::string, std::string>& cameras) {
  std::vector<CaptionedPicture> camera_row;
  std::vector<CaptionedPicture> scene_row;
  std::vector<CaptionedPicture> obstacle_row;
  for (const v1::SceneView& view : scene.views()) {
    ASSIGN_OR_RETURN(const ViewColumn column, ColumnOf(view, cameras));
    camera_row.push_back({column.camera, view.view() + ": camera image"});
    scene_row.push_back({column.scene, view.view() + ": scene image"});
    obstacle_row.push_back({column.obstacle, view.view() + ": obstacle image"});
  }
  if (scene.views().empty()) return absl::InvalidArgumentError("the scene has no views to draw");
  std::vector<CaptionedPicture> pictures;
  if (!cameras.empty()) pictures = camera_row;
  pictures.insert(pictures.end(), scene_row.begin(), scene_row.end());
  pictures.insert(pictures.end(), obstacle_row.begin(), obstacle_row.end());
  SheetOptions options{.title = absl::StrCat("Scene ", scene.id()),
                       .columns = scene.views_size(),
                       .legend = {{palette::kInk, "foreground"},
                                  {palette::kBackground, "background"},
                                  {palette::kObstacle, "obstacle"},
                                  {palette::kUnknown, "unknown (robot)"},
                                  {palette::kError, "error"}}};
  const bool ignores =
      std::any_of(scene.views().begin(), scene.views().end(),
                  [](const v1::SceneView& view) { return view.ignored_pixels() > 0; });
  if (ignores) options.legend.push_back({palette::kIgnored, "ignored (unknown)"});
  return ContactSheet(pictures, options);
}

absl::Status WriteExplanation(const client::Explanation& explanation, const ExplanationNotes& notes,
                              const std::string& folder) {
  RETURN_IF_ERROR(MakeFolder(folder));
  std::vector<CaptionedPicture> sheet;
  for (const client::ViewPictures& view : explanation.views) {
    ASSIGN_OR_RETURN(const std::vector<CaptionedPicture> row, RowOf(view, notes));
    sheet.insert(sheet.end(), row.begin(), row.end());
    for (const auto& [name, png] : ExplainImagesOf(view)) {
      if (png.empty()) continue;
      const std::filesystem::path file =
          std::filesystem::path(folder) / absl::StrCat(view.view, "_", name, ".png");
      RETURN_IF_ERROR(WriteWholeFile(file.string(), png));
    }
  }
  SheetOptions options{.title = absl::StrCat("Verdict: ", NameOf(explanation.verdict.state)),
                       .lines = notes.lines,
                       .columns = notes.cameras.empty() ? 4 : 5,
                       .legend = {}};
  if (!sheet.empty()) {
    options.legend = {{palette::kRobot, "tested robot (outline)"},
                      {palette::kInk, "foreground"},
                      {palette::kBackground, "background"},
                      {palette::kObstacle, "obstacle"},
                      {palette::kUnknown, "unknown"},
                      {palette::kError, "error"},
                      {palette::kAllowed, "allowed region (unknown)"},
                      {palette::kIgnored, "ignored (unknown)"}};
  }
  return WritePng((std::filesystem::path(folder) / "explanation.png").string(),
                  ContactSheet(sheet, options));
}

absl::StatusOr<ConfigurationChart> ChartOf(const client::ConfigurationSpace& space,
                                           const std::vector<std::optional<bool>>& slides,
                                           const std::string& title) {
  const ConfigurationGrid& grid = space.grid();
  if (grid.dimensions() != 2) {
    return absl::InvalidArgumentError(
        absl::StrCat("a picture of the configuration space needs a grid of 2 joints, this one has ",
                     grid.dimensions(), "; leave --picture out"));
  }
  ConfigurationChart chart;
  chart.title = title;
  chart.x = AxisOf({grid, slides}, 0);
  chart.y = AxisOf({grid, slides}, 1);
  const std::vector<double>& levels = space.clearance_levels();
  chart.classes = levels.empty() ? ConfigurationClasses() : ClearanceClasses(space);
  for (int y = 0; y < chart.y.cells; ++y) {
    for (int x = 0; x < chart.x.cells; ++x) {
      const ConfigurationNumber number = grid.NumberOf({x, y});
      chart.cells.push_back(levels.empty() ? ClassOf(space.StateAt(number))
                                           : ClearanceClassOf(space.ClearanceAt(number), levels));
    }
  }
  return chart;
}

ChartPoint ChartPointOf(const ChartedJoints& charted, const Configuration& configuration) {
  return PointFrom(charted, configuration, configuration);
}

std::vector<std::vector<ChartPoint>> ChartLines(const ChartedJoints& charted,
                                                const std::vector<Configuration>& waypoints) {
  std::vector<std::vector<ChartPoint>> lines(1);
  for (size_t i = 0; i + 1 < waypoints.size(); ++i) {
    const Configuration& a = waypoints[i];
    const Configuration& b = waypoints[i + 1];
    std::vector<double> shares = RimCrossings(charted.grid, a, b);
    shares.insert(shares.begin(), 0);
    shares.push_back(1);
    for (size_t k = 0; k + 1 < shares.size(); ++k) {
      if (k > 0) lines.emplace_back();
      const Configuration middle = Interpolated(a, b, (shares[k] + shares[k + 1]) / 2);
      lines.back().push_back(PointFrom(charted, Interpolated(a, b, shares[k]), middle));
      lines.back().push_back(PointFrom(charted, Interpolated(a, b, shares[k + 1]), middle));
    }
  }
  return lines;
}

}  // namespace silhouette
