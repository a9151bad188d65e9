// SPDX-License-Identifier: Apache-2.0
#include "calib/files/calibration_check_file.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr int kCalibrationCheckVersion = 1;

bool IsLength(double value) { return std::isfinite(value) && value >= 0; }

}  // namespace

bool CalibrationCheck::Holds() const {
  return !views.empty() && std::ranges::all_of(views, &CheckedView::holds);
}

std::string CalibrationCheck::Summary() const {
  std::vector<std::string> faults;
  double most = 0;
  for (const CheckedView& view : views) {
    most = std::max(most, view.moved_mask_px);
    if (view.holds) continue;
    faults.push_back(view.checked
                         ? absl::StrFormat("view '%s' moved by %.2f px (%.2f mask px)", view.name,
                                           view.moved_px, view.moved_mask_px)
                         : absl::StrCat("view '", view.name, "' was not checked: ", view.message));
  }
  if (views.empty()) return "no view was checked";
  if (faults.empty()) return absl::StrFormat("no view moved by more than %.2f mask px", most);
  return absl::StrJoin(faults, "; ");
}

std::string CheckFileText(const CalibrationCheck& check) {
  nlohmann::ordered_json json = {
      {"check", kCalibrationCheckVersion},
      {"time", absl::FormatTime(absl::RFC3339_full, check.time, absl::UTCTimeZone())},
      {"calibration", check.calibration},
      {"limit_mask_px", check.limit_mask_px},
      {"holds", check.Holds()},
      {"views", nlohmann::ordered_json::array()}};
  for (const CheckedView& view : check.views) {
    json["views"].push_back({{"name", view.name},
                             {"method", view.method},
                             {"checked", view.checked},
                             {"moved_px", view.moved_px},
                             {"moved_mask_px", view.moved_mask_px},
                             {"holds", view.holds},
                             {"message", view.message}});
  }
  // Messages may name files whose names are not UTF-8.
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

absl::StatusOr<CalibrationCheck> CheckFromText(const std::string& text, const std::string& file) {
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    if (json.at("check").get<int>() != kCalibrationCheckVersion) {
      return InvalidArgument("'", file, "' is of version ", json.at("check").get<int>(), ", not ",
                             kCalibrationCheckVersion);
    }
    CalibrationCheck check;
    std::string error;
    const std::string time = json.at("time").get<std::string>();
    if (!absl::ParseTime(absl::RFC3339_full, time, &check.time, &error)) {
      return InvalidArgument("'", file, "': time: ", error);
    }
    check.calibration = json.at("calibration").get<std::string>();
    check.limit_mask_px = json.at("limit_mask_px").get<double>();
    if (!IsLength(check.limit_mask_px)) {
      return InvalidArgument("'", file, "': limit_mask_px ", check.limit_mask_px, " is no limit");
    }
    for (const nlohmann::json& view : json.at("views")) {
      CheckedView& added = check.views.emplace_back();
      added.name = view.at("name").get<std::string>();
      added.method = view.at("method").get<std::string>();
      added.checked = view.at("checked").get<bool>();
      added.moved_px = view.at("moved_px").get<double>();
      added.moved_mask_px = view.at("moved_mask_px").get<double>();
      for (const double moved : {added.moved_px, added.moved_mask_px}) {
        if (IsLength(moved)) continue;
        return InvalidArgument("'", file, "': view '", added.name, "' cannot have moved by ", moved,
                               " px");
      }
      // What the file says of itself is not believed where its numbers contradict.
      added.holds = view.at("holds").get<bool>() && added.checked &&
                    added.moved_mask_px <= check.limit_mask_px;
      added.message = view.at("message").get<std::string>();
    }
    if (check.Holds() && !json.at("holds").get<bool>()) {
      return InvalidArgument("'", file, "' states that the calibration does not hold");
    }
    return check;
  } catch (const nlohmann::json::exception& error) {
    return InvalidArgument("'", file,
                           "' is no result of 'silhouette-calibrate check': ", error.what());
  }
}

}  // namespace silhouette
