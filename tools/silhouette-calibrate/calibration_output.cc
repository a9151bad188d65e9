// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/calibration_output.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/files/calibration_session_file.h"
#include "calib/files/camera_file.h"
#include "calib/fundamental/tag_drift.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

storage::v1::CellDescription CellOf(const FoundCalibration& found) {
  storage::v1::CellDescription cell;
  for (const PairedView& view : found.views) cell.add_views()->set_name(view.name);
  return cell;
}

// `refused`: also those that are true of undistorted pixels only.
storage::v1::Calibration MatricesOf(const FoundCalibration& found, bool refused) {
  storage::v1::Calibration calibration;
  for (const PairResult& pair : found.pairs) {
    const bool sized = found.views[static_cast<size_t>(pair.a)].sizes.mask.width > 0 &&
                       found.views[static_cast<size_t>(pair.b)].sizes.mask.width > 0;
    if (!sized || pair.unseen || (pair.refusal && !refused)) continue;
    storage::v1::FundamentalMatrix& matrix = *calibration.add_fundamental_matrices();
    matrix.set_view_a(pair.a);
    matrix.set_view_b(pair.b);
    for (int i = 0; i < 9; ++i) matrix.add_f(pair.f_of_masks(i / 3, i % 3));
  }
  return calibration;
}

void AddWarning(const std::string& text, storage::v1::CalibrationRecord& record) {
  const auto& warnings = record.warnings();
  if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) {
    record.add_warnings(text);
  }
}

void AddPairs(const FoundCalibration& found, storage::v1::CalibrationRecord& record) {
  for (const PairResult& pair : found.pairs) {
    const std::string name = absl::StrCat(found.views[static_cast<size_t>(pair.a)].name, " - ",
                                          found.views[static_cast<size_t>(pair.b)].name);
    const auto set = [&](const char* what, double value, const char* unit) {
      SetFigure(what, name, value, unit, record);
    };
    const bool weak = pair.weak && pair.f.norm() > 0;
    if (weak) set("epipolar_rms_held_out", pair.weak->held_out.rms, "px");
    if (weak) set("epipolar_rms_of_noise", pair.weak->held_out.noise, "px");
    if (weak) set("margin", pair.margin, "mask px");
    if (pair.distances) set("epipolar_rms", pair.distances->rms, "px");
    if (pair.bow) set("bow", pair.bow->curve, "px");
    if (!pair.weak) continue;
    for (const std::string& warning : pair.weak->warnings) {
      AddWarning(absl::StrCat(name, ": ", warning), record);
    }
    // A refused pair has no lines, and should say so.
    if (pair.refusal) AddWarning(absl::StrCat(name, ": no matrix: ", *pair.refusal), record);
  }
}

// Relative to the folder of `file`; empty: weak calibration.
std::vector<std::string> CameraFilesOf(const FoundCalibration& found, const std::string& file) {
  std::vector<std::string> files;
  if (found.cameras.empty()) return files;
  const fs::path folder = fs::absolute(file).lexically_normal().parent_path();
  for (const PairedView& view : found.views) {
    const fs::path camera = fs::absolute(found.cameras) / CameraFileName(view.name);
    files.push_back(camera.lexically_normal().lexically_relative(folder).string());
  }
  return files;
}

}  // namespace

void SetFigure(const std::string& what, const std::string& of, double value, const char* unit,
               storage::v1::CalibrationRecord& record) {
  auto& figures = *record.mutable_figures();
  auto figure = std::find_if(figures.begin(), figures.end(), [&](const auto& each) {
    return each.name() == what && each.of() == of;
  });
  storage::v1::CalibrationFigure& set = figure == figures.end() ? *figures.Add() : *figure;
  set.set_name(what);
  set.set_of(of);
  set.set_value(value);
  set.set_unit(unit);
}

