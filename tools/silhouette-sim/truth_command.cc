// SPDX-License-Identifier: Apache-2.0
// silhouette-sim truth
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "common/parallel/parallel.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-sim/commands.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {
namespace {

// Configurations whose truth is found, then written, before the next ones are looked at.
constexpr size_t kAtOnce = 512;

struct TruthArguments {
  WorkplaceArguments workplace;
  std::string out;
};

struct Summary {
  uint64_t configurations = 0;
  uint64_t occupied = 0;
};

std::vector<Contact> CheckAll(const Workplace& workplace, const ContactChecker& checker,
                              const std::vector<std::vector<double>>& positions) {
  std::vector<Contact> contacts(positions.size());
  ParallelFor(positions.size(), [&](size_t i) {
    contacts[i] = checker.Check(workplace.robot.LinkPoses(positions[i]), workplace.obstacle_poses);
  });
  return contacts;
}

std::string Header(const ConfigurationGrid& grid) {
  std::string header = "number";
  for (const GridJoint& joint : grid.joints()) absl::StrAppend(&header, ",", joint.name);
  return header + ",contact,distance\n";
}

std::string Row(ConfigurationNumber number, const Configuration& configuration,
                const Contact& contact) {
  std::string row = absl::StrCat(number);
  for (double value : configuration) absl::StrAppendFormat(&row, ",%.17g", value);
  absl::StrAppendFormat(&row, ",%d,%.6g\n", contact.touching ? 1 : 0, contact.distance);
  return row;
}

// Aborted if a stop was asked for.
absl::StatusOr<Summary> TruthWriteTruth(const Workplace& workplace, std::ostream& out) {
  const ConfigurationGrid& grid = workplace.cell.grid;
  const ContactChecker checker(workplace.robot, workplace.obstacles);
  Progress progress("Truth", grid.size(), "configurations");
  Summary summary;
  out << Header(grid);
  ConfigurationNumber number = 0;
  while (number < grid.number_limit()) {
    std::vector<ConfigurationNumber> numbers;
    std::vector<std::vector<double>> positions;
    for (; number < grid.number_limit() && numbers.size() < kAtOnce; ++number) {
      if (!grid.Contains(number)) continue;
      ASSIGN_OR_RETURN(const auto at, workplace.Positions(grid.At(number)));
      numbers.push_back(number);
      positions.push_back(at);
    }
    const std::vector<Contact> contacts = CheckAll(workplace, checker, positions);
    for (size_t i = 0; i < numbers.size(); ++i) {
      out << Row(numbers[i], grid.At(numbers[i]), contacts[i]);
      summary.occupied += contacts[i].touching ? 1 : 0;
    }
    summary.configurations += numbers.size();
    progress.Update(summary.configurations);
    if (StopRequested()) return absl::AbortedError("stopped; to have the truth, start it again");
  }
  return summary;
}

// The file appears under its name when it is whole. A device or pipe is written to as it is.
absl::StatusOr<Summary> WriteTruthFile(const Workplace& workplace, const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  const bool in_place = fs::exists(path, error) && !fs::is_regular_file(path, error);
  const std::string written = in_place ? path : path + ".unfinished";
  std::ofstream out(written);
  if (!out) return absl::FailedPreconditionError("the file '" + path + "' cannot be written");
  absl::StatusOr<Summary> summary = TruthWriteTruth(workplace, out);
  out.close();
  if (summary.ok() && !out) {
    summary = absl::ResourceExhaustedError("cannot write all of '" + path + "'; is the disk full?");
  }
  if (in_place) return summary;
  if (summary.ok()) fs::rename(written, path, error);
  if (summary.ok() && error) {
    summary = absl::InternalError("cannot write '" + path + "': " + error.message());
  }
  if (!summary.ok()) fs::remove(written, error);
  return summary;
}

absl::StatusOr<ExitCode> RunTruth(const TruthArguments& arguments) {
  ASSIGN_OR_RETURN(const Workplace workplace, LoadWorkplace(arguments.workplace));
  CatchStopSignals();
  const absl::Time start = absl::Now();
  ASSIGN_OR_RETURN(const Summary summary, WriteTruthFile(workplace, arguments.out));
  if (arguments.workplace.json()) {
    std::cout << nlohmann::ordered_json{{"configurations", summary.configurations},
                                        {"occupied", summary.occupied},
                                        {"seconds", absl::ToDoubleSeconds(absl::Now() - start)},
                                        {"truth", arguments.out}}
                     .dump(2)
              << '\n';
  } else {
    std::cout << summary.occupied << " of " << summary.configurations
              << " configurations touch an obstacle; wrote " << arguments.out << '\n';
  }
  return kDone;
}

}  // namespace

void AddTruthCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "truth", "Write contact and distance of every configuration of the grid as CSV");
  auto arguments = std::make_shared<TruthArguments>();
  AddWorkplaceOptions(*command, arguments->workplace, true);
  command
      ->add_option("--out", arguments->out,
                   "The file to write: number, joint values, contact (0 or 1), distance in metres")
      ->required();
  command->callback([arguments, &run] { run = [arguments] { return RunTruth(*arguments); }; });
}

}  // namespace silhouette
