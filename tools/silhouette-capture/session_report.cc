// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/session_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "capture/session/raw_archive.h"
#include "common/picture/chart.h"
#include "common/picture/files.h"
#include "common/picture/sheet.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-capture/session_page.h"
#include "tools/silhouette-capture/tune_pictures.h"

namespace silhouette {
namespace {

absl::StatusOr<ReportPictures> Paint(const Database& database, const Snapshot& snapshot,
                                     const SessionFacts& facts) {
  ReportPictures pictures;
  pictures["coverage"] = EncodePng(CoveragePicture(database.grid(), facts));
  ASSIGN_OR_RETURN(const auto sentinels, SentinelPicture(database, snapshot, facts));
  pictures["sentinels"] = EncodePng(sentinels);
  ASSIGN_OR_RETURN(const auto outliers, OutlierPicture(database, snapshot, facts));
  if (outliers) pictures["outliers"] = EncodePng(*outliers);
  const auto history = HistoryPicture(database.cell(), facts);
  if (history) pictures["history"] = EncodePng(*history);
  return pictures;
}

absl::Status WriteAll(const std::string& folder, const std::string& page, const std::string& json,
                      const ReportPictures& pictures) {
  absl::Status status = WriteWholeFile(folder + "/report.html", page);
  status.Update(WriteWholeFile(folder + "/report.json", json));
  for (const auto& [name, png] : pictures) {
    status.Update(WriteWholeFile(absl::StrCat(folder, "/", name, ".png"), png));
  }
  return status;
}

}  // namespace

std::string DefaultReportFolder(const std::string& database, const std::string& variant) {
  return BesideDatabase(
      database, absl::StrCat(variant == schema::kDefaultVariant ? "" : "." + variant, ".report"));
}

absl::StatusOr<SessionFacts> WriteSessionReport(const CellArguments& arguments,
                                                const std::string& cell_name,
                                                const Database& database, const std::string& log,
                                                const std::string& folder) {
  RETURN_IF_ERROR(MakeFolder(folder));
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(SessionFacts facts, GatherFacts(arguments, database, snapshot, log));
  ASSIGN_OR_RETURN(const auto pictures, Paint(database, snapshot, facts));
  const std::string now = absl::FormatTime("%Y-%m-%d %H:%M", absl::Now(), absl::LocalTimeZone());
  std::vector<std::pair<std::string, std::string>> origin = {{"cell", cell_name},
                                                             {"database", database.path()}};
  if (facts.variants.size() > 1) origin.emplace_back("variant", facts.variant);
  origin.emplace_back("made", now);
  const std::string page = SessionPage(facts, database.cell(), origin, pictures);
  RETURN_IF_ERROR(
      WriteAll(folder, page, SessionJson(facts, database.cell()).dump(2) + "\n", pictures));
  return facts;
}

namespace {

constexpr size_t kMostOutliers = 24;
constexpr int kPictureSide = 220;

std::vector<LegendEntry> Classes() {
  return {{palette::kCaptured, "captured"}, {palette::kExcluded, "excluded"},
          {palette::kTight, "outlier"},     {palette::kUnknown, "suspect"},
          {palette::kDamaged, "damaged"},   {palette::kMissing, "missing"}};
}

ChartAxis AxisOf(const GridJoint& joint) {
  return {.label = joint.name,
          .unit = "rad or m",
          .first = joint.lower,
          .last = joint.lower + joint.step() * (joint.steps - 1),
          .cells = joint.steps};
}

// The two joints with the most values, the first of them across.
std::pair<size_t, size_t> WidestJoints(const ConfigurationGrid& grid) {
  std::vector<size_t> joints(grid.joints().size());
  for (size_t j = 0; j < joints.size(); ++j) joints[j] = j;
  std::stable_sort(joints.begin(), joints.end(), [&](size_t a, size_t b) {
    return grid.joints()[a].steps > grid.joints()[b].steps;
  });
  if (joints.size() == 1) return {joints[0], joints[0]};
  return {std::min(joints[0], joints[1]), std::max(joints[0], joints[1])};
}

// A robot image in a view: the camera's, if it was kept, under the mask.
absl::StatusOr<Picture> PictureIn(const Snapshot& snapshot, ConfigurationNumber number, int view,
                                  MaskSize size, const storage::v1::View& description) {
  const auto image = snapshot.Find(number);
  if (!image.ok() && !absl::IsDataLoss(image.status())) return image.status();
  const int height = kPictureSide * std::max(1, description.image_height()) /
                     std::max(1, description.image_width());
  const int high = description.image_width() > 0 ? height : kPictureSide * size.height / size.width;
  if (!image.ok()) return BlankPicture(kPictureSide, high, palette::kDamaged);
  if (!image->has_value() || (*image)->masks.empty()) {
    return BlankPicture(kPictureSide, high, palette::kMissing);
  }
  const Mask& mask = (*image)->masks[static_cast<size_t>(view)];
  const auto raw = snapshot.FindRawImage(number, view);
  cv::Mat camera;
  if (raw.ok() && raw->has_value()) camera = ImageInPng((*raw)->png);
  if (camera.empty()) return FittedInto(PictureOf(mask, palette::kRobot), kPictureSide, high);
  return FittedInto(WithVeil(CameraPicture(camera), mask, palette::kRobot, 0.45), kPictureSide,
                    high);
}

std::string At(const ConfigurationGrid& grid, ConfigurationNumber number) {
  std::string text = absl::StrCat(number, ":");
  for (const double value : grid.At(number)) absl::StrAppendFormat(&text, " %.3g", value);
  return text;
}

// Configurations to be looked at, with what is said of them, and the view to show.
struct Odd {
  ConfigurationNumber number = 0;
  int view = 0;
  std::string what;
};

std::vector<Odd> OddOnes(const SessionFacts& facts) {
  std::vector<Odd> odd;
  for (const Outlier& outlier : facts.outliers) {
    odd.push_back({outlier.number, std::max(outlier.view, 0), NameOf(outlier.reason)});
  }
  for (const ConfigurationNumber number : facts.suspects) odd.push_back({number, 0, "suspect"});
  if (odd.size() <= kMostOutliers) return odd;
  std::vector<Odd> some;
  for (size_t i = 0; i < kMostOutliers; ++i) some.push_back(odd[i * odd.size() / kMostOutliers]);
  return some;
}

}  // namespace

Picture CoveragePicture(const ConfigurationGrid& grid, const SessionFacts& facts) {
  const auto [across, upwards] = WidestJoints(grid);
  const bool one = across == upwards;
  const GridJoint& x = grid.joints()[across];
  const GridJoint& y = grid.joints()[upwards];
  ConfigurationChart chart;
  chart.title = "How the configurations stand";
  chart.x = AxisOf(x);
  chart.y = one ? ChartAxis{.label = "", .unit = "", .cells = 1} : AxisOf(y);
  chart.classes = Classes();
  chart.cells.assign(static_cast<size_t>(chart.x.cells) * static_cast<size_t>(chart.y.cells), 0);
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    const auto index = grid.IndexOf(number);
    if (!index) continue;
    const size_t row = one ? 0 : static_cast<size_t>((*index)[upwards]);
    uint8_t& cell = chart.cells[row * static_cast<size_t>(chart.x.cells) +
                                static_cast<size_t>((*index)[across])];
    cell = std::max(cell, static_cast<uint8_t>(facts.standings[number]));
  }
  return Draw(chart);
}

