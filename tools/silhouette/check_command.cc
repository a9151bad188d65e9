// SPDX-License-Identifier: Apache-2.0
// silhouette check, path, explain
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "db/status/status_macros.h"
#include "silhouette/v1/database_service.pb.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/inputs.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/formats/pictures.h"

namespace silhouette {
namespace {

struct CheckArguments {
  std::vector<std::string> configurations;
  std::string file;
  int repeat = 0;
  bool stream = false;
};

absl::StatusOr<std::vector<Configuration>> ConfigurationsOf(const CheckArguments& arguments,
                                                            TypedJoints& joints) {
  std::vector<Configuration> configurations;
  for (const std::string& text : arguments.configurations) {
    ASSIGN_OR_RETURN(Configuration configuration, joints.Parse(text));
    configurations.push_back(std::move(configuration));
  }
  if (!arguments.file.empty()) {
    ASSIGN_OR_RETURN(const auto read, ReadConfigurations(arguments.file, joints));
    configurations.insert(configurations.end(), read.begin(), read.end());
  }
  if (configurations.empty()) {
    return absl::InvalidArgumentError("give a configuration, e.g. 0.1,-30deg, or --file FILE");
  }
  return configurations;
}

// How long each of the checks of --repeat took, in microseconds, sorted; fewer after Ctrl-C.
absl::StatusOr<std::vector<double>> Measure(const std::function<absl::Status()>& ask, int repeat) {
  std::vector<double> times;
  for (int i = 0; i < repeat && !StopRequested(); ++i) {
    const auto start = std::chrono::steady_clock::now();
    RETURN_IF_ERROR(ask());
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

// `typed`: the first of the configurations, as they stand on the command line.
std::string CheckTextOf(const Session& session, TypedJoints& joints,
                        const std::vector<std::string>& typed,
                        const std::vector<Configuration>& configurations,
                        const client::ConfigurationChecks& checks,
                        const std::vector<double>& times) {
  std::string text;
  for (size_t i = 0; i < configurations.size(); ++i) {
    absl::StrAppend(&text, i < typed.size() ? joints.Spoken(typed[i]) : Spoken(configurations[i]),
                    ": ", Spoken(checks.verdicts[i], checks.basis),
                    UnitHint(session, joints, {configurations[i]}), "\n");
  }
  absl::StrAppend(&text, Spoken(checks.basis), "\n");
  if (times.empty()) return text;
  return absl::StrCat(text, times.size(), " checks: p50 ", Microseconds(Quantile(times, 0.5)),
                      ", p99 ", Microseconds(Quantile(times, 0.99)), "\n");
}

Json CheckJsonOf(const std::vector<Configuration>& configurations,
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
  return json;
}

// Lines of standard input; a read that waits ends with Ctrl-C, or once `ended` is true.
class InputLines {
 public:
  explicit InputLines(const std::atomic<bool>& ended) : ended_(ended) {}

  // Nothing at the end.
  std::optional<std::string> Next() {
    while (true) {
      const size_t end = buffer_.find('\n');
      if (end != std::string::npos) {
        std::string line = buffer_.substr(0, end);
        buffer_.erase(0, end + 1);
        return line;
      }
      if (!Fill()) break;
    }
    if (buffer_.empty() || StopRequested() || ended_) return std::nullopt;
    return std::exchange(buffer_, "");
  }

 private:
  bool Fill() {
    while (!StopRequested() && !ended_) {
      pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
      if (poll(&input, 1, /*milliseconds=*/50) <= 0) continue;
      char bytes[4096];
      const ssize_t count = read(STDIN_FILENO, bytes, sizeof bytes);
      if (count <= 0) return false;
      buffer_.append(bytes, static_cast<size_t>(count));
      return true;
    }
    return false;
  }

  const std::atomic<bool>& ended_;
  std::string buffer_;
};

// What was asked and is not answered yet, by the number of its line.
class Asked {
 public:
  void Add(uint64_t line, const Configuration& q) {
    const std::lock_guard lock(mutex_);
    lines_.emplace(line, q);
  }
  Configuration Take(uint64_t line) {
    const std::lock_guard lock(mutex_);
    return lines_.extract(line).mapped();
  }

 private:
  std::mutex mutex_;
  std::map<uint64_t, Configuration> lines_;
};

// How the answers turned out.
struct CheckLinesOutcome {
  uint64_t answers = 0;
  bool all_free = true;
  absl::Status status;  // why they ended, if before the last one
  std::atomic<bool> ended = false;
};

void PrintAnswers(const Session& session, client::CheckStream& stream, Asked& asked,
                  CheckLinesOutcome& outcome) {
  while (true) {
    const absl::StatusOr<client::StreamedAnswer> answer = stream.Receive();
    outcome.status = answer.ok() ? answer->checks.status() : answer.status();
    if (absl::IsOutOfRange(answer.status())) outcome.status = absl::OkStatus();
    if (!answer.ok()) return;
    if (!outcome.status.ok()) {
      outcome.status = absl::Status(outcome.status.code(),
                                    absl::StrCat("-:", answer->id, ": ", outcome.status.message()));
      stream.Cancel();
      return;
    }
    const Configuration q = asked.Take(answer->id);
    const client::Verdict& verdict = answer->checks->verdicts[0];
    ++outcome.answers;
    outcome.all_free = outcome.all_free && verdict.free();
    if (session.json()) {
      Json line{{"line", answer->id}, {"configuration", q}};
      line.update(JsonOf(answer->checks->basis));
      line.update(JsonOf(verdict, session.clearance));
      std::cout << line.dump() << std::endl;
    } else {
      std::cout << Spoken(q) << ": " << Spoken(verdict, answer->checks->basis) << std::endl;
    }
  }
}

// Asks about all lines. Returns the mistake in a line that ended it early; an error of the stream
// is returned by its answers.
absl::Status CheckLinesAsk(const Session& session, TypedJoints& joints, client::CheckStream& stream,
                           Asked& asked, const std::atomic<bool>& answers_ended) {
  InputLines input(answers_ended);
  uint64_t number = 0;
  while (const std::optional<std::string> line = input.Next()) {
    ++number;
    const std::vector<std::string> values = ValuesOnLine(*line);
    if (values.empty()) continue;
    ASSIGN_OR_RETURN(const Configuration q, joints.Parse(values, absl::StrCat("-:", number, ": ")));
    asked.Add(number, q);
    absl::Status sent;
    do {
      sent =
          stream.Send(number, {q}, session.policy, client::Evidence::kPerView, session.clearance);
      // The answers are being printed.
      if (absl::IsResourceExhausted(sent))
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    } while (absl::IsResourceExhausted(sent) && !answers_ended && !StopRequested());
    if (!sent.ok()) break;
  }
  return absl::OkStatus();
}

// --stream: configurations from standard input, answered one by one as they come. One line of
// output for each line with a configuration, in their order. kDone if all are free, and there is
// one; kStopped after Ctrl-C. Ends with the first line that is no configuration.
absl::StatusOr<ExitCode> CheckLines(const Session& session) {
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  CatchStopSignals();
  TypedJoints joints(session.unit, [&] { return client.GetDatabase(); });
  client::CheckStream stream = client.StreamChecks();
  Asked asked;
  CheckLinesOutcome outcome;
  std::jthread printer([&] {
    PrintAnswers(session, stream, asked, outcome);
    outcome.ended = true;
  });
  std::jthread stopper([&] {
    while (!outcome.ended && !StopRequested()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    if (StopRequested()) stream.Cancel();
  });
  const absl::Status mistake = CheckLinesAsk(session, joints, stream, asked, outcome.ended);
  stream.EndQuestions();
  printer.join();
  // There may be lines that were not checked.
  if (StopRequested()) return kStopped;
  RETURN_IF_ERROR(outcome.status);
  RETURN_IF_ERROR(mistake);
  if (outcome.answers == 0) {
    return absl::InvalidArgumentError(
        "standard input has no configuration; give one on each line, as the program before the "
        "pipe should");
  }
  return outcome.all_free ? kDone : kNo;
}

absl::StatusOr<ExitCode> Check(const Session& session, const CheckArguments& arguments) {
  if (arguments.stream) return CheckLines(session);
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  TypedJoints joints(session.unit, [&] { return client.GetDatabase(); });
  ASSIGN_OR_RETURN(const auto configurations, ConfigurationsOf(arguments, joints));
  client::ConfigurationChecks checks;
  const auto ask = [&] {
    ASSIGN_OR_RETURN(checks,
                     client.CheckConfigurations(configurations, session.policy,
                                                client::Evidence::kPerView, session.clearance));
    return absl::OkStatus();
  };
  RETURN_IF_ERROR(ask());
  CatchStopSignals();
  ASSIGN_OR_RETURN(const auto times, Measure(ask, arguments.repeat));
  PrintResult(
      session.format, CheckJsonOf(configurations, checks, session.clearance, times),
      CheckTextOf(session, joints, arguments.configurations, configurations, checks, times));
  return checks.AllFree() ? kDone : kNo;
}

struct CheckPathArguments {
  PathArguments path;
  std::optional<double> resolution;
};

absl::StatusOr<ExitCode> CheckPath(const Session& session, const CheckPathArguments& arguments) {
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto waypoints,
                   WaypointsOf(session, arguments.path, [&] { return client.GetDatabase(); }));
  ASSIGN_OR_RETURN(const auto check,
                   client.CheckPath(waypoints, session.policy, session.clearance,
                                    arguments.resolution, SeparationOf(arguments.path)));
  PrintResult(session.format, JsonOf(check, session.clearance), TextOf(check));
  return check.verdict.free() ? kDone : kNo;
}

struct ExplainArguments {
  std::string configuration;
  std::string out;
  std::string images;
};

// What is asked about, when, and by which policy.
absl::StatusOr<ExplanationNotes> NotesOf(const Session& session, const ExplainArguments& arguments,
                                         const std::string& configuration, const std::string& hint,
                                         const client::Explanation& explanation,
                                         const v1::GetDatabaseResponse& database) {
  ExplanationNotes notes;
  std::string joints;
  for (const v1::GridJoint& joint : database.grid().joints()) {
    absl::StrAppend(&joints, joints.empty() ? "" : ", ", joint.name());
  }
  const std::string preset =
      session.policy.preset.empty() ? database.default_policy().preset() : session.policy.preset;
  const client::Basis& basis = explanation.basis;
  notes.lines = {absl::StrCat("Configuration: ", configuration, " (", joints, ")"),
                 Spoken(explanation.verdict, basis) + hint, Spoken(basis)};
  if (basis.scene_id != 0) notes.lines.push_back("Images taken: " + Spoken(basis.scene_time));
  notes.lines.push_back(absl::StrCat("Cell '", database.cell_name(), "', preset ", preset));
  for (const v1::View& view : database.views()) {
    notes.shapes[view.name()] =
        static_cast<double>(view.image_height()) / std::max(1, view.image_width());
  }
  if (arguments.images.empty()) return notes;
  notes.lines.push_back(absl::StrCat("Camera images: from '", arguments.images, "'"));
  ASSIGN_OR_RETURN(const ImagesFolder folder, ReadImagesFolder(arguments.images));
  for (const ImageFile& image : folder.images) notes.cameras[image.view] = image.path;
  return notes;
}

absl::StatusOr<ExitCode> Explain(const Session& session, const ExplainArguments& arguments) {
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  TypedJoints joints(session.unit, [&] { return client.GetDatabase(); });
  ASSIGN_OR_RETURN(const Configuration configuration, joints.Parse(arguments.configuration));
  ASSIGN_OR_RETURN(const auto explanation, client.Explain(configuration, session.policy));
  const std::string typed = joints.Spoken(arguments.configuration);
  const std::string hint = UnitHint(session, joints, {configuration});
  if (!arguments.out.empty()) {
    ASSIGN_OR_RETURN(const v1::GetDatabaseResponse database, client.GetDatabase());
    ASSIGN_OR_RETURN(const ExplanationNotes notes,
                     NotesOf(session, arguments, typed, hint, explanation, database));
    RETURN_IF_ERROR(WriteExplanation(explanation, notes, arguments.out));
  }
  PrintResult(session.format, JsonOf(configuration, explanation), TextOf(typed, hint, explanation));
  return explanation.verdict.free() ? kDone : kNo;
}

}  // namespace

void AddCheckCommand(CLI::App& program, Session& session) {
  CLI::App* command = program.add_subcommand("check", "Report whether configurations are free");
  auto arguments = std::make_shared<CheckArguments>();
  command->add_option("configurations", arguments->configurations,
                      "Joint values with commas between them: radians, or 30deg, or 0.2m");
  command->add_option("--file", arguments->file, "Read them from a file, one a line; -: stdin");
  AddDegreesFlag(*command, session);
  AddClearanceFlag(*command, session);
  command
      ->add_option("--repeat", arguments->repeat,
                   "Repeat the request this many times and report the latency")
      ->check(PositiveNumber());
  command
      ->add_flag("--stream", arguments->stream,
                 "Read them from stdin, one a line, and answer each at once, over one call")
      ->excludes("configurations", "--file", "--repeat");
  AddVerdictOptions(*command, session);
  command->footer(
      "Exit code 0 if all are free, 1 if not. With --stream a line for each, with --format json\n"
      "an object on each, and exit code 130 after Ctrl-C.\n\n"
      "Example:\n"
      "  silhouette check 0.1,0.2 30deg,-10deg --clearance\n"
      "  silhouette check --degrees 30,-10 --repeat 1000 --format json\n"
      "  my-planner | silhouette check --stream");
  Runs(*command, session, Check, arguments);
}

void AddPathCommand(CLI::App& program, Session& session) {
  CLI::App* command = program.add_subcommand(
      "path", "Report whether a path is free, or the first place where it is not");
  auto arguments = std::make_shared<CheckPathArguments>();
  AddPathArguments(*command, session, arguments->path);
  AddResolutionOption(*command, arguments->resolution);
  AddSeparationOptions(*command, arguments->path);
  AddClearanceFlag(*command, session);
  AddVerdictOptions(*command, session);
  command->footer(
      "Between waypoints the path is straight; on a continuous joint go on beyond the turn.\n"
      "Exit code 0 if the path is free, 1 if not.\n\n"
      "Example:\n"
      "  silhouette path 0.1,0.2 0.5,0.2 0.5,-30deg\n"
      "  silhouette path --file path.json --clearance\n"
      "  silhouette path --file path.json --separation --horizon 0.5\n"
      "  silhouette path 0,0,0,0,0,0 0.5,0,0,0,0,0 --resolution 0.001");
  Runs(*command, session, CheckPath, arguments);
}

void AddExplainCommand(CLI::App& program, Session& session) {
  CLI::App* command =
      program.add_subcommand("explain", "Report why a configuration is free or not, view by view");
  auto arguments = std::make_shared<ExplainArguments>();
  command
      ->add_option("configuration", arguments->configuration,
                   "Joint values with commas between them")
      ->required();
  AddDegreesFlag(*command, session);
  command->add_option("--out", arguments->out,
                      "Write the images of every view into this folder: VIEW_scene.png and so on, "
                      "and explanation.png with all of them");
  command
      ->add_option("--images", arguments->images,
                   "A folder with images.json: its camera images come into explanation.png too")
      ->needs("--out");
  AddVerdictOptions(*command, session);
  command->footer(
      "Exit code 0 if the configuration is free, 1 if not.\n\n"
      "Example:\n"
      "  silhouette explain 30deg,-10deg --out why\n"
      "  silhouette explain 30deg,-10deg --out why --images images");
  Runs(*command, session, Explain, arguments);
}

}  // namespace silhouette
