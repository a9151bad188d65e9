// silhouette space
#include <chrono>
#include <fstream>
#include <iostream>
#include <memory>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/formats/region_text.h"
#include "tools/silhouette/formats/space_picture.h"
#include "tools/silhouette/options.h"

namespace silhouette {
namespace {

struct SpaceArguments {
  std::string out;
  std::string picture;
  std::string max_time;
  std::vector<double> clearance_levels;
  PolicyOptions policy;
};

void WriteCsv(const client::ConfigurationSpace& space, std::ostream& out) {
  const ConfigurationGrid& grid = space.grid();
  out << "number";
  for (const GridJoint& joint : grid.joints()) out << ',' << joint.name;
  const bool levels = !space.clearance_levels().empty();
  out << (levels ? ",state,clearance_above\n" : ",state\n");
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number)) continue;
    out << number;
    for (double value : grid.At(number)) out << absl::StreamFormat(",%.17g", value);
    out << ',' << NameOf(space.StateAt(number));
    const std::optional<double> exceeds = space.ClearanceAt(number).exceeds;
    if (levels) out << ',' << (exceeds ? absl::StrFormat("%.17g", *exceeds) : "");
    out << '\n';
  }
}

// One line per configuration, without the whole of it in memory.
void WriteJson(const client::ConfigurationSpace& space, std::ostream& out) {
  const ConfigurationGrid& grid = space.grid();
  Json head = JsonOf(space.basis());
  head["joints"] = Json::array();
  for (const GridJoint& joint : grid.joints()) head["joints"].push_back(joint.name);
  std::string text = head.dump();
  text.pop_back();
  out << text << ",\n\"configurations\":[";
  bool first = true;
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number)) continue;
    Json entry{{"number", number},
               {"configuration", grid.At(number)},
               {"state", NameOf(space.StateAt(number))}};
    if (!space.clearance_levels().empty()) {
      const std::optional<double> exceeds = space.ClearanceAt(number).exceeds;
      entry["clearance_above"] = exceeds ? Json(*exceeds) : Json();
    }
    out << (first ? "\n" : ",\n") << entry.dump();
    first = false;
  }
  out << "\n]}\n";
}

absl::Status WriteSpace(const client::ConfigurationSpace& space, const std::string& path) {
  std::ofstream out(path);
  if (!out) return absl::FailedPreconditionError("the file '" + path + "' cannot be written");
  absl::EndsWith(path, ".csv") ? WriteCsv(space, out) : WriteJson(space, out);
  out.close();
  if (out) return absl::OkStatus();
  return absl::ResourceExhaustedError("cannot write all of '" + path + "'; is the disk full?");
}

absl::Status SpaceWritePicture(const client::ConfigurationSpace& space, const std::string& path) {
  const bool levels = !space.clearance_levels().empty();
  ASSIGN_OR_RETURN(const auto chart, ChartOf(space, levels ? "Configuration space, clearance"
                                                           : "Configuration space"));
  return WritePng(path, Draw(chart));
}

// Why the first unknown configuration is unknown, as the server says.
absl::StatusOr<client::Verdict> FirstUnknown(const Client& client,
                                             const client::ConfigurationSpace& space,
                                             const client::Policy& policy) {
  ConfigurationNumber number = 0;
  while (!space.grid().Contains(number) || space.StateAt(number) != client::State::kUnknown) {
    ++number;
  }
  ASSIGN_OR_RETURN(const auto checks,
                   client.CheckConfigurations({space.grid().At(number)}, policy));
  return checks.verdicts[0];
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
  std::vector<std::vector<std::string>> rows;
  const std::vector<uint64_t> counts = space.CountAbove();
  for (size_t i = 0; i < counts.size(); ++i) {
    rows.push_back(
        {absl::StrCat("free with a clearance above ", space.clearance_levels()[i], " px:"),
         absl::StrCat(counts[i]),
         absl::StrFormat("(%.1f %%)", Percent(counts[i], space.grid().size()))});
  }
  return Table(rows);
}