absl::StatusOr<Picture> SentinelPicture(const Database& database, const Snapshot& snapshot,
                                        const SessionFacts& facts) {
  std::vector<ConfigurationNumber> numbers(facts.history.sentinels().begin(),
                                           facts.history.sentinels().end());
  for (ConfigurationNumber number = 0; numbers.empty() && number < facts.standings.size();
       ++number) {
    if (facts.standings[number] == Standing::kCaptured) numbers.push_back(number);
  }
  std::vector<CaptionedPicture> pictures;
  const auto& views = database.cell().views();
  for (const ConfigurationNumber number : numbers) {
    for (int v = 0; v < views.size(); ++v) {
      ASSIGN_OR_RETURN(
          auto picture,
          PictureIn(snapshot, number, v, database.mask_sizes()[static_cast<size_t>(v)], views[v]));
      pictures.push_back(
          {picture, absl::StrCat(views[v].name(), ", ", At(database.grid(), number))});
    }
  }
  if (pictures.empty()) return BlankPicture(kPictureSide, 40);
  return ContactSheet(pictures, {.title = "", .columns = std::min(views.size(), 6), .legend = {}});
}

absl::StatusOr<std::optional<Picture>> OutlierPicture(const Database& database,
                                                      const Snapshot& snapshot,
                                                      const SessionFacts& facts) {
  std::vector<CaptionedPicture> pictures;
  for (const Odd& odd : OddOnes(facts)) {
    const storage::v1::View& view = database.cell().views(odd.view);
    ASSIGN_OR_RETURN(auto picture,
                     PictureIn(snapshot, odd.number, odd.view,
                               database.mask_sizes()[static_cast<size_t>(odd.view)], view));
    pictures.push_back({picture, absl::StrCat(view.name(), ", ", At(database.grid(), odd.number),
                                              ", ", odd.what)});
  }
  if (pictures.empty()) return std::optional<Picture>();
  return std::optional<Picture>(ContactSheet(pictures, {.title = "", .columns = 4, .legend = {}}));
}

