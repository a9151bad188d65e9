// silhouette path
#include <iostream>
#include <memory>

#include "absl/strings/str_format.h"
#include "clients/program/commands.h"
#include "clients/program/configuration_text.h"
#include "clients/program/output.h"
#include "clients/program/policy_options.h"

namespace silhouette {
namespace {

struct Arguments {
  std::vector<std::string> waypoints;
  std::string file;
  bool degrees = false;
  PolicyOptions policy;
  client::Clearance clearance = client::Clearance::kOmit;
};

absl::StatusOr<std::vector<Configuration>> WaypointsOf(const Arguments& arguments) {
  if (arguments.waypoints.empty() == arguments.file.empty()) {
    return absl::InvalidArgumentError(
        "give waypoints, e.g. 0.1,0.2 0.3,0.2, or a path with --file FILE, and not both");
  }
  if (!arguments.file.empty()) return ReadWaypoints(arguments.file);
  std::vector<Configuration> waypoints;
  for (const std::string& text : arguments.waypoints) {
    waypoints.push_back(
        ParseConfiguration(text, arguments.degrees ? AngleUnit::kDegrees : AngleUnit::kRadians));
  }
  return waypoints;
}

void PrintText(const client::PathCheck& check) {
  if (check.verdict.free()) {
    std::cout << Spoken(check.verdict) << ": " << check.checked << " places checked\n";
  } else {
    std::cout << absl::StrFormat("not free at %s, %.0f %% on the way from waypoint %d: %s\n",
                                 Spoken(check.configuration), 100 * check.fraction, check.segment,
                                 Spoken(check.verdict));
  }
  if (check.narrowest) {
    std::cout << absl::StrFormat("narrowest at %s, %.0f %% on the way from waypoint %d\n",
                                 Spoken(check.narrowest->configuration),
                                 100 * check.narrowest->fraction, check.narrowest->segment);
  }
  std::cout << Spoken(check.basis) << '\n';
}

void PrintJson(const client::PathCheck& check, client::Clearance clearance) {
  Json json = JsonOf(check.basis);
  json.update(JsonOf(check.verdict, clearance));
  json["checked"] = check.checked;
  if (!check.verdict.free()) {
    json["segment"] = check.segment;
    json["fraction"] = check.fraction;
    json["configuration"] = check.configuration;
  }
  if (check.narrowest) {
    json["narrowest"] = {{"segment", check.narrowest->segment},
                         {"fraction", check.narrowest->fraction},
                         {"configuration", check.narrowest->configuration}};
  }
  Print(json);
}

absl::StatusOr<ExitCode> CheckPath(const Session& session, const Arguments& arguments) {
  const auto waypoints = WaypointsOf(arguments);
  if (!waypoints.ok()) return waypoints.status();
  const absl::StatusOr<Client> client = session.Connect();
  if (!client.ok()) return client.status();
  const auto check = client->CheckPath(*waypoints, arguments.policy.policy(), arguments.clearance);
  if (!check.ok()) return check.status();
  session.json() ? PrintJson(*check, arguments.clearance) : PrintText(*check);
  return check->verdict.free() ? kDone : kNo;
}

}  // namespace

void AddPathCommand(CLI::App& program, Session& session, Run& run) {
  CLI::App* command =
      program.add_subcommand("path", "Tell whether a path is free, or where it is not first");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("waypoints", arguments->waypoints,
                      "Configurations: joint values with commas between them");
  command->add_option("--file", arguments->file,
                      "A JSON file with configurations under the key \"waypoints\", as plan writes "
                      "it; -: stdin");
  command->add_flag("--degrees", arguments->degrees, "Values without a unit are degrees");
  AddClearanceFlag(*command, arguments->clearance);
  AddFormatOption(*command, session.format);
  AddPolicyOptions(*command, arguments->policy);
  command->footer(
      "Between waypoints the path is straight; on a continuous joint go on beyond the turn.\n"
      "Exit code 0 if the path is free, 1 if not.\n\n"
      "Example:\n"
      "  silhouette path 0.1,0.2 0.5,0.2 0.5,-30deg\n"
      "  silhouette path --file path.json --clearance");
  command->callback([arguments, &session, &run] {
    run = [arguments, &session] { return CheckPath(session, *arguments); };
  });
}

}  // namespace silhouette
