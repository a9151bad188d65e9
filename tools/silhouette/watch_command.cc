// SPDX-License-Identifier: Apache-2.0
// silhouette watch
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "silhouette/local_space.h"
#include "silhouette/path_watch.h"
#include "silhouette/v1/database_service.pb.h"
#include "tools/program/program.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/output.h"

namespace silhouette {
namespace {

// Between looks at Ctrl-C, and at what time alone changes.
constexpr absl::Duration kLook = absl::Milliseconds(50);
constexpr absl::Duration kBetweenAttempts = absl::Seconds(1);

struct WatchArguments {
  PathArguments path;
  std::optional<double> resolution;       // of a path
  std::optional<absl::Duration> max_age;  // nothing: the server's alone
  int count = 0;                          // 0: no end
  bool no_retry = false;
};

// What no server will answer, however often it is asked.
bool IsHopeless(const absl::Status& status) {
  return !status.ok() &&
         (ExitCodeOf(status) == kUserMistake || status.code() == absl::StatusCode::kUnimplemented);
}

// Prints lines as they come, and counts updates.
class Lines {
 public:
  Lines(bool json, int count) : json_(json), left_(count) {}

  void PrintUpdate(const std::string& text, const Json& json) {
    had_news_ = false;
    Print(text, json);
    if (left_ > 0 && --left_ == 0) enough_ = true;
  }

  // News of the connection, or of time: why nothing is known any more. Not twice the same.
  void PrintNews(client::Reason reason, const std::string& text, const Json& json) {
    if (std::exchange(had_news_, true) && last_news_ == reason) return;
    last_news_ = reason;
    Print(text, json);
  }

  // Whether all that was asked for is printed, the user has had enough, or nothing can be printed.
  bool End() const { return enough_ || StopRequested() || !std::cout; }

 private:
  void Print(const std::string& text, const Json& json) {
    std::cout << (json_ ? json.dump() : text) << std::endl;
  }

