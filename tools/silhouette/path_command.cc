// SPDX-License-Identifier: Apache-2.0
// silhouette path
#include <memory>

#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/inputs.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/options.h"

namespace silhouette {
namespace {

struct PathCommandArguments {
  PathArguments path;
  PolicyOptions policy;
  client::Clearance clearance = client::Clearance::kOmit;
};

absl::StatusOr<ExitCode> CheckPath(const Session& session, const PathCommandArguments& arguments) {
  ASSIGN_OR_RETURN(const auto waypoints, WaypointsOf(arguments.path));
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto check,
                   client.CheckPath(waypoints, arguments.policy.policy(), arguments.clearance));
  PrintResult(session.format, JsonOf(check, arguments.clearance), TextOf(check));
  return check.verdict.free() ? kDone : kNo;
}

}  // namespace

void AddPathCommand(CLI::App& program, Session& session, Run& run) {
  CLI::App* command = program.add_subcommand(
      "path", "Report whether a path is free, or the first place where it is not");
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
  Runs(*command, session, run, arguments, CheckPath);
}

}  // namespace silhouette
