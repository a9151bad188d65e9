// SPDX-License-Identifier: Apache-2.0
// silhouette-db stats: areas per view, pixels that the robot always covers, outliers.
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/outliers.h"
#include "db/store/statistics.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

constexpr size_t kShownOutliers = 20;

using Json = nlohmann::ordered_json;

std::string ViewName(const Database& database, int view) {
  return view < 0 ? "" : database.cell().views(view).name();
}

void AppendViews(const Database& database, const DatabaseStatistics& statistics, std::string& text,
                 Json& json) {
  Table table{.headings = {"view", "pixels", "least", "mean", "greatest", "always", "never"}};
  json["views"] = Json::array();
  for (int i = 0; i < database.cell().views_size(); ++i) {
    const ViewStatistics& view = statistics.views[static_cast<size_t>(i)];
    const size_t pixels = view.ever.size().pixels();
    const size_t always = view.permanent.Count();
    const size_t never = pixels - view.ever.Count();
    table.rows.push_back({ViewName(database, i), absl::StrCat(pixels),
                          absl::StrCat(view.least_area), absl::StrFormat("%.1f", view.mean_area),
                          absl::StrCat(view.greatest_area), absl::StrCat(always),
                          absl::StrCat(never)});
    json["views"].push_back({{"name", ViewName(database, i)},
                             {"pixels", pixels},
                             {"least_area", view.least_area},
                             {"mean_area", view.mean_area},
                             {"greatest_area", view.greatest_area},
                             {"permanent_pixels", always},
                             {"never_covered_pixels", never}});
  }
  absl::StrAppend(&text, "\n", TextOf(table));
}

void AppendOutliers(const Database& database, const std::vector<Outlier>& outliers,
                    std::string& text, Json& json) {
  std::map<OutlierReason, uint64_t> counts;
  Table first{.headings = {"reason", "number", "view", "joints"}};
  json["outliers"] = Json::array();
  for (const Outlier& outlier : outliers) {
    const std::string reason = NameOf(outlier.reason);
    ++counts[outlier.reason];
    if (first.rows.size() < kShownOutliers) {
      first.rows.push_back({reason, absl::StrCat(outlier.number), ViewName(database, outlier.view),
                            JointText(database.grid(), outlier.number)});
    }
    Json& entry = json["outliers"].emplace_back();
    entry = {{"number", outlier.number},
             {"reason", reason},
             {"joints", JointJson(database.grid(), outlier.number)}};
    if (outlier.view >= 0) entry["view"] = ViewName(database, outlier.view);
  }
  absl::StrAppend(&text, "\noutliers  ", outliers.size(), "\n");
  for (const auto& [reason, count] : counts) {
    absl::StrAppendFormat(&text, "  %-18s %9d\n", NameOf(reason), count);
  }
  if (!outliers.empty()) absl::StrAppend(&text, "\n", TextOf(first));
  if (outliers.size() > kShownOutliers) {
    absl::StrAppendFormat(&text, "and %d more; --format json lists all\n",
                          outliers.size() - kShownOutliers);
  }
}

Picture StatsPaint(const Database& database, const DatabaseStatistics& statistics) {
  std::vector<CaptionedPicture> pictures;
  for (int i = 0; i < database.cell().views_size(); ++i) {
    const ViewStatistics& view = statistics.views[static_cast<size_t>(i)];
    const Picture ever = PictureOf(view.ever, palette::kUnknown);
    pictures.push_back({EnlargedTo(256, WithVeil(ever, view.permanent, palette::kRobot, 1)),
                        ViewName(database, i)});
  }
  return ContactSheet(pictures, {.title = "What the robot covers",
                                 .columns = 0,
                                 .legend = {{palette::kRobot, "always"},
                                            {palette::kUnknown, "in some configuration"},
                                            {palette::kBackground, "never"}}});
}

absl::StatusOr<ExitCode> Stats(const DatabaseOptions& options) {
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database, options.variant));
  const Database& database = *opened.database;
  CatchStopSignals();
  absl::StatusOr<DatabaseStatistics> statistics = DatabaseStatistics();
  absl::StatusOr<std::vector<Outlier>> outliers = std::vector<Outlier>();
  {
    Progress progress("stats", 2 * opened.snapshot.size(), "records");
    statistics =
        StatisticsOf(opened.snapshot, database.grid(), database.mask_sizes(), [&](uint64_t done) {
          progress.Update(done);
          return !StopRequested();
        });
    if (!statistics.ok()) return statistics.status();
    outliers = FindOutliers(opened.snapshot, database.grid(), {}, [&](uint64_t done) {
      progress.Update(opened.snapshot.size() + done);
      return !StopRequested();
    });
    if (!outliers.ok()) return outliers.status();
  }
  if (!options.picture.empty()) {
    RETURN_IF_ERROR(WritePng(options.picture, StatsPaint(database, *statistics)));
  }
  std::string text =
      absl::StrFormat("%d captured, %d excluded, %d damaged, %d missing\n", statistics->captured,
                      statistics->excluded, statistics->damaged, statistics->missing);
  Json json = {{"captured", statistics->captured},
               {"excluded", statistics->excluded},
               {"damaged", statistics->damaged},
               {"missing", statistics->missing}};
  AppendViews(database, *statistics, text, json);
  AppendOutliers(database, *outliers, text, json);
  PrintResult(options.format, json, text);
  return kDone;
}

}  // namespace

void AddStats(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(
      app, work, "stats", "The robot's area per view, what it always covers, outliers", Stats);
  AddVariantOption(command, options.variant);
  AddPictureOption(command, options.picture,
                   "Write the pixels that the robot covers always or sometimes to this PNG file");
  AddFormatOption(command, options.format);
  command.footer("Example:\n  silhouette-db stats cell.lmdb --picture covered.png");
}

}  // namespace silhouette
