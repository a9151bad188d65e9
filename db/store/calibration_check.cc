// SPDX-License-Identifier: Apache-2.0
// What is asked of a Calibration that is to be, or was, stored.
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/store.h"

namespace silhouette {
namespace {

using google::protobuf::RepeatedField;

bool AllFinite(const RepeatedField<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

// What is wrong with a camera; empty: nothing.
std::string FaultOf(const storage::v1::CameraModel& camera, const storage::v1::View& view) {
  const int width = camera.image_width();
  const int height = camera.image_height();
  if (width <= 0 || height <= 0) return "the camera model's image has no pixels";
  if (view.image_width() > 0 && (width != view.image_width() || height != view.image_height())) {
    return absl::StrCat("the camera model is for images of ", width, "x", height,
                        ", the view's images are ", view.image_width(), "x", view.image_height(),
                        "; take a model of the view's images");
  }
  if (!(camera.fx() > 0 && camera.fy() > 0)) return "a focal length is not positive";
  const int distortion = camera.distortion_size();
  if (distortion != 0 && distortion != 4 && distortion != 5 && distortion != 8) {
    return absl::StrCat("there are ", distortion, " distortion parameters, not 0, 4, 5 or 8");
  }
  if (camera.rotation_size() != 3) return "the rotation vector has not 3 values";
  if (camera.translation_size() != 3) return "the translation has not 3 values";
  const bool finite = std::isfinite(camera.fx()) && std::isfinite(camera.fy()) &&
                      std::isfinite(camera.cx()) && std::isfinite(camera.cy()) &&
                      AllFinite(camera.distortion()) && AllFinite(camera.rotation()) &&
                      AllFinite(camera.translation());
  return finite ? "" : "a value of the camera model is not finite";
}

absl::Status CheckMatrices(const storage::v1::Calibration& calibration,
                           const storage::v1::CellDescription& cell) {
  std::set<std::pair<int, int>> pairs;
  for (const storage::v1::FundamentalMatrix& matrix : calibration.fundamental_matrices()) {
    const int low = std::min(matrix.view_a(), matrix.view_b());
    const int high = std::max(matrix.view_a(), matrix.view_b());
    if (low < 0 || high >= cell.views_size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("a fundamental matrix is for view ", low < 0 ? low : high,
                       ", which is not there; the cell has ", cell.views_size(), " views"));
    }
    const std::string pair = absl::StrCat("views '", cell.views(matrix.view_a()).name(), "' and '",
                                          cell.views(matrix.view_b()).name(), "'");
    if (low == high) {
      return absl::InvalidArgumentError(
          absl::StrCat(pair, ": a fundamental matrix is for two different views"));
    }
    if (!pairs.insert({low, high}).second) {
      return absl::InvalidArgumentError(
          absl::StrCat(pair, " have two fundamental matrices; keep one"));
    }
    if (matrix.f_size() != 9 || !AllFinite(matrix.f())) {
      return absl::InvalidArgumentError(
          absl::StrCat(pair, ": a fundamental matrix has 9 finite values"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckTags(const storage::v1::CalibrationRecord& record,
                       const storage::v1::CellDescription& cell) {
  for (const storage::v1::FixedTag& tag : record.fixed_tags()) {
    if (tag.view() < 0 || tag.view() >= cell.views_size()) {
      return absl::InvalidArgumentError("a fixed tag is not of one of the views");
    }
    if ((tag.corners_size() != 8 && tag.corners_size() != 2) || !AllFinite(tag.corners()) ||
        !(tag.sigma() > 0) || !std::isfinite(tag.sigma())) {
      return absl::InvalidArgumentError(absl::StrCat(
          "view '", cell.views(tag.view()).name(), "', fixed tag ", tag.tag(),
          ": a tag has four finite corners, a corner of a chessboard is one, and sigma "
          "is positive"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckCalibration(const storage::v1::Calibration& calibration,
                              const storage::v1::CellDescription& cell) {
  if (calibration.cameras().empty() == calibration.fundamental_matrices().empty()) {
    return absl::InvalidArgumentError(
        "a calibration has either camera models or fundamental matrices");
  }
  RETURN_IF_ERROR(CheckTags(calibration.record(), cell));
  if (calibration.cameras().empty()) return CheckMatrices(calibration, cell);
  if (calibration.cameras_size() != cell.views_size()) {
    return absl::InvalidArgumentError(absl::StrCat("there are ", calibration.cameras_size(),
                                                   " camera models for ", cell.views_size(),
                                                   " views"));
  }
  for (int i = 0; i < cell.views_size(); ++i) {
    const std::string fault = FaultOf(calibration.cameras(i), cell.views(i));
    if (fault.empty()) continue;
    return absl::InvalidArgumentError(absl::StrCat("view '", cell.views(i).name(), "': ", fault));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
