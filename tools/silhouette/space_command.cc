// SPDX-License-Identifier: Apache-2.0
// silhouette space
#include <chrono>
#include <memory>
#include <optional>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/formats/pictures.h"

namespace silhouette {
namespace {

struct SpaceArguments {
  std::string out;
  std::string picture;
  std::optional<absl::Duration> max_time;
  std::vector<double> clearance_levels;
};

absl::Status SpaceWritePicture(const Session& session, const Client& client,
                               const client::ConfigurationSpace& space, const std::string& path) {
  const bool levels = !space.clearance_levels().empty();
  TypedJoints joints(session.unit, [&] { return client.GetDatabase(); });
  ASSIGN_OR_RETURN(const auto chart,
                   ChartOf(space, joints.Slides(),
                           levels ? "Configuration space, clearance" : "Configuration space"));
  return WritePng(path, Draw(chart));
}

// Why the first unknown configuration is unknown; nothing if none is, or the server now knows it.
absl::StatusOr<std::optional<client::Reason>> WhyUnknown(const Client& client,
                                                         const client::ConfigurationSpace& space,
                                                         const client::Policy& policy) {
  if (space.unknown_reason() || space.Count().unknown == 0) return space.unknown_reason();
  ConfigurationNumber number = 0;
  while (!space.grid().Contains(number) || space.StateAt(number) != client::State::kUnknown) {
    ++number;
  }
  ASSIGN_OR_RETURN(const auto checks,
                   client.CheckConfigurations({space.grid().At(number)}, policy));
  const client::Verdict& verdict = checks.verdicts[0];
  if (verdict.state != client::State::kUnknown) return std::nullopt;
  return verdict.reason;
}

Json JsonOfLevels(const client::ConfigurationSpace& space) {
  Json levels = Json::array();
  const std::vector<uint64_t> counts = space.CountAbove();
  for (size_t i = 0; i < counts.size(); ++i) {
    levels.push_back({{"above", space.clearance_levels()[i]}, {"configurations", counts[i]}});
  }
  return levels;
}

std::string TableOfLevels(const client::ConfigurationSpace& space) {
  Table table;
  const std::vector<uint64_t> counts = space.CountAbove();
  for (size_t i = 0; i < counts.size(); ++i) {
    table.rows.push_back(
        {absl::StrCat("free with a clearance above ", space.clearance_levels()[i], " px:"),
         absl::StrCat(counts[i]),
         absl::StrFormat("(%.1f %%)", Percent(counts[i], space.grid().size()))});
  }
  return TextOf(table);
}

absl::StatusOr<ExitCode> FetchSpace(const Session& session, const SpaceArguments& arguments) {
  if (!arguments.out.empty() && !absl::EndsWith(arguments.out, ".json") &&
      !absl::EndsWith(arguments.out, ".csv")) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", arguments.out, "': --out writes .json or .csv"));
  }
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  const client::Policy& policy = session.policy;
  const auto start = std::chrono::steady_clock::now();
  const auto space =
      client.GetConfigurationSpace(policy, {}, arguments.max_time, arguments.clearance_levels);
  const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - start;
  if (!space.ok()) return space.status();
  absl::Status status;
  if (!arguments.out.empty()) status.Update(WriteSpace(*space, arguments.out));
  if (!arguments.picture.empty()) {
    status.Update(SpaceWritePicture(session, client, *space, arguments.picture));
  }
  if (!status.ok()) return status;

  const client::StateCounts counts = space->Count();
  const uint64_t all = space->grid().size();
  ASSIGN_OR_RETURN(const auto unknown, WhyUnknown(client, *space, policy));
  Json json = JsonOf(space->basis());
  json.update({{"configurations", all},
               {"free", counts.free},
               {"occupied", counts.occupied},
               {"unknown", counts.unknown},
               {"tiles_left_out", space->tiles_left_out()},
               {"unknown_reason", unknown ? Json(NameOf(*unknown)) : Json()},
               {"space_ms", taken.count()}});
  if (!arguments.clearance_levels.empty()) json["clearance_levels"] = JsonOfLevels(*space);
  std::string text = absl::StrFormat(
      "%d configurations: %d free (%.1f %%), %d occupied (%.1f %%), %d unknown (%.1f %%)\n", all,
      counts.free, Percent(counts.free, all), counts.occupied, Percent(counts.occupied, all),
      counts.unknown, Percent(counts.unknown, all));
  absl::StrAppend(&text, TableOfLevels(*space));
  if (space->tiles_left_out() > 0) {
    absl::StrAppendFormat(
        &text,
        "unknown, as the time was over: what is in %d of %d tiles; ask again for more of them\n",
        space->tiles_left_out(), space->grid().tiles());
  }
  if (unknown) {
    absl::StrAppend(&text, "unknown, the first of them: ", Spoken(*unknown, space->basis()), "\n");
  }
  absl::StrAppend(&text, Spoken(space->basis()),
                  absl::StrFormat("; fetched in %.1f ms\n", taken.count()));
  PrintResult(session.format, json, text);
  return kDone;
}

}  // namespace

void AddSpaceCommand(CLI::App& program, Session& session) {
  CLI::App* command = program.add_subcommand(
      "space", "Fetch the verdicts of all configurations of the grid: the configuration space");
  auto arguments = std::make_shared<SpaceArguments>();
  command->add_option("--out", arguments->out,
                      "Write number, joint values and state of each: .json or .csv");
  AddPictureOption(*command, arguments->picture, "Draw it as a PNG, for grids of two joints");
  AddTimeOption(*command, "--max-time", arguments->max_time,
                "How long the server may work, e.g. 20ms; what is not done is unknown");
  command
      ->add_option("--clearance", arguments->clearance_levels,
                   "Also report which free configurations have more clearance than each of these "
                   "levels, in mask pixels, ascending: --clearance 1,2,4,8")
      ->delimiter(',');
  AddVerdictOptions(*command, session);
  command->footer(
      "Example:\n  silhouette space --out space.csv --picture space.png\n"
      "  silhouette space --clearance 1,2,4,8 --picture clearance.png");
  Runs(*command, session, FetchSpace, arguments);
}

}  // namespace silhouette
