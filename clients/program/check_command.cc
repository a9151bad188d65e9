// silhouette check
#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/program/check_lines.h"
#include "clients/program/commands.h"
#include "clients/program/configuration_text.h"
#include "clients/program/output.h"
#include "clients/program/policy_options.h"

namespace silhouette {
namespace {

struct Arguments {
  std::vector<std::string> configurations;
  std::string file;
  bool degrees = false;
  PolicyOptions policy;
  client::Clearance clearance = client::Clearance::kOmit;
  int repeat = 0;
  bool stream = false;

  AngleUnit unit() const { return degrees ? AngleUnit::kDegrees : AngleUnit::kRadians; }
};

absl::StatusOr<std::vector<Configuration>> ConfigurationsOf(const Arguments& arguments) {
  const AngleUnit unit = arguments.unit();
  std::vector<Configuration> configurations;
  for (const std::string& text : arguments.configurations) {
    configurations.push_back(ParseConfiguration(text, unit));
  }
  if (!arguments.file.empty()) {
    const auto read = ReadConfigurations(arguments.file, unit);
    if (!read.ok()) return read.status();
    configurations.insert(configurations.end(), read->begin(), read->end());
  }
  if (configurations.empty()) {
    return absl::InvalidArgumentError("give a configuration, e.g. 0.1,-30deg, or --file FILE");
  }
  return configurations;
}

// How long each of the checks of --repeat took, in microseconds, sorted; fewer after Ctrl-C.
absl::StatusOr<std::vector<double>> Measure(const Client& client,
                                            const std::vector<Configuration>& configurations,
                                            const Arguments& arguments) {
  const client::Policy policy = arguments.policy.policy();
  std::vector<double> times;
  for (int i = 0; i < arguments.repeat && !StopRequested(); ++i) {
    const auto start = std::chrono::steady_clock::now();
    const auto checks = client.CheckConfigurations(configurations, policy,
                                                   client::Evidence::kPerView, arguments.clearance);
    if (!checks.ok()) return checks.status();
    times.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start)
            .count());
  }
  std::sort(times.begin(), times.end());
  return times;
}

// The least of the sorted times that at least this share of them does not exceed.
double Quantile(const std::vector<double>& times, double share) {
  const double rank = std::ceil(share * static_cast<double>(times.size()));
  return times.at(static_cast<size_t>(std::max(rank, 1.0)) - 1);
}

void PrintText(const std::vector<Configuration>& configurations,
               const client::ConfigurationChecks& checks, const std::vector<double>& times) {
  for (size_t i = 0; i < configurations.size(); ++i) {
    std::cout << Spoken(configurations[i]) << ": " << Spoken(checks.verdicts[i]) << '\n';
  }
  std::cout << Spoken(checks.basis) << '\n';
  if (times.empty()) return;
  std::cout << absl::StrFormat("%d checks: p50 %.0f us, p99 %.0f us\n", times.size(),
                               Quantile(times, 0.5), Quantile(times, 0.99));
}

void PrintJson(const std::vector<Configuration>& configurations,
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

absl::StatusOr<ExitCode> Check(const Session& session, const Arguments& arguments) {
  if (arguments.stream) {
    return CheckLines(session, arguments.unit(), arguments.policy.policy(), arguments.clearance);
  }
  const auto configurations = ConfigurationsOf(arguments);
  if (!configurations.ok()) return configurations.status();
  const absl::StatusOr<Client> client = session.Connect();
  if (!client.ok()) return client.status();
  const auto checks = client->CheckConfigurations(*configurations, arguments.policy.policy(),
                                                  client::Evidence::kPerView, arguments.clearance);
  if (!checks.ok()) return checks.status();
  CatchStopSignals();
  const auto times = Measure(*client, *configurations, arguments);
  if (!times.ok()) return times.status();
  if (session.json()) {
    PrintJson(*configurations, *checks, arguments.clearance, *times);
  } else {
    PrintText(*configurations, *checks, *times);
  }
  return checks->AllFree() ? kDone : kNo;
}

}  // namespace

void AddCheckCommand(CLI::App& program, Session& session, Run& run) {
  CLI::App* command = program.add_subcommand("check", "Tell whether configurations are free");
  auto arguments = std::make_shared<Arguments>();
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
  AddFormatOption(*command, session.format);
  AddPolicyOptions(*command, arguments->policy);
  command->footer(
      "Exit code 0 if all are free, 1 if not. With --stream a line for each, with --format json "
      "an\n"
      "object on each.\n\n"
      "Example:\n"
      "  silhouette check 0.1,0.2 30deg,-10deg --clearance\n"
      "  silhouette check --degrees 30,-10 --repeat 1000 --format json\n"
      "  my-planner | silhouette check --stream");
  command->callback([arguments, &session, &run] {
    run = [arguments, &session] { return Check(session, *arguments); };
  });
}

}  // namespace silhouette
