// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-db/calibration_report.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;

Eigen::Matrix3d CameraMatrix(const CameraModel& camera) {
  const CameraIntrinsics& in = camera.intrinsics();
  Eigen::Matrix3d k;
  k << in.fx, 0, in.cx, 0, in.fy, in.cy, 0, 0, 1;
  return k;
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
        pair.f = FundamentalMatrixOf(first, second);
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

const PairContradictions* Find(const Contradictions& found, int view, int other) {
  for (const PairContradictions& pair : found.pairs) {
    if (pair.view == view && pair.other == other) return &pair;
  }
  return nullptr;
}

std::string PointText(const Eigen::Vector3d& p) {
  return absl::StrFormat("(%.3f, %.3f, %.3f)", p.x(), p.y(), p.z());
}

std::string DistortionText(const CameraModel& camera) {
  if (!Distorted(camera)) return "none";
  return absl::StrJoin(camera.intrinsics().distortion, " ",
                       [](std::string* out, double k) { absl::StrAppendFormat(out, "%.5g", k); });
}

// Where a calibration comes from and how good it was found to be; nothing if nothing is known.
void AppendRecord(const storage::v1::CalibrationRecord& record, std::string& text) {
  if (!record.time().empty() || !record.program().empty()) {
    absl::StrAppendFormat(&text, "made         %s%s%s\n", record.time(),
                          record.program().empty() ? "" : " by ", record.program());
  }
  for (const storage::v1::CalibrationFigure& figure : record.figures()) {
    absl::StrAppendFormat(&text, "figure       %s%s%s: %.4g %s\n", figure.name(),
                          figure.of().empty() ? "" : ", ", figure.of(), figure.value(),
                          figure.unit());
  }
  for (const std::string& warning : record.warnings()) {
    absl::StrAppend(&text, "warning      ", warning, "\n");
  }
  if (!record.fixed_tags().empty()) {
    absl::StrAppendFormat(&text, "fixed tags   %d sightings, by which a move is noticed\n",
                          record.fixed_tags_size());
  }
}

void AppendViews(const CalibrationReport& report, std::string& text) {
  const std::vector<CameraModel> cameras = MaskCameras(report);
  const std::optional<Eigen::Vector3d> point = PointLookedAt(cameras);
  for (size_t i = 0; i < cameras.size(); ++i) {
    const CameraModel& camera = report.calibration.cameras[i];
    const CameraIntrinsics& in = camera.intrinsics();
    const Eigen::Vector3d ahead = camera.camera_from_world().linear().row(2).transpose();
    absl::StrAppendFormat(&text,
                          "\nview %s\n  image        %dx%d, fx %.6g, fy %.6g, cx %.6g, cy %.6g\n"
                          "  distortion   %s\n  position     %s m, looking along %s\n",
                          report.database.cell().views(static_cast<int>(i)).name(), in.width,
                          in.height, in.fx, in.fy, in.cx, in.cy, DistortionText(camera),
                          PointText(camera.Centre()), PointText(ahead));
    const Eigen::Vector3d at = point.value_or(camera.Centre() + ahead);
    absl::StrAppendFormat(&text, "  mask         %dx%d, %.1f mm per pixel at %.2f m%s\n",
                          cameras[i].intrinsics().width, cameras[i].intrinsics().height,
                          1000 * MetresPerPixel(cameras[i], at), (at - camera.Centre()).norm(),
                          point ? ", where the views meet" : "");
  }
  if (point) absl::StrAppend(&text, "\nthe views meet near ", PointText(*point), "\n");
}

void AppendPair(const CalibrationReport& report, const PairFacts& pair, std::string& text) {
  const storage::v1::CellDescription& cell = report.database.cell();
  absl::StrAppend(&text, "\nviews ", cell.views(pair.a).name(), " and ", cell.views(pair.b).name(),
                  (pair.f ? "" : ": no lines"), "\n");
  if (pair.baseline) absl::StrAppendFormat(&text, "  baseline     %.3f m\n", *pair.baseline);
  if (!pair.f) return;
  const char* head = pair.distorted ? "  F, undist.   " : "  F            ";
  for (int row = 0; row < 3; ++row) {
    absl::StrAppendFormat(&text, "%s%12.5g %12.5g %12.5g\n", row == 0 ? head : "               ",
                          (*pair.f)(row, 0), (*pair.f)(row, 1), (*pair.f)(row, 2));
  }
  for (const auto& [view, other] : {std::pair(pair.a, pair.b), std::pair(pair.b, pair.a)}) {
    const PairContradictions* said = Find(report.contradictions, view, other);
    if (said == nullptr || report.contradictions.configurations == 0) continue;
    const std::string name = cell.views(view).name();
    const std::string other_name = cell.views(other).name();
    if (said->pixels == 0) {
      absl::StrAppendFormat(&text, "  %s in %s: the robot reaches the rim of %s\n", name,
                            other_name, other_name);
      continue;
    }
    absl::StrAppendFormat(&text, "  %s in %s: %.4g %% of %d robot pixels contradict\n", name,
                          other_name, 100 * said->share(), said->pixels);
  }
}

Json VectorJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json MatrixJson(const Eigen::Matrix3d& m) {
  return {{m(0, 0), m(0, 1), m(0, 2)}, {m(1, 0), m(1, 1), m(1, 2)}, {m(2, 0), m(2, 1), m(2, 2)}};
}

Json ViewsJson(const CalibrationReport& report) {
  const std::vector<CameraModel> cameras = MaskCameras(report);
  const std::optional<Eigen::Vector3d> point = PointLookedAt(cameras);
  Json views = Json::array();
  for (int i = 0; i < report.database.cell().views_size(); ++i) {
    const MaskSize size = report.database.mask_sizes()[static_cast<size_t>(i)];
    Json view = {{"name", report.database.cell().views(i).name()},
                 {"mask_size", {size.width, size.height}}};
    if (!cameras.empty()) {
      const CameraModel& camera = report.calibration.cameras[static_cast<size_t>(i)];
      const CameraIntrinsics& in = camera.intrinsics();
      const Eigen::Vector3d ahead = camera.camera_from_world().linear().row(2).transpose();
      const Eigen::Vector3d at = point.value_or(camera.Centre() + ahead);
      view["camera"] = {{"image_size", {in.width, in.height}},
                        {"fx", in.fx},
                        {"fy", in.fy},
                        {"cx", in.cx},
                        {"cy", in.cy},
                        {"distortion", in.distortion},
                        {"position", VectorJson(camera.Centre())},
                        {"looking_along", VectorJson(ahead)}};
      view["metres_per_mask_pixel"] = MetresPerPixel(cameras[static_cast<size_t>(i)], at);
      view["at_distance"] = (at - camera.Centre()).norm();
    }
    views.push_back(view);
  }
  return views;
}

Json ContradictionJson(const CalibrationReport& report, const PairContradictions& pair) {
  Json said = {{"configurations", pair.configurations},
               {"pixels", pair.pixels},
               {"contradicting", pair.contradicting},
               {"share", pair.pixels > 0 ? Json(pair.share()) : Json(nullptr)}};
  if (pair.worst) {
    said["worst"] = {{"configuration", *pair.worst},
                     {"joints", JointJson(report.database.grid(), *pair.worst)},
                     {"contradicting", pair.worst_contradicting}};
  }
  return said;
}

Json RecordJson(const storage::v1::CalibrationRecord& record,
                const storage::v1::CellDescription& cell) {
  Json out = {{"time", record.time()},
              {"program", record.program()},
              {"figures", Json::array()},
              {"warnings", Json::array()},
              {"fixed_tags", Json::array()}};
  for (const storage::v1::CalibrationFigure& figure : record.figures()) {
    out["figures"].push_back({{"name", figure.name()},
                              {"of", figure.of()},
                              {"value", figure.value()},
                              {"unit", figure.unit()}});
  }
  for (const std::string& warning : record.warnings()) out["warnings"].push_back(warning);
  for (const storage::v1::FixedTag& tag : record.fixed_tags()) {
    out["fixed_tags"].push_back(
        {{"view", cell.views(tag.view()).name()}, {"family", tag.family()}, {"tag", tag.tag()}});
  }
  return out;
}

}  // namespace

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

