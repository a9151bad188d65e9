// silhouette check
#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <iostream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"
#include "silhouette/shared_space.h"
#include "tools/silhouette/check_lines.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/configuration_text.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/options.h"

namespace silhouette {
namespace {

struct CheckArguments {
  std::vector<std::string> configurations;
  std::string file;
  bool degrees = false;
  PolicyOptions policy;
  client::Clearance clearance = client::Clearance::kOmit;
  int repeat = 0;
  bool stream = false;
  std::string shared_map;  // empty: the server is asked

  AngleUnit unit() const { return degrees ? AngleUnit::kDegrees : AngleUnit::kRadians; }
};

using CheckAsk = std::function<absl::StatusOr<client::ConfigurationChecks>()>;

absl::StatusOr<std::vector<Configuration>> ConfigurationsOf(const CheckArguments& arguments) {
  const AngleUnit unit = arguments.unit();
  std::vector<Configuration> configurations;
  for (const std::string& text : arguments.configurations) {
    configurations.push_back(ParseConfiguration(text, unit));
  }
  if (!arguments.file.empty()) {
    ASSIGN_OR_RETURN(const auto read, ReadConfigurations(arguments.file, unit));
    configurations.insert(configurations.end(), read.begin(), read.end());
  }
  if (configurations.empty()) {
    return absl::InvalidArgumentError("give a configuration, e.g. 0.1,-30deg, or --file FILE");
  }
  return configurations;
}

// Checks in the way that the arguments say.
absl::StatusOr<CheckAsk> AskOf(const Session& session, const CheckArguments& arguments,
                               const std::vector<Configuration>& configurations) {
  if (arguments.shared_map.empty()) {
    const absl::StatusOr<Client> client = session.Connect();
    if (!client.ok()) return client.status();
    return [client = *client, policy = arguments.policy.policy(), clearance = arguments.clearance,
            &configurations] {
      return client.CheckConfigurations(configurations, policy, client::Evidence::kPerView,
                                        clearance);
    };
  }
  if (arguments.policy.given() || arguments.clearance == client::Clearance::kMeasure ||
      !session.variant.empty()) {
    return absl::InvalidArgumentError(
        "--shared-map has verdicts under the server's policy and with the scene's variant, and no "
        "clearances: leave out the options of the policy, --variant and --clearance, or ask the "
        "server");
  }
  const auto space = client::SharedSpace::Open(arguments.shared_map);
  if (!space.ok()) return space.status();
  const auto dimensions = static_cast<size_t>(space->grid().dimensions());
  for (const Configuration& q : configurations) {
    if (q.size() == dimensions) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "a configuration has ", q.size(), " values, and the grid has ", dimensions, " joints"));
  }
  return [space = *space, &configurations]() -> absl::StatusOr<client::ConfigurationChecks> {
    return space.CheckConfigurations(configurations);
  };
}

// How long each of the checks of --repeat took, in microseconds, sorted; fewer after Ctrl-C.
absl::StatusOr<std::vector<double>> Measure(const CheckAsk& ask, int repeat) {
  std::vector<double> times;
  for (int i = 0; i < repeat && !StopRequested(); ++i) {
    const auto start = std::chrono::steady_clock::now();
    RETURN_IF_ERROR(ask().status());
    times.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start)
            .count());
  }
  std::sort(times.begin(), times.end());
  return times;
}

std::string Microseconds(double time) {
  return time < 100 ? absl::StrFormat("%.2f us", time) : absl::StrFormat("%.0f us", time);
}

// The least of the sorted times that at least this share of them does not exceed.
double Quantile(const std::vector<double>& times, double share) {
  const double rank = std::ceil(share * static_cast<double>(times.size()));
  return times.at(static_cast<size_t>(std::max(rank, 1.0)) - 1);
}