  const bool json_;
  int left_;
  bool enough_ = false;
  bool had_news_ = false;  // since the last update; the last was:
  client::Reason last_news_ = client::Reason::kUnspecified;
};

std::string Skipped(uint64_t scenes) {
  return scenes == 0 ? "" : absl::StrCat(", ", Counted(scenes, "scene"), " skipped");
}

// `reason`: why all is unknown now; `problem`: of the connection.
void PrintSpace(const client::SpaceSnapshot& snapshot, std::optional<client::Reason> reason,
                const absl::Status& problem, bool update, Lines& lines) {
  const client::StateCounts counts = snapshot.Count();
  std::string text = reason ? absl::StrCat("all unknown: ", Spoken(*reason, snapshot.basis()))
                            : absl::StrFormat("%d free, %d occupied, %d unknown", counts.free,
                                              counts.occupied, counts.unknown);
  if (!problem.ok()) absl::StrAppend(&text, " (", problem.message(), ")");
  if (update) {
    absl::StrAppend(&text, "; ", Counted(snapshot.tiles_changed(), "tile"), " changed",
                    Skipped(snapshot.skipped_scenes()));
  }
  Json json = JsonOf(snapshot.basis());
  json.update({{"unknown_reason", reason ? Json(NameOf(*reason)) : Json()},
               {"problem", problem.ok() ? Json() : Json(std::string(problem.message()))},
               {"free", counts.free},
               {"occupied", counts.occupied},
               {"unknown", counts.unknown},
               {"tiles_changed", update ? snapshot.tiles_changed() : 0},
               {"skipped_scenes", update ? snapshot.skipped_scenes() : 0}});
  const std::string line = absl::StrCat(Spoken(snapshot.basis()), ": ", text);
  if (update) {
    lines.PrintUpdate(line, json);
  } else {
    lines.PrintNews(reason.value_or(client::Reason::kUnspecified), line, json);
  }
}

absl::StatusOr<ExitCode> WatchSpace(const Session& session, const Client& client,
                                    const WatchArguments& arguments, Lines& lines) {
  const absl::Duration max_age = arguments.max_age.value_or(absl::InfiniteDuration());
  const LocalSpace space(client,
                         {.policy = session.policy, .max_age = max_age, .obstacles = false});
  uint64_t printed = 0;
  std::optional<client::Reason> last;
  while (!lines.End()) {
    const auto snapshot = space.WaitForUpdate(printed, kLook);
    const client::LocalSpaceStatus status = space.status();
    if (!status.connected &&
        (IsHopeless(status.problem) || (arguments.no_retry && !status.problem.ok()))) {
      return status.problem;
    }
    const std::optional<client::Reason> reason = snapshot->unknown_reason();
    const bool news = snapshot->number() != printed;
    if (!news && (printed == 0 || reason == last)) continue;
    PrintSpace(*snapshot, reason, status.problem, news && status.connected, lines);
    printed = snapshot->number();
    last = reason;
  }
  return kDone;
}

// One call, until it ends: why it ended, OK if nothing more is wanted.
absl::Status WatchPathOnce(const Session& session, const Client& client,
                           const std::vector<Configuration>& waypoints,
                           const WatchArguments& arguments, Lines& lines) {
  ASSIGN_OR_RETURN(auto watch,
                   client.WatchPath(waypoints, session.policy, session.clearance,
                                    arguments.resolution, SeparationOf(arguments.path)));
  while (!lines.End()) {
    const absl::StatusOr<client::PathUpdate> update = watch.Next(kLook);
    if (absl::IsDeadlineExceeded(update.status())) continue;
    if (!update.ok()) return update.status();
    const client::PathCheck& check = update->check;
    const std::string text = absl::StrCat(Spoken(check.basis), ": ", Spoken(check));
    Json json = JsonOf(check, session.clearance);
    if (update->repeated) {
      lines.PrintNews(check.verdict.reason, text, json);
    } else {
      json["skipped_scenes"] = update->skipped_scenes;
      lines.PrintUpdate(text + Skipped(update->skipped_scenes), json);
    }
  }
  return absl::OkStatus();
}

// Calls until that ends well, cannot, or is no longer wanted; between calls it says what is wrong.
// Returns how the last call ended.
absl::Status CallAgain(const Session& session, const WatchArguments& arguments, Lines& lines,
                       const std::function<absl::Status()>& call) {
  while (true) {
    const absl::Status ended = call();
    if (ended.ok() || IsHopeless(ended) || arguments.no_retry) return ended;
    const client::Verdict lost{.reason = absl::IsResourceExhausted(ended)
                                             ? client::Reason::kRefused
                                             : client::Reason::kConnectionLost};
    Json json = JsonOf(lost, session.clearance);
    json["problem"] = std::string(ended.message());
    lines.PrintNews(lost.reason, absl::StrCat(Spoken(lost, {}), " (", ended.message(), ")"), json);
    for (absl::Duration waited; waited < kBetweenAttempts && !lines.End(); waited += kLook) {
      std::this_thread::sleep_for(absl::ToChronoMilliseconds(kLook));
    }
    if (lines.End()) return ended;
  }
}

absl::StatusOr<ExitCode> WatchPath(const Session& session, const Client& client,
                                   const WatchArguments& arguments, Lines& lines) {
  const auto database = [&] {
    absl::StatusOr<v1::GetDatabaseResponse> answer;
    CallAgain(session, arguments, lines, [&] {
      answer = client.GetDatabase();
      return answer.status();
    }).IgnoreError();
    return answer;
  };
  const auto waypoints = WaypointsOf(session, arguments.path, database);
  const absl::Status ended =
      !waypoints.ok() ? waypoints.status() : CallAgain(session, arguments, lines, [&] {
        return WatchPathOnce(session, client, *waypoints, arguments, lines);
      });
  if (ended.ok() || lines.End()) return kDone;
  return ended;
}

absl::StatusOr<ExitCode> Watch(const Session& session, const WatchArguments& arguments) {
  const bool path = !arguments.path.waypoints.empty() || !arguments.path.file.empty();
  if (path && arguments.max_age) {
    return absl::InvalidArgumentError(
        "--max-age: not for a path, whose scenes may be as old as the server has it; leave it out");
  }
  if (!path && (arguments.path.separation || arguments.resolution ||
                session.clearance == client::Clearance::kMeasure)) {
    return absl::InvalidArgumentError(
        "--separation, --resolution and --clearance are of a path; give its waypoints, or leave "
        "them out");
  }
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  CatchStopSignals();
  Lines lines(session.json(), arguments.count);
  return path ? WatchPath(session, client, arguments, lines)
              : WatchSpace(session, client, arguments, lines);
}

}  // namespace

void AddWatchCommand(CLI::App& program, Session& session) {
  CLI::App* command = program.add_subcommand(
      "watch", "Report the configuration space, or a path, with every scene");
  auto arguments = std::make_shared<WatchArguments>();
  AddPathArguments(*command, session, arguments->path);
  AddSeparationOptions(*command, arguments->path);
  AddTimeOption(*command, "--max-age", arguments->max_age,
                "How old a scene may be until all is unknown, e.g. 300ms; default: as the\n"
                "server has it; not for a path");
  command->add_option("--count", arguments->count, "End after this many updates")
      ->check(PositiveNumber());
  command->add_flag("--no-retry", arguments->no_retry,
                    "End with exit code 3 when the server is lost, instead of trying again");
  AddClearanceFlag(*command, session);
  AddResolutionOption(*command, arguments->resolution);
  AddVerdictOptions(*command, session);
  command->footer(
      "Prints a line for each update; with --format json an object per line. Prints a line, too,\n"
      "when the last verdict expires and when the server is lost. Without waypoints it watches "
      "the\n"
      "configuration space. Ctrl-C ends it with exit code 0.\n\n"
      "Example:\n"
      "  silhouette watch --max-age 300ms\n"
      "  silhouette watch 0.1,0.2 0.5,0.2 --format json\n"
      "  silhouette watch --file path.json --no-retry");
  Runs(*command, session, Watch, arguments);
}

}  // namespace silhouette
