// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-db/calibration_report.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "common/result/result.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

using Json = nlohmann::ordered_json;

// Where the views' optical axes come nearest to each other, a point that all
// cameras look at. Nothing if they do not, or it is behind a camera.
std::optional<Eigen::Vector3d> PointLookedAt(const std::vector<CameraModel>& cameras) {
  Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const CameraModel& camera : cameras) {
    const Eigen::Vector3d ahead = camera.camera_from_world().linear().row(2).transpose();
    const Eigen::Matrix3d without = Eigen::Matrix3d::Identity() - ahead * ahead.transpose();
    across += without;
    sum += without * camera.Centre();
  }
  if (!(std::abs(across.determinant()) > 1e-6)) return std::nullopt;  // all axes are parallel
  const Eigen::Vector3d point = across.ldlt().solve(sum);
  for (const CameraModel& camera : cameras) {
    if (!((camera.camera_from_world() * point).z() > 0)) return std::nullopt;
  }
  return point;
}

// Metres that a mask pixel spans at `point`, across the view, in the direction in which it spans
// more; distortion is left out. `camera` has the mask's size.
double MetresPerPixel(const CameraModel& camera, const Eigen::Vector3d& point) {
  const CameraIntrinsics& in = camera.intrinsics();
  return (camera.camera_from_world() * point).z() / std::min(in.fx, in.fy);
}

bool Distorted(const CameraModel& camera) {
  const auto& distortion = camera.intrinsics().distortion;
  return std::any_of(distortion.begin(), distortion.end(), [](double k) { return k != 0; });
}

// The cameras of the report with the masks' sizes.
std::vector<CameraModel> MaskCameras(const CalibrationReport& report) {
  std::vector<CameraModel> cameras;
  for (size_t i = 0; i < report.calibration.cameras.size(); ++i) {
    const MaskSize size = report.database.mask_sizes()[i];
    cameras.push_back(report.calibration.cameras[i].ScaledTo(size.width, size.height));
  }
  return cameras;
}

// What is known of a pair of views, the one of the lower number first.
struct PairFacts {
  int a = 0;
  int b = 0;
  std::optional<Eigen::Matrix3d> f = std::nullopt;
  bool distorted = false;
  std::optional<double> baseline = std::nullopt;
};

std::vector<PairFacts> PairsOf(const CalibrationReport& report) {
  const std::vector<CameraModel> cameras = MaskCameras(report);
  std::vector<PairFacts> pairs;
  const int views = static_cast<int>(report.database.mask_sizes().size());
  for (int a = 0; a < views; ++a) {
    for (int b = a + 1; b < views; ++b) {
      PairFacts pair{.a = a, .b = b};
      if (!cameras.empty()) {
        const CameraModel& first = cameras[static_cast<size_t>(a)];
        const CameraModel& second = cameras[static_cast<size_t>(b)];
        pair.f = FundamentalBetween(first, second);
        pair.distorted = Distorted(first) || Distorted(second);
        pair.baseline = (first.Centre() - second.Centre()).norm();
      }
      for (const FundamentalMatrix& matrix : report.calibration.fundamental_matrices) {
        if (matrix.view_a == a && matrix.view_b == b) pair.f = matrix.f;
        if (matrix.view_a == b && matrix.view_b == a) pair.f = matrix.f.transpose();
      }
      pairs.push_back(pair);
    }
  }
  return pairs;
}

std::string PointText(const Eigen::Vector3d& p) {
  return absl::StrFormat("(%.3f, %.3f, %.3f)", p.x(), p.y(), p.z());
}

std::string DistortionText(const CameraModel& camera) {
  if (!Distorted(camera)) return "none";
  return absl::StrJoin(camera.intrinsics().distortion, " ",
                       [](std::string* out, double k) { absl::StrAppendFormat(out, "%.5g", k); });
}

Json VectorJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json MatrixJson(const Eigen::Matrix3d& m) {
  return {VectorJson(m.row(0)), VectorJson(m.row(1)), VectorJson(m.row(2))};
}