std::optional<Picture> HistoryPicture(const storage::v1::CellDescription& cell,
                                      const SessionFacts& facts) {
  const auto& checks = facts.history.checks();
  if (checks.size() < 2) return std::nullopt;
  const absl::Time begin = TimeOf(checks[0].time());
  const double hours = absl::ToDoubleHours(TimeOf(checks.rbegin()->time()) - begin);
  const bool long_ago = hours > 2;
  const std::string time =
      long_ago ? "hours since the first visit" : "minutes since the first visit";
  std::vector<LineChart> panels(3);
  panels[0].title = "by how far the background moved";
  panels[0].y_label = "camera pixels";
  panels[1].title = "mask pixels that differ";
  panels[1].y_label = "mask pixels";
  panels[2].title = "brightness";
  panels[2].y_label = "percent of the first";
  for (LineChart& panel : panels) panel.x_label = time;
  for (int v = 0; v < cell.views_size(); ++v) {
    const LineSeries series{cell.views(v).name(), SeriesColour(static_cast<size_t>(v)), {}};
    for (LineChart& panel : panels) panel.series.push_back(series);
    for (const storage::v1::SentinelCheck& check : checks) {
      const absl::Duration since = TimeOf(check.time()) - begin;
      const double x = long_ago ? absl::ToDoubleHours(since) : absl::ToDoubleMinutes(since);
      double shift = -1;
      double pixels = -1;
      double gain = 1;
      for (const storage::v1::SentinelSight& sight : check.sights()) {
        if (sight.view() != v) continue;
        const double length = std::hypot(sight.shift_x(), sight.shift_y());
        if (std::isfinite(length)) shift = std::max(shift, length);
        pixels = std::max<double>(pixels, sight.mask_pixels());
        if (std::abs(sight.gain() - 1) > std::abs(gain - 1)) gain = sight.gain();
      }
      const auto place = static_cast<size_t>(v);
      if (shift >= 0) panels[0].series[place].points.push_back({x, shift});
      if (pixels < 0) continue;
      panels[1].series[place].points.push_back({x, pixels});
      if (std::isfinite(gain)) panels[2].series[place].points.push_back({x, 100 * gain});
    }
  }
  return Draw(panels, {.title = "", .columns = 3, .width = 320, .height = 220});
}

}  // namespace silhouette
