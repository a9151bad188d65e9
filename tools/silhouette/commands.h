// SPDX-License-Identifier: Apache-2.0
// The subcommands of `silhouette`, and the options that several of them share.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "silhouette/client.h"
#include "tools/program/joint_values.h"
#include "tools/program/program.h"
#include "tools/silhouette/formats/typed_joints.h"

namespace silhouette {

// What the shared options say, and what the chosen subcommand does.
struct Session {
  std::string server = client::kDefaultAddress;
  client::ClientTls tls;
  double timeout = 10;  // seconds for each call
  std::string format = "text";
  std::string variant;  // of robot images; empty: none is named
  client::Policy policy;
  client::Clearance clearance = client::Clearance::kOmit;
  AngleUnit unit = AngleUnit::kRadians;  // of joint values without one
  std::function<absl::StatusOr<ExitCode>()> run;

  bool json() const { return format == "json"; }
  absl::StatusOr<Client> Connect() const;
};

// --server, --tls-ca, --tls-certificate and --tls-key (or the environment's SILHOUETTE_SERVER,
// SILHOUETTE_TLS_CA and so on), and --timeout.
void AddServerOptions(CLI::App& program, Session& session);

// Of a subcommand that asks for verdicts: --format, --preset, --min-views, --max-occluded-views,
// --off-grid, --variant.
void AddVerdictOptions(CLI::App& command, Session& session);

// --clearance: it is measured.
void AddClearanceFlag(CLI::App& command, Session& session);

// --degrees. `what`: the values that it is for.
void AddDegreesFlag(CLI::App& command, Session& session, const std::string& what = "Values");

// What to add to the verdicts on configurations: whether degrees are meant by more than two turns.
std::string UnitHint(const Session& session, TypedJoints& joints,
                     const std::vector<Configuration>& configurations);

// --resolution, of CheckPath, metres.
void AddResolutionOption(CLI::App& command, std::optional<double>& resolution);

// A time above 0, as ParseTime takes it.
CLI::Option* AddTimeOption(CLI::App& command, const std::string& name,
                           std::optional<absl::Duration>& time, const std::string& what);

// A path on the command line: waypoints, or --file; --degrees.
struct PathArguments {
  std::vector<std::string> waypoints;
  std::string file;
  bool separation = false;
  std::optional<double> horizon;  // metres
};
void AddPathArguments(CLI::App& command, Session& session, PathArguments& arguments);
// --separation and --horizon.
void AddSeparationOptions(CLI::App& command, PathArguments& arguments);
// Nothing if it is not asked for.
std::optional<client::SeparationPolicy> SeparationOf(const PathArguments& arguments);
// InvalidArgument if there is none, or both, or if the file says that its path is of other joints
// than the database's, which is asked for only then and where the unit of a value matters.
absl::StatusOr<std::vector<Configuration>> WaypointsOf(
    const Session& session, const PathArguments& arguments,
    const std::function<absl::StatusOr<v1::GetDatabaseResponse>()>& database);

// When `command` is chosen, session.run calls `action` with the session and the arguments that the
// command has read, if it has any.
template <typename... Arguments>
void Runs(CLI::App& command, Session& session,
          absl::StatusOr<ExitCode> (*action)(const Session&, const Arguments&...),
          std::shared_ptr<Arguments>... arguments) {
  command.callback(
      [=, &session] { session.run = [=, &session] { return action(session, *arguments...); }; });
}

// Each adds itself to the program.
void AddCheckCommand(CLI::App& program, Session& session);
void AddPathCommand(CLI::App& program, Session& session);
void AddExplainCommand(CLI::App& program, Session& session);
void AddSpaceCommand(CLI::App& program, Session& session);
void AddWatchCommand(CLI::App& program, Session& session);
void AddPlanCommand(CLI::App& program, Session& session);
void AddReplayCommand(CLI::App& program, Session& session);
void AddRegionCommands(CLI::App& program, Session& session);
void AddSceneCommands(CLI::App& program, Session& session);

}  // namespace silhouette