absl::Status SetFixedTags(const FoundCalibration& found, std::span<const TagSighting> fixed,
                          storage::v1::CalibrationRecord& record) {
  for (const TagSighting& seen : fixed) {
    if (std::ranges::find(found.views, seen.view, &PairedView::name) == found.views.end()) {
      return InvalidArgument("the fixed tags are of a view '", seen.view, "' that is not there");
    }
  }
  record.clear_fixed_tags();
  for (size_t i = 0; i < found.views.size(); ++i) {
    const PairedView& view = found.views[i];
    RETURN_IF_ERROR(CheckImageSize(fixed, view.name, view.sizes.image, "the stated image size"));
    ASSIGN_OR_RETURN(const auto means, MeanSightings(view.name, view.sizes, fixed));
    for (const auto& [key, mean] : means) {
      storage::v1::FixedTag& tag = *record.add_fixed_tags();
      tag.set_view(static_cast<int>(i));
      tag.set_family(mean.family);
      tag.set_tag(mean.tag);
      tag.set_sigma(mean.sigma);
      for (const Eigen::Vector2d& corner : mean.corners) {
        tag.add_corners(corner.x());
        tag.add_corners(corner.y());
      }
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> CompareWithCameras(const FoundCalibration& found,
                                                            std::span<const TagSighting> fixed) {
  std::vector<TagSighting> tags;
  for (const PairedView& view : found.views) {
    ASSIGN_OR_RETURN(const auto means, MeanSightings(view.name, view.sizes, fixed));
    for (const auto& [key, mean] : means) tags.push_back(mean);
  }
  std::vector<bool> compared(found.views.size());
  std::vector<std::string> contradictions;
  for (const PairResult& pair : FindPairs(found.views, tags, {})) {
    if (!pair.distances || pair.distances->corners == 0) continue;
    const auto a = static_cast<size_t>(pair.a);
    const auto b = static_cast<size_t>(pair.b);
    compared[a] = compared[b] = true;
    if (pair.distances->worst_mask <= kMostMoved) continue;
    contradictions.push_back(absl::StrFormat("'%s' and '%s' by %.2f px (%.3f mask px)",
                                             found.views[a].name, found.views[b].name,
                                             pair.distances->worst, pair.distances->worst_mask));
  }
  if (!contradictions.empty()) {
    return FailedPrecondition(
        "a camera moved after it was calibrated, or its calibration is wrong: fixed tags that two "
        "views see are off their epipolar lines, in ",
        absl::StrJoin(contradictions, ", "), "; the limit is ", kMostMoved,
        " mask px; calibrate again, and take the fixed tags right after it");
  }
  std::vector<std::string> alone;
  for (size_t i = 0; i < compared.size(); ++i) {
    if (!compared[i]) alone.push_back(found.views[i].name);
  }
  return alone;
}

absl::Status WriteMatrices(const FoundCalibration& found, const std::string& file) {
  const storage::v1::Calibration calibration = MatricesOf(found, false);
  if (calibration.fundamental_matrices().empty()) {
    return FailedPrecondition("no pair of views has a matrix; nothing is written");
  }
  return WriteWholeFile(file, MatrixFileText(calibration, CellOf(found)));
}

absl::StatusOr<std::optional<storage::v1::CalibrationRecord>> RecordOfFile(
    const FoundCalibration& found, const std::string& file) {
  if (!fs::exists(file)) return std::nullopt;
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  const auto session = SessionFromText(text, file, CellOf(found));
  if (!session.ok()) {
    return absl::Status(session.status().code(),
                        absl::StrCat(session.status().message(), "; correct '", file,
                                     "', or remove it, for a new one in its place"));
  }
  if (session->camera_files.empty() || session->camera_files != CameraFilesOf(found, file)) {
    return std::nullopt;
  }
  return session->calibration.record();
}

absl::Status WriteCalibrationFile(const FoundCalibration& found,
                                  storage::v1::CalibrationRecord record, const std::string& file) {
  CalibrationSession session{.calibration = MatricesOf(found, !found.cameras.empty()),
                             .camera_files = CameraFilesOf(found, file)};
  if (session.camera_files.empty() && session.calibration.fundamental_matrices().empty()) {
    return FailedPrecondition("no pair of views has a matrix; nothing is written");
  }
  AddPairs(found, record);
  if (record.time().empty()) {
    record.set_time(absl::FormatTime(absl::RFC3339_sec, absl::Now(), absl::UTCTimeZone()));
  }
  *session.calibration.mutable_record() = std::move(record);
  return WriteWholeFile(file, SessionFileText(session, CellOf(found)));
}

}  // namespace silhouette
