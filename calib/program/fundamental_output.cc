#include "calib/program/fundamental_output.h"

#include <algorithm>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/calibration_camera_file.h"
#include "calib/calibration_matrix_file.h"
#include "calib/calibration_session_file.h"
#include "calib/program/fixed_tags.h"
#include "tools/picture/files.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

storage::v1::CellDescription CellOf(const FoundCalibration& found) {
  storage::v1::CellDescription cell;
  for (const PairedView& view : found.views) cell.add_views()->set_name(view.name);
  return cell;
}

storage::v1::Calibration MatricesOf(const FoundCalibration& found) {
  storage::v1::Calibration calibration;
  for (const PairResult& pair : found.pairs) {
    if (pair.unseen || pair.refusal) continue;
    storage::v1::FundamentalMatrix& matrix = *calibration.add_fundamental_matrices();
    matrix.set_view_a(pair.a);
    matrix.set_view_b(pair.b);
    for (int i = 0; i < 9; ++i) matrix.add_f(pair.f_of_masks(i / 3, i % 3));
  }
  return calibration;
}

storage::v1::CalibrationRecord RecordOf(const FoundCalibration& found) {
  storage::v1::CalibrationRecord record;
  record.set_time(absl::FormatTime(absl::RFC3339_sec, absl::Now(), absl::UTCTimeZone()));
  record.set_program(absl::StrCat("silhouette-calibrate fundamental, ",
                                  found.cameras.empty() ? "weak calibration" : "camera models"));
  for (const PairResult& pair : found.pairs) {
    const std::string name = absl::StrCat(found.views[static_cast<size_t>(pair.a)].name, " - ",
                                          found.views[static_cast<size_t>(pair.b)].name);
    const auto add = [&](const char* what, double value, const char* unit) {
      storage::v1::CalibrationFigure& figure = *record.add_figures();
      figure.set_name(what);
      figure.set_of(name);
      figure.set_value(value);
      figure.set_unit(unit);
    };
    const bool weak = pair.weak && pair.f.norm() > 0;
    if (weak) add("epipolar_rms_held_out", pair.weak->held_out.rms, "px");
    if (weak) add("margin", pair.margin, "mask px");
    if (pair.distances) add("epipolar_rms", pair.distances->rms, "px");
    if (pair.bow) add("bow", pair.bow->curve, "px");
    if (!pair.weak) continue;
    for (const std::string& warning : pair.weak->warnings) {
      record.add_warnings(absl::StrCat(name, ": ", warning));
    }
    // A refused pair has no lines, and should say so.
    if (pair.refusal) record.add_warnings(absl::StrCat(name, ": no matrix: ", *pair.refusal));
  }
  return record;
}

absl::Status AddFixedTags(const FoundCalibration& found, std::span<const TagSighting> fixed,
                          storage::v1::CalibrationRecord& record) {
  const auto means = MeanSightings(fixed);
  if (!means.ok()) return means.status();
  for (const auto& [key, mean] : *means) {
    const auto view = std::find_if(found.views.begin(), found.views.end(),
                                   [&](const PairedView& each) { return each.name == mean.view; });
    if (view == found.views.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the fixed tags are of a view '", mean.view, "' that is not there"));
    }
    storage::v1::FixedTag& tag = *record.add_fixed_tags();
    tag.set_view(static_cast<int>(view - found.views.begin()));
    tag.set_family(mean.family);
    tag.set_tag(mean.tag);
    tag.set_sigma(mean.sigma);
    for (const Eigen::Vector2d& corner : mean.corners) {
      tag.add_corners(corner.x());
      tag.add_corners(corner.y());
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WriteMatrices(const FoundCalibration& found, const std::string& file) {
  const storage::v1::Calibration calibration = MatricesOf(found);
  if (calibration.fundamental_matrices().empty()) {
    return absl::FailedPreconditionError("no pair of views has a matrix; nothing is written");
  }
  return WriteWholeFile(file, MatrixFileText(calibration, CellOf(found)));
}

absl::Status WriteSession(const FoundCalibration& found, std::span<const TagSighting> fixed,
                          const std::string& file) {
  CalibrationSession session{.calibration = MatricesOf(found), .camera_files = {}};
  const fs::path folder = fs::absolute(file).parent_path();
  for (const PairedView& view : found.views) {
    if (found.cameras.empty()) break;
    const fs::path camera = fs::absolute(found.cameras) / CameraFileName(view.name);
    session.camera_files.push_back(camera.lexically_normal().lexically_relative(folder).string());
  }
  if (session.camera_files.empty() && session.calibration.fundamental_matrices().empty()) {
    return absl::FailedPreconditionError("no pair of views has a matrix; nothing is written");
  }
  storage::v1::CalibrationRecord& record = *session.calibration.mutable_record();
  record = RecordOf(found);
  if (absl::Status added = AddFixedTags(found, fixed, record); !added.ok()) return added;
  return WriteWholeFile(file, SessionFileText(session, CellOf(found)));
}

}  // namespace silhouette