void CheckPrintText(const std::vector<Configuration>& configurations,
                    const client::ConfigurationChecks& checks, const std::vector<double>& times) {
  for (size_t i = 0; i < configurations.size(); ++i) {
    std::cout << Spoken(configurations[i]) << ": " << Spoken(checks.verdicts[i]) << '\n';
  }
  std::cout << Spoken(checks.basis) << '\n';
  if (times.empty()) return;
  std::cout << absl::StrFormat("%d checks: p50 %s, p99 %s\n", times.size(),
                               Microseconds(Quantile(times, 0.5)),
                               Microseconds(Quantile(times, 0.99)));
}

void CheckPrintJson(const std::vector<Configuration>& configurations,
                    const client::ConfigurationChecks& checks, client::Clearance clearance,
                    const std::vector<double>& times) {
  Json json = JsonOf(checks.basis);
  json["all_free"] = checks.AllFree();
  json["configurations"] = Json::array();
  for (size_t i = 0; i < configurations.size(); ++i) {
    Json entry{{"configuration", configurations[i]}};
    entry.update(JsonOf(checks.verdicts[i], clearance));
    json["configurations"].push_back(entry);
  }
  if (!times.empty()) {
    json["checks"] = times.size();
    json["check_p50_us"] = Quantile(times, 0.5);
    json["check_p99_us"] = Quantile(times, 0.99);
  }
  Print(json);
}

absl::StatusOr<ExitCode> Check(const Session& session, const CheckArguments& arguments) {
  if (arguments.stream) {
    return CheckLines(session, arguments.unit(), arguments.policy.policy(), arguments.clearance);
  }
  ASSIGN_OR_RETURN(const auto configurations, ConfigurationsOf(arguments));
  ASSIGN_OR_RETURN(const CheckAsk ask, AskOf(session, arguments, configurations));
  ASSIGN_OR_RETURN(const auto checks, (ask)());
  CatchStopSignals();
  ASSIGN_OR_RETURN(const auto times, Measure(ask, arguments.repeat));
  if (session.json()) {
    CheckPrintJson(configurations, checks, arguments.clearance, times);
  } else {
    CheckPrintText(configurations, checks, times);
  }
  return checks.AllFree() ? kDone : kNo;
}

}  // namespace

void AddCheckCommand(CLI::App& program, Session& session, Run& run) {
  CLI::App* command = program.add_subcommand("check", "Tell whether configurations are free");
  auto arguments = std::make_shared<CheckArguments>();
  command->add_option("configurations", arguments->configurations,
                      "Joint values with commas between them: radians, or 30deg, or 0.2m");
  command->add_option("--file", arguments->file, "Read them from a file, one a line; -: stdin");
  command->add_flag("--degrees", arguments->degrees, "Values without a unit are degrees");
  AddClearanceFlag(*command, arguments->clearance);
  command
      ->add_option("--repeat", arguments->repeat,
                   "Ask this many times more and tell how long an answer takes")
      ->check(CLI::NonNegativeNumber);
  command
      ->add_flag("--stream", arguments->stream,
                 "Read them from stdin, one a line, and answer each at once, over one call")
      ->excludes("configurations", "--file", "--repeat");
  command
      ->add_option("--shared-map", arguments->shared_map,
                   "Look into the shared map of a server on this machine instead of asking it")
      ->excludes("--stream");
  AddFormatOption(*command, session.format);
  AddPolicyOptions(*command, arguments->policy);
  AddVariantOption(*command, session);
  command->footer(
      "Exit code 0 if all are free, 1 if not. With --stream a line for each, with --format json\n"
      "an object on each.\n\n"
      "Example:\n"
      "  silhouette check 0.1,0.2 30deg,-10deg --clearance\n"
      "  silhouette check --degrees 30,-10 --repeat 1000 --format json\n"
      "  my-planner | silhouette check --stream\n"
      "  silhouette check 0.1,0.2 --shared-map /dev/shm/silhouette-cell");
  command->callback([arguments, &session, &run] {
    run = [arguments, &session] { return Check(session, *arguments); };
  });
}

}  // namespace silhouette