// Where a calibration comes from and how good it was found to be; nothing if nothing is known.
void AppendRecord(const CalibrationReport& report, std::string& text, Json& json) {
  const storage::v1::CalibrationRecord& record = report.record;
  if (record.ByteSizeLong() == 0) return;
  Json out = {{"time", record.time()},
              {"program", record.program()},
              {"figures", Json::array()},
              {"warnings", Json(record.warnings())},
              {"fixed_tags", Json::array()}};
  if (!record.time().empty() || !record.program().empty()) {
    absl::StrAppendFormat(&text, "made         %s%s%s\n", record.time(),
                          record.program().empty() ? "" : " by ", record.program());
  }
  for (const storage::v1::CalibrationFigure& figure : record.figures()) {
    absl::StrAppendFormat(&text, "figure       %s%s%s: %.4g %s\n", figure.name(),
                          figure.of().empty() ? "" : ", ", figure.of(), figure.value(),
                          figure.unit());
    out["figures"].push_back({{"name", figure.name()},
                              {"of", figure.of()},
                              {"value", figure.value()},
                              {"unit", figure.unit()}});
  }
  for (const std::string& warning : record.warnings()) {
    absl::StrAppend(&text, "warning      ", warning, "\n");
  }
  if (!record.fixed_tags().empty()) {
    absl::StrAppendFormat(&text, "fixed tags   %d sightings, by which a move is noticed\n",
                          record.fixed_tags_size());
  }
  for (const storage::v1::FixedTag& tag : record.fixed_tags()) {
    out["fixed_tags"].push_back({{"view", report.database.cell().views(tag.view()).name()},
                                 {"family", tag.family()},
                                 {"tag", tag.tag()}});
  }
  json["record"] = out;
}

void AppendCamera(const CameraModel& camera, const CameraModel& mask_camera,
                  const std::optional<Eigen::Vector3d>& point, std::string& text, Json& view) {
  const CameraIntrinsics& in = camera.intrinsics();
  const CameraIntrinsics& mask = mask_camera.intrinsics();
  const Eigen::Vector3d ahead = camera.camera_from_world().linear().row(2).transpose();
  const Eigen::Vector3d at = point.value_or(camera.Centre() + ahead);
  const double metres = MetresPerPixel(mask_camera, at);
  const double distance = (at - camera.Centre()).norm();
  absl::StrAppendFormat(&text,
                        "\nview %s\n  image        %dx%d, fx %.6g, fy %.6g, cx %.6g, cy %.6g\n"
                        "  distortion   %s\n  position     %s m, looking along %s\n"
                        "  mask         %dx%d, %.1f mm per pixel at %.2f m%s\n",
                        view["name"].get<std::string>(), in.width, in.height, in.fx, in.fy, in.cx,
                        in.cy, DistortionText(camera), PointText(camera.Centre()), PointText(ahead),
                        mask.width, mask.height, 1000 * metres, distance,
                        point ? ", where the views meet" : "");
  view["camera"] = {{"image_size", {in.width, in.height}},
                    {"fx", in.fx},
                    {"fy", in.fy},
                    {"cx", in.cx},
                    {"cy", in.cy},
                    {"distortion", in.distortion},
                    {"position", VectorJson(camera.Centre())},
                    {"looking_along", VectorJson(ahead)}};
  view["metres_per_mask_pixel"] = metres;
  view["at_distance"] = distance;
}

void AppendViews(const CalibrationReport& report, std::string& text, Json& json) {
  const std::vector<CameraModel> cameras = MaskCameras(report);
  const std::optional<Eigen::Vector3d> point = PointLookedAt(cameras);
  json["views"] = Json::array();
  for (size_t i = 0; i < report.database.mask_sizes().size(); ++i) {
    const MaskSize size = report.database.mask_sizes()[i];
    Json& view = json["views"].emplace_back();
    view = {{"name", report.database.cell().views(static_cast<int>(i)).name()},
            {"mask_size", {size.width, size.height}}};
    if (cameras.empty()) continue;
    AppendCamera(report.calibration.cameras[i], cameras[i], point, text, view);
  }
  if (point && !cameras.empty()) {
    absl::StrAppend(&text, "\nthe views meet near ", PointText(*point), "\n");
  }
}

