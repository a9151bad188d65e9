// SPDX-License-Identifier: Apache-2.0
// silhouette-db stats: areas per view, what the robot always covers, outliers.
#include <iostream>
#include <map>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"
#include "db/status/status_macros.h"
#include "db/store/outliers.h"
#include "db/store/statistics.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

constexpr size_t kShownOutliers = 20;

struct StatsOptions {
  std::string database;
  std::string variant = schema::kDefaultVariant;
  std::string format = "text";
  std::string picture;
};

std::string ViewName(const Database& database, int view) {
  return view < 0 ? "" : database.cell().views(view).name();
}

void AppendOutliers(const Database& database, const std::vector<Outlier>& outliers,
                    std::string& text) {
  std::map<OutlierReason, uint64_t> counts;
  for (const Outlier& outlier : outliers) ++counts[outlier.reason];
  absl::StrAppend(&text, "\noutliers  ", outliers.size(), "\n");
  for (const auto& [reason, count] : counts) {
    absl::StrAppendFormat(&text, "  %-18s %9d\n", NameOf(reason), count);
  }
  if (!outliers.empty()) absl::StrAppend(&text, "\n");
  for (size_t i = 0; i < std::min(outliers.size(), kShownOutliers); ++i) {
    const Outlier& outlier = outliers[i];
    absl::StrAppendFormat(&text, "  %10d  %-18s %-12s %s\n", outlier.number, NameOf(outlier.reason),
                          ViewName(database, outlier.view),
                          JointText(database.grid(), outlier.number));
  }
  if (outliers.size() > kShownOutliers) {
    absl::StrAppendFormat(&text, "  and %d more; --format json lists all\n",
                          outliers.size() - kShownOutliers);
  }
}

std::string TextOf(const Database& database, const DatabaseStatistics& statistics,
                   const std::vector<Outlier>& outliers) {
  std::string text;
  absl::StrAppendFormat(&text, "%d captured, %d excluded, %d damaged, %d missing\n\n",
                        statistics.captured, statistics.excluded, statistics.damaged,
                        statistics.missing);
  absl::StrAppend(&text,
                  "view                  pixels    least     mean greatest   always    never\n");
  for (int i = 0; i < database.cell().views_size(); ++i) {
    const ViewStatistics& view = statistics.views[static_cast<size_t>(i)];
    const size_t pixels = view.ever.size().pixels();
    absl::StrAppendFormat(&text, "  %-18s %7d %8d %8.1f %8d %8d %8d\n", ViewName(database, i),
                          pixels, view.least_area, view.mean_area, view.greatest_area,
                          view.permanent.Count(), pixels - view.ever.Count());
  }
  AppendOutliers(database, outliers, text);
  return text;
}

nlohmann::json JsonOf(const Database& database, const DatabaseStatistics& statistics,
                      const std::vector<Outlier>& outliers) {
  nlohmann::json json = {{"captured", statistics.captured},  {"excluded", statistics.excluded},
                         {"damaged", statistics.damaged},    {"missing", statistics.missing},
                         {"views", nlohmann::json::array()}, {"outliers", nlohmann::json::array()}};
  for (int i = 0; i < database.cell().views_size(); ++i) {
    const ViewStatistics& view = statistics.views[static_cast<size_t>(i)];
    json["views"].push_back(
        {{"name", ViewName(database, i)},
         {"pixels", view.ever.size().pixels()},
         {"least_area", view.least_area},
         {"mean_area", view.mean_area},
         {"greatest_area", view.greatest_area},
         {"permanent_pixels", view.permanent.Count()},
         {"never_covered_pixels", view.ever.size().pixels() - view.ever.Count()}});
  }
  for (const Outlier& outlier : outliers) {
    nlohmann::json& entry = json["outliers"].emplace_back();
    entry = {{"number", outlier.number},
             {"reason", NameOf(outlier.reason)},
             {"joints", JointJson(database.grid(), outlier.number)}};
    if (outlier.view >= 0) entry["view"] = ViewName(database, outlier.view);
  }
  return json;
}

Picture StatsPaint(const Database& database, const DatabaseStatistics& statistics) {
  std::vector<CaptionedPicture> pictures;
  for (int i = 0; i < database.cell().views_size(); ++i) {
    const ViewStatistics& view = statistics.views[static_cast<size_t>(i)];
    const MaskSize size = view.ever.size();
    Picture picture = PictureOf(view.ever, palette::kUnknown);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        if (!view.permanent.at(x, y)) continue;
        const Colour colour = palette::kRobot;
        picture.at<cv::Vec3b>(y, x) = {colour.blue, colour.green, colour.red};
      }
    }
    const int factor = std::max(1, 256 / std::max(size.width, size.height));
    pictures.push_back({Enlarged(picture, factor), ViewName(database, i)});
  }
  return ContactSheet(pictures, {.title = "What the robot covers",
                                 .columns = 0,
                                 .legend = {{palette::kRobot, "always"},
                                            {palette::kUnknown, "in some configuration"},
                                            {palette::kBackground, "never"}}});
}

absl::StatusOr<ExitCode> Stats(const StatsOptions& options) {
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
  Print(options.format, TextOf(database, *statistics, *outliers),
        JsonOf(database, *statistics, *outliers));
  return kDone;
}

}  // namespace

void AddStats(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(
      app, work, "stats", "The robot's area per view, what it always covers, outliers", Stats);
  AddDatabaseArgument(command, options.database);
  AddVariantOption(command, options.variant);
  command.add_option("--picture", options.picture,
                     "Write what the robot covers always and ever to this PNG file");
  AddFormatOption(command, options.format);
  command.footer("Example:\n  silhouette-db stats cell.lmdb --picture covered.png");
}

}  // namespace silhouette