double MetresPerPixel(const CameraModel& camera, const Eigen::Vector3d& point) {
  const CameraIntrinsics& in = camera.intrinsics();
  return (camera.camera_from_world() * point).z() / std::min(in.fx, in.fy);
}

Eigen::Matrix3d FundamentalMatrixOf(const CameraModel& a, const CameraModel& b) {
  const Eigen::Isometry3d b_from_a = b.camera_from_world() * a.camera_from_world().inverse();
  const Eigen::Vector3d t = b_from_a.translation();
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  const Eigen::Matrix3d f =
      CameraMatrix(b).inverse().transpose() * cross * b_from_a.linear() * CameraMatrix(a).inverse();
  return f / f.norm();
}

std::string TextOf(const CalibrationReport& report) {
  std::string text;
  absl::StrAppendFormat(&text, "database     %s, generation %d\ncalibration  %s\n",
                        report.database.path(), report.generation,
                        report.calibration.cameras.empty() ? "fundamental matrices" : "cameras");
  AppendRecord(report.record, text);
  AppendViews(report, text);
  for (const PairFacts& pair : PairsOf(report)) AppendPair(report, pair, text);
  absl::StrAppend(&text, "\nat worst ",
                  ContradictionText(report.contradictions, report.database.cell()),
                  absl::StrFormat("; pixels widened by %.4g\n", report.margin));
  return text;
}

nlohmann::json JsonOf(const CalibrationReport& report) {
  const storage::v1::CellDescription& cell = report.database.cell();
  Json out = {{"database", report.database.path()},
              {"generation", report.generation},
              {"kind", report.calibration.cameras.empty() ? "fundamental matrices" : "cameras"},
              {"margin", report.margin},
              {"configurations", report.contradictions.configurations},
              {"views", ViewsJson(report)},
              {"pairs", Json::array()}};
  if (report.record.ByteSizeLong() > 0) out["record"] = RecordJson(report.record, cell);
  const PairContradictions* worst = report.contradictions.worst();
  out["worst_contradicting_share"] = worst != nullptr ? Json(worst->share()) : Json(nullptr);
  for (const PairFacts& facts : PairsOf(report)) {
    Json pair = {{"view_a", cell.views(facts.a).name()},
                 {"view_b", cell.views(facts.b).name()},
                 {"lines", facts.f.has_value()}};
    if (facts.f) pair["F"] = MatrixJson(*facts.f);
    if (facts.f) pair["F_without_distortion"] = facts.distorted;
    if (facts.baseline) pair["baseline"] = *facts.baseline;
    if (const auto* said = Find(report.contradictions, facts.a, facts.b)) {
      pair["a_in_b"] = ContradictionJson(report, *said);
    }
    if (const auto* said = Find(report.contradictions, facts.b, facts.a)) {
      pair["b_in_a"] = ContradictionJson(report, *said);
    }
    out["pairs"].push_back(pair);
  }
  return out;
}

}  // namespace silhouette