// What the robot images say of the pixels of `view` in `other`, under `key` of the pair; nothing if
// it was not looked for.
void AppendContradictions(const CalibrationReport& report, int view, int other, const char* key,
                          std::string& text, Json& json) {
  const auto& pairs = report.contradictions.pairs;
  const auto found = std::ranges::find_if(pairs, [&](const PairContradictions& each) {
    return each.view == view && each.other == other;
  });
  if (found == pairs.end()) return;
  json[key] = {{"configurations", found->configurations},
               {"pixels", found->pixels},
               {"contradicting", found->contradicting},
               {"share", found->pixels > 0 ? Json(found->share()) : Json(nullptr)}};
  if (found->worst) {
    json[key]["worst"] = {{"configuration", *found->worst},
                          {"joints", JointJson(report.database.grid(), *found->worst)},
                          {"contradicting", found->worst_contradicting}};
  }
  if (report.contradictions.configurations == 0) return;
  const std::string& name = report.database.cell().views(view).name();
  const std::string& other_name = report.database.cell().views(other).name();
  absl::StrAppend(&text, "  ", name, " in ", other_name, ": ",
                  found->pixels == 0 ? absl::StrCat("the robot reaches the rim of ", other_name)
                                     : absl::StrFormat("%.4g %% of %d robot pixels contradict",
                                                       100 * found->share(), found->pixels),
                  "\n");
}

void AppendPair(const CalibrationReport& report, const PairFacts& pair, std::string& text,
                Json& json) {
  const storage::v1::CellDescription& cell = report.database.cell();
  const std::string& a = cell.views(pair.a).name();
  const std::string& b = cell.views(pair.b).name();
  json = {{"view_a", a}, {"view_b", b}, {"lines", pair.f.has_value()}};
  absl::StrAppend(&text, "\nviews ", a, " and ", b, pair.f ? "" : ": no lines", "\n");
  if (pair.baseline) {
    absl::StrAppendFormat(&text, "  baseline     %.3f m\n", *pair.baseline);
    json["baseline"] = *pair.baseline;
  }
  if (!pair.f) return;
  json["F"] = MatrixJson(*pair.f);
  json["F_without_distortion"] = pair.distorted;
  const char* head = pair.distorted ? "  F, undist.   " : "  F            ";
  for (int row = 0; row < 3; ++row) {
    absl::StrAppendFormat(&text, "%s%12.5g %12.5g %12.5g\n", row == 0 ? head : "               ",
                          (*pair.f)(row, 0), (*pair.f)(row, 1), (*pair.f)(row, 2));
  }
  AppendContradictions(report, pair.a, pair.b, "a_in_b", text, json);
  AppendContradictions(report, pair.b, pair.a, "b_in_a", text, json);
}

}  // namespace

void Print(const CalibrationReport& report, const std::string& format) {
  const char* kind = report.calibration.cameras.empty() ? "fundamental matrices" : "cameras";
  const PairContradictions* worst = report.contradictions.worst();
  std::string text = absl::StrFormat("database     %s, generation %d\ncalibration  %s\n",
                                     report.database.path(), report.generation, kind);
  Json json = {{"database", report.database.path()},
               {"generation", report.generation},
               {"kind", kind},
               {"margin", report.margin},
               {"configurations", report.contradictions.configurations},
               {"worst_contradicting_share", worst ? Json(worst->share()) : Json(nullptr)}};
  AppendRecord(report, text, json);
  AppendViews(report, text, json);
  json["pairs"] = Json::array();
  for (const PairFacts& pair : PairsOf(report)) {
    AppendPair(report, pair, text, json["pairs"].emplace_back());
  }
  absl::StrAppend(&text, "\nat worst ",
                  ContradictionText(report.contradictions, report.database.cell()),
                  absl::StrFormat("; pixels widened by %.4g\n", report.margin));
  PrintResult(format, json, text);
}

}  // namespace silhouette
