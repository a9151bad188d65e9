// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/commands.h"

#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "silhouette/v1/database_service.pb.h"
#include "tools/program/lengths.h"
#include "tools/silhouette/formats/inputs.h"

namespace silhouette {

absl::StatusOr<Client> Session::Connect() const {
  ASSIGN_OR_RETURN(const Client client, Client::Connect(server, absl::Seconds(timeout), tls));
  return client.WithVariant(variant);
}

void AddServerOptions(CLI::App& program, Session& session) {
  program
      .add_option("--server", session.server, "Address of silhouette-server: host:port, unix:path")
      ->envname("SILHOUETTE_SERVER")
      ->capture_default_str();
  program
      .add_option("--tls-ca", session.tls.ca,
                  "PEM file of the authority that signed the server's certificate. With it, "
                  "--tls-certificate and --tls-key the connection is encrypted")
      ->envname("SILHOUETTE_TLS_CA");
  program
      .add_option("--tls-certificate", session.tls.certificate,
                  "PEM file of this client's certificate, whose name has a role on the server")
      ->envname("SILHOUETTE_TLS_CERTIFICATE");
  program.add_option("--tls-key", session.tls.key, "PEM file of its private key")
      ->envname("SILHOUETTE_TLS_KEY");
  TakeTimes(
      program.add_option("--timeout", session.timeout, "Time that the server may take to answer"),
      0.001, 1e6)
      ->default_str("10 s");
}

void AddVerdictOptions(CLI::App& command, Session& session) {
  AddFormatOption(command, session.format);
  const std::string group = "How verdicts are made (default: as the server is set)";
  command
      .add_option("--preset", session.policy.preset,
                  "uncalibrated; paper: all views must agree; where the cell is calibrated also "
                  "calibrated, paper-calibrated; where its file has 'sound' also sound-planes, "
                  "sound")
      ->check([](const std::string& text) {
        return text.empty() ? "'' is no preset; leave the option out for the server's"
                            : std::string();
      })
      ->group(group);
  command
      .add_option("--min-views", session.policy.min_views,
                  "Occupied if at least this many views show an obstacle")
      ->group(group);
  command
      .add_option("--max-occluded-views", session.policy.max_occluded_views,
                  "In how many views the robot may hide an obstacle")
      ->group(group);
  command
      .add_option_function<std::string>(
          "--off-grid",
          [&session](const std::string& name) {
            session.policy.off_grid =
                name == "cell" ? client::OffGrid::kCell : client::OffGrid::kNearest;
          },
          "What stands for a configuration off the grid: cell or nearest")
      ->check(CLI::IsMember({"cell", "nearest"}))
      ->group(group);
  command.add_option("--variant", session.variant,
                     "The variant that is tested: with this tool, this part. Default: that of the "
                     "scene");
}

void AddClearanceFlag(CLI::App& command, Session& session) {
  command.add_flag_callback(
      "--clearance", [&session] { session.clearance = client::Clearance::kMeasure; },
      "Also report the clearance in mask pixels: how far the robot could grow in the images and "
      "still be free");
}

void AddDegreesFlag(CLI::App& command, Session& session, const std::string& what) {
  command.add_flag_callback(
      "--degrees", [&session] { session.unit = AngleUnit::kDegrees; },
      what + " without a unit are degrees, of joints that slide metres");
}

std::string UnitHint(const Session& session, TypedJoints& joints,
                     const std::vector<Configuration>& configurations) {
  std::string hint;
  for (const Configuration& q : configurations) {
    if (session.unit == AngleUnit::kDegrees || !hint.empty()) break;
    if (DegreesHint(q).empty()) continue;  // whatever slides
    hint = DegreesHint(q, ", or give --degrees", joints.Slides());
  }
  return hint;
}

void AddResolutionOption(CLI::App& command, std::optional<double>& resolution) {
  TakeLengths(command.add_option(
      "--resolution", resolution,
      "If robot images are drawn: sample the path in steps of this, in metres that some point of "
      "the robot moves, where it cannot be proven free; 0.0005 to 0.1 [0.005]"));
}

CLI::Option* AddTimeOption(CLI::App& command, const std::string& name,
                           std::optional<absl::Duration>& time, const std::string& what) {
  const auto parse = [](const std::string& text) {
    const std::optional<absl::Duration> parsed = ParseTime(text);
    return parsed > absl::ZeroDuration() ? parsed : std::nullopt;
  };
  return command
      .add_option_function<std::string>(
          name, [&time, parse](const std::string& text) { time = parse(text); }, what)
      ->check([parse](const std::string& text) {
        return parse(text) ? std::string()
                           : "'" + text + "' is not a time above 0; write " + kTimeExamples;
      })
      ->option_text("TIME");
}

void AddPathArguments(CLI::App& command, Session& session, PathArguments& arguments) {
  command.add_option("waypoints", arguments.waypoints,
                     "Configurations: joint values with commas between them");
  command.add_option("--file", arguments.file,
                     "A JSON file with configurations under the key \"waypoints\", as plan writes "
                     "it; -: stdin");
  AddDegreesFlag(command, session);
}

void AddSeparationOptions(CLI::App& command, PathArguments& arguments) {
  CLI::Option* separation = command.add_flag(
      "--separation", arguments.separation,
      "Also report how far people are, and how fast the robot may follow the path so that it "
      "stands before it touches one, by the cell file's section 'separation'");
  TakeLengths(
      command
          .add_option(
              "--horizon", arguments.horizon,
              "With --separation: only the beginning of the path, until some point of the robot "
              "has moved this far, in metres, and then until it stands")
          ->needs(separation)
          ->check(NumberFromZero()));
}

std::optional<client::SeparationPolicy> SeparationOf(const PathArguments& arguments) {
  if (!arguments.separation) return std::nullopt;
  return client::SeparationPolicy{.horizon = arguments.horizon};
}

absl::StatusOr<std::vector<Configuration>> WaypointsOf(
    const Session& session, const PathArguments& arguments,
    const std::function<absl::StatusOr<v1::GetDatabaseResponse>()>& database) {
  if (arguments.waypoints.empty() == arguments.file.empty()) {
    return absl::InvalidArgumentError(
        "give waypoints, e.g. 0.1,0.2 0.3,0.2, or a path with --file FILE, and not both");
  }
  if (!arguments.file.empty()) {
    if (session.unit == AngleUnit::kDegrees) {
      return absl::InvalidArgumentError(
          "--degrees does not go with a path's --file: its values are radians and metres");
    }
    ASSIGN_OR_RETURN(PathFile path, ReadPath(arguments.file));
    if (path.joints.empty()) return std::move(path.waypoints);
    ASSIGN_OR_RETURN(const v1::GetDatabaseResponse asked, database());
    std::vector<std::string> joints;
    for (const v1::GridJoint& joint : asked.grid().joints()) joints.push_back(joint.name());
    RETURN_IF_ERROR(RequireJoints(path, joints));
    return std::move(path.waypoints);
  }
  TypedJoints joints(session.unit, database);
  std::vector<Configuration> waypoints;
  for (const std::string& text : arguments.waypoints) {
    ASSIGN_OR_RETURN(Configuration waypoint, joints.Parse(text));
    waypoints.push_back(std::move(waypoint));
  }
  return waypoints;
}

}  // namespace silhouette
