// silhouette path
#include <iostream>
#include <memory>

#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/configuration_text.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/options.h"

namespace silhouette {
namespace {

struct PathCommandArguments {
  PathArguments path;
  PolicyOptions policy;
  client::Clearance clearance = client::Clearance::kOmit;
};

void PathPrintText(const client::PathCheck& check) {
  std::cout << Spoken(check) << '\n';
  if (check.narrowest) {
    std::cout << absl::StrFormat("narrowest at %s, %.0f %% on the way from waypoint %d\n",
                                 Spoken(check.narrowest->configuration),
                                 100 * check.narrowest->fraction, check.narrowest->segment);
  }
  std::cout << Spoken(check.basis) << '\n';
}

absl::StatusOr<ExitCode> CheckPath(const Session& session, const PathCommandArguments& arguments) {
  ASSIGN_OR_RETURN(const auto waypoints, WaypointsOf(arguments.path));
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto check,
                   client.CheckPath(waypoints, arguments.policy.policy(), arguments.clearance));
  session.json() ? Print(JsonOf(check, arguments.clearance)) : PathPrintText(check);
  return check.verdict.free() ? kDone : kNo;
}

}  // namespace

void AddPathCommand(CLI::App& program, Session& session, Run& run) {
  CLI::App* command =
      program.add_subcommand("path", "Tell whether a path is free, or where it is not first");
  auto arguments = std::make_shared<PathCommandArguments>();
  AddPathArguments(*command, arguments->path);
  AddClearanceFlag(*command, arguments->clearance);
  AddFormatOption(*command, session.format);
  AddPolicyOptions(*command, arguments->policy);
  AddVariantOption(*command, session);
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
