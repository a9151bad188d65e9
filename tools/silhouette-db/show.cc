// SPDX-License-Identifier: Apache-2.0
// silhouette-db show: one configuration.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/numbers/numbers.h"
#include "common/picture/sheet.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/joint_values.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

using Json = nlohmann::ordered_json;

struct ShowOptions : DatabaseOptions {
  std::optional<ConfigurationNumber> number;
  std::vector<std::string> at;  // joint values, also several with commas between them
};

absl::StatusOr<ConfigurationNumber> Choose(const ConfigurationGrid& grid,
                                           const ShowOptions& options) {
  if (options.number) {
    if (grid.Contains(*options.number)) return *options.number;
    return absl::InvalidArgumentError(
        absl::StrCat("the grid has no configuration ", *options.number, "; it has ", grid.size(),
                     ", numbered below ", grid.number_limit(),
                     grid.number_limit() > grid.size() ? " with gaps" : ""));
  }
  const Configuration at = ParseConfiguration(absl::StrJoin(options.at, ","));
  if (at.size() != grid.joints().size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--at takes ", grid.joints().size(), " values, one per joint of the grid"));
  }
  const std::optional<ConfigurationNumber> number = grid.Nearest(at);
  if (!number) {
    return absl::InvalidArgumentError(
        absl::StrCat("(", absl::StrJoin(at, ", "), ") is outside the grid"));
  }
  return *number;
}

void PrintRecord(const std::string& format, const Database& database, const RobotImage& image) {
  const std::string time = TimeText(image.captured);
  std::string text = absl::StrFormat("configuration  %d\njoints         %s\n", image.number,
                                     JointText(database.grid(), image.number));
  if (image.excluded) text += "excluded       the robot must not enter it: never free\n";
  if (!time.empty()) absl::StrAppend(&text, "captured       ", time, "\n");
  for (const auto& [name, values] :
       {std::pair("commanded", &image.commanded), {"measured ", &image.measured}}) {
    if (!values->empty())
      absl::StrAppend(&text, name, "      ", absl::StrJoin(*values, ", "), "\n");
  }
  Json json = {{"number", image.number},       {"joints", JointJson(database.grid(), image.number)},
               {"excluded", image.excluded},   {"captured", time},
               {"commanded", image.commanded}, {"measured", image.measured},
               {"views", Json::array()}};
  for (size_t i = 0; i < image.masks.size(); ++i) {
    const std::string& view = database.cell().views(static_cast<int>(i)).name();
    const size_t area = image.masks[i].Count();
    absl::StrAppendFormat(&text, "view %-9s %d pixels (%.1f %%)\n", view, area,
                          Percent(area, image.masks[i].size().pixels()));
    json["views"].push_back({{"name", view}, {"pixels", area}});
  }
  PrintResult(format, json, text);
}

Picture ShowPaint(const Database& database, const RobotImage& image) {
  std::vector<CaptionedPicture> pictures;
  for (size_t i = 0; i < image.masks.size(); ++i) {
    pictures.push_back(
        {EnlargedTo(256, PictureOf(image.masks[i], palette::kRobot)),
         absl::StrFormat("%s: %d pixels", database.cell().views(static_cast<int>(i)).name(),
                         image.masks[i].Count())});
  }
  return ContactSheet(
      pictures, {.title = absl::StrCat("Configuration ", image.number, ": ",
                                       JointText(database.grid(), image.number)),
                 .columns = 0,
                 .legend = {{palette::kRobot, "robot"}, {palette::kBackground, "background"}}});
}

absl::StatusOr<ExitCode> ShowHere(const ShowOptions& options) {
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database, options.variant));
  const Database& database = *opened.database;
  ASSIGN_OR_RETURN(const ConfigurationNumber number, Choose(database.grid(), options));
  ASSIGN_OR_RETURN(const auto image, opened.snapshot.Find(number));
  if (!image) {
    std::cerr << "silhouette-db: configuration " << number << " ("
              << JointText(database.grid(), number) << ") is not in the database" << std::endl;
    return kNo;
  }
  if (!options.picture.empty() && !image->excluded) {
    RETURN_IF_ERROR(WritePng(options.picture, ShowPaint(database, *image)));
  }
  PrintRecord(options.format, database, *image);
  return kDone;
}

}  // namespace

void AddShow(CLI::App& app, Work& work) {
  auto [command, options] =
      AddCommand(app, work, "show", "The record of one configuration", ShowHere);
  AddVariantOption(command, options.variant);
  CLI::Option_group* choice = command.add_option_group("choice", "Which configuration");
  choice->add_option("number,--number", options.number, "Its number");
  choice->add_option(
      "--at", options.at,
      "The one nearest to these joint values, in the grid's order: radians, or 30deg, or 0.2m");
  choice->require_option(1);
  AddPictureOption(command, options.picture, "Write its masks to this PNG file");
  AddFormatOption(command, options.format);
  command.footer("Example:\n  silhouette-db show cell.lmdb --at 0.5,-70deg --picture robot.png");
}

}  // namespace silhouette