absl::StatusOr<ExitCode> FetchSpace(const Session& session, const SpaceArguments& arguments) {
  if (!arguments.out.empty() && !absl::EndsWith(arguments.out, ".json") &&
      !absl::EndsWith(arguments.out, ".csv")) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", arguments.out, "': --out writes .json or .csv"));
  }
  std::optional<absl::Duration> max_time;
  if (!arguments.max_time.empty()) {
    ASSIGN_OR_RETURN(const absl::Duration time, ParseDuration(arguments.max_time));
    max_time = time;
  }
  const absl::StatusOr<Client> client = session.Connect();
  if (!client.ok()) return client.status();
  const client::Policy policy = arguments.policy.policy();
  const auto start = std::chrono::steady_clock::now();
  const auto space =
      client->GetConfigurationSpace(policy, {}, max_time, arguments.clearance_levels);
  const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - start;
  if (!space.ok()) return space.status();
  absl::Status status;
  if (!arguments.out.empty()) status.Update(WriteSpace(*space, arguments.out));
  if (!arguments.picture.empty()) status.Update(SpaceWritePicture(*space, arguments.picture));
  if (!status.ok()) return status;

  const client::StateCounts counts = space->Count();
  const uint64_t all = space->grid().size();
  absl::StatusOr<client::Verdict> unknown = client::Verdict();
  if (counts.unknown > 0) unknown = FirstUnknown(*client, *space, policy);
  if (!unknown.ok()) return unknown.status();
  const bool told = counts.unknown > 0 && unknown->state == client::State::kUnknown;
  if (session.json()) {
    Json json = JsonOf(space->basis());
    json.update({{"configurations", all},
                 {"free", counts.free},
                 {"occupied", counts.occupied},
                 {"unknown", counts.unknown},
                 {"tiles_left_out", space->tiles_left_out()},
                 {"unknown_reason", told ? Json(NameOf(unknown->reason)) : Json()},
                 {"space_ms", taken.count()}});
    if (!arguments.clearance_levels.empty()) json["clearance_levels"] = JsonOfLevels(*space);
    Print(json);
    return kDone;
  }
  std::cout << absl::StrFormat(
      "%d configurations: %d free (%.1f %%), %d occupied (%.1f %%), %d unknown (%.1f %%)\n", all,
      counts.free, Percent(counts.free, all), counts.occupied, Percent(counts.occupied, all),
      counts.unknown, Percent(counts.unknown, all));
  std::cout << TableOfLevels(*space);
  if (space->tiles_left_out() > 0) {
    std::cout << absl::StreamFormat(
        "unknown, as the time was over: what is in %d of %d tiles; ask again for more of them\n",
        space->tiles_left_out(), space->grid().tiles());
  }
  if (told) std::cout << "unknown, the first of them: " << Describe(unknown->reason) << '\n';
  std::cout << Spoken(space->basis())
            << absl::StreamFormat("; fetched in %.1f ms\n", taken.count());
  return kDone;
}

}  // namespace

void AddSpaceCommand(CLI::App& program, Session& session, Run& run) {
  CLI::App* command = program.add_subcommand(
      "space", "Fetch the verdicts of all configurations of the grid: the configuration space");
  auto arguments = std::make_shared<SpaceArguments>();
  command->add_option("--out", arguments->out,
                      "Write number, joint values and state of each: .json or .csv");
  command->add_option("--picture", arguments->picture, "Draw it as a PNG, for grids of two joints");
  command->add_option("--max-time", arguments->max_time,
                      "How long the server may work, e.g. 20ms; what is not done is unknown");
  command
      ->add_option("--clearance", arguments->clearance_levels,
                   "Tell, too, which free configurations have more clearance than each of these "
                   "levels, in mask pixels, ascending: --clearance 1,2,4,8")
      ->delimiter(',');
  AddFormatOption(*command, session.format);
  AddPolicyOptions(*command, arguments->policy);
  AddVariantOption(*command, session);
  command->footer(
      "Example:\n  silhouette space --out space.csv --picture space.png\n"
      "  silhouette space --clearance 1,2,4,8 --picture clearance.png");
  command->callback([arguments, &session, &run] {
    run = [arguments, &session] { return FetchSpace(session, *arguments); };
  });
}

}  // namespace silhouette
