#include "calib/report/report_json.h"

#include "calib/report/report_judgement.h"

namespace silhouette {
namespace {

using Json = nlohmann::ordered_json;

const char* ReportJsonNameOf(HeldOutBy by) {
  switch (by) {
    case HeldOutBy::kFrames:
      return "frames";
    case HeldOutBy::kBoards:
      return "boards";
    case HeldOutBy::kNothing:
      break;
  }
  return "nothing";
}

Json JsonOf(const HeldOutError& error) {
  if (error.corners == 0) return nullptr;
  return {{"corners", error.corners}, {"px", error.px}, {"expected_px", error.expected_px}};
}

Json JsonOf(const PredictedError& predicted) {
  if (predicted.points == 0) return nullptr;
  return {{"points", predicted.points},
          {"px", predicted.px},
          {"worst_px", predicted.worst_px},
          {"mm", predicted.mm}};
}

// Null in fields of which nothing is known.
Json JsonOf(const ImageMap& map, bool solved) {
  Json json = {{"columns", map.columns}, {"rows", map.rows}};
  for (const char* key : {"corners", "mean_x_px", "mean_y_px", "fit_px", "predicted_px"}) {
    json[key] = Json::array();
  }
  for (const MapCell& cell : map.cells) {
    const bool seen = solved && cell.corners > 0;
    json["corners"].push_back(cell.corners);
    json["mean_x_px"].push_back(seen ? Json(cell.mean.x()) : Json());
    json["mean_y_px"].push_back(seen ? Json(cell.mean.y()) : Json());
    json["fit_px"].push_back(seen ? Json(cell.fit_px) : Json());
    json["predicted_px"].push_back(cell.points > 0 ? Json(cell.predicted_px) : Json());
  }
  return json;
}

Json JsonOf(const ReportView& view, bool solved) {
  Json json = {{"name", view.name},
               {"world", view.on_flange ? "flange" : "base"},
               {"grade", solved ? NameOf(GradeOf(view)) : "unknown"},
               {"image_size", {view.width, view.height}},
               {"frames", view.frames},
               {"corners", view.corners},
               {"outliers", view.outliers},
               {"span", {view.span_x, view.span_y}},
               {"coverage", view.coverage},
               {"workspace_reached", view.predicted.points > 0 ? Json(view.reached) : Json()},
               {"tilt_deg", view.tilt_deg ? Json(*view.tilt_deg) : Json()},
               {"fit_px", solved ? Json(view.fit_px) : Json()},
               {"held_out", JsonOf(view.held_out)},
               {"predicted", JsonOf(view.predicted)}};
  json["repeatability"] = nullptr;
  if (view.repeatability) {
    json["repeatability"] = {{"px", view.repeatability->px},
                             {"mm", view.repeatability->mm},
                             {"deg", view.repeatability->deg}};
  }
  json["halves"] = nullptr;
  if (view.halves) {
    json["halves"] = {{"px", view.halves->px}, {"expected_px", view.halves->expected_px}};
  }
  json["map"] = JsonOf(view.map, solved);
  return json;
}

Json JsonOf(const ReportPair& pair) {
  const bool known = pair.corners > 0;
  return {{"view_a", pair.view_a},
          {"view_b", pair.view_b},
          {"seen_at_once", pair.seen},
          {"corners", pair.corners},
          {"epipolar_px", known ? Json(pair.px) : Json()},
          {"median_px", known ? Json(pair.median_px) : Json()},
          {"worst_px", known ? Json(pair.worst_px) : Json()}};
}

Json JsonOf(const ReportImage& image, bool solved) {
  return {{"frame", image.frame},
          {"view", image.view},
          {"corners", image.corners},
          {"outliers", image.outliers},
          {"fit_px", solved ? Json(image.fit_px) : Json()},
          {"held_out", JsonOf(image.held_out)}};
}

Json JsonOf(const ReportFrame& frame) {
  Json json = {{"name", frame.name}, {"robot", nullptr}};
  if (frame.robot) {
    json["robot"] = {
        {"mm", frame.robot_mm}, {"deg", frame.robot_deg}, {"outlier", frame.robot_outlier}};
  }
  return json;
}

Json FactorOf(double factor) { return factor > 0 ? Json(factor) : Json(); }

}  // namespace

Json ReportJson(const QualityReport& report) {
  const bool solved = report.refusal.empty();
  Json json = {{"refusal", solved ? Json() : Json(report.refusal)},
               {"grade", NameOf(GradeOf(report))},
               {"warnings", report.warnings},
               {"chi2_per_dof", solved ? Json(report.chi2_per_dof) : Json()},
               {"dof", report.dof},
               {"image_noise_factor", FactorOf(report.image_noise_factor)},
               {"robot_noise_factor", FactorOf(report.robot_noise_factor)},
               {"survey_noise_factor", FactorOf(report.survey_noise_factor)},
               {"held_out_by", ReportJsonNameOf(report.held_out_by)},
               {"groups", report.groups},
               {"workspace", report.workspace}};
  for (const char* key : {"views", "pairs", "images", "frames"}) json[key] = Json::array();
  for (const ReportView& view : report.views) json["views"].push_back(JsonOf(view, solved));
  for (const ReportPair& pair : report.pairs) json["pairs"].push_back(JsonOf(pair));
  for (const ReportImage& image : report.images) json["images"].push_back(JsonOf(image, solved));
  for (const ReportFrame& frame : report.frames) json["frames"].push_back(JsonOf(frame));
  return json;
}

}  // namespace silhouette
