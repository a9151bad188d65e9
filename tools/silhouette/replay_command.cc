// SPDX-License-Identifier: Apache-2.0
// silhouette replay
#include <algorithm>
#include <chrono>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "common/recording/recording.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "silhouette/messages.h"
#include "tools/program/program.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/inputs.h"
#include "tools/silhouette/formats/output.h"

namespace silhouette {
namespace {

// Between looks at Ctrl-C.
constexpr absl::Duration kLookWhileFeeding = absl::Milliseconds(50);
// How long the server is watched for scenes of others.
constexpr absl::Duration kQuiet = absl::Milliseconds(1200);
// A scene that was recorded longer before a moment does not stand for it: there is a gap.
constexpr absl::Duration kLongest = absl::Seconds(1);
// Regions are allowed for so long, and again in time.
constexpr absl::Duration kAllowedFor = absl::Minutes(10);

struct ReplayArguments {
  std::string file;
  std::string to;  // empty: nowhere
  double speed = 1;
  std::string at;  // empty: all scenes, or without `to` a summary
  PathArguments path;
};

// "2026-01-31T12:00:00Z", or "12.5s" after the beginning of the file.
absl::StatusOr<absl::Time> TimeIn(const ReplayArguments& arguments,
                                  const RecordingSummary& summary) {
  absl::Time time;
  std::string error;
  if (absl::ParseTime(absl::RFC3339_full, arguments.at, &time, &error)) return time;
  const std::optional<absl::Duration> after = ParseTime(arguments.at);
  if (!after) {
    return InvalidArgument("--at ", arguments.at,
                           ": give a time, 2026-01-31T12:00:00Z, or one after the beginning of the "
                           "file, 12.5s or '1 min 30 s'");
  }
  return summary.start + *after;
}

// What can be read of the file; says what is lost.
absl::StatusOr<std::unique_ptr<Recording>> OpenRecording(const std::string& file) {
  ASSIGN_OR_RETURN(auto recording, Recording::Open(file));
  const std::string& damage = recording->summary().damage;
  if (!damage.empty()) std::cerr << "silhouette: " << damage << std::endl;
  return recording;
}

// Where a part of the recording is lost.
ExitCode DoneOr(const RecordingSummary& summary) {
  return summary.damage.empty() ? kDone : kWorldFailed;
}

absl::Status InUse(const Client& client) {
  return FailedPrecondition(
      "the server at ", client.address(),
      " is in use: it gets scenes from elsewhere, or regions are allowed there. Replay to a "
      "server of its own: silhouette-server --cell ... --database ... --listen 127.0.0.1:0");
}

// The server that a recording is replayed to. Ends the regions that it allowed, however it goes.
class ReplayServer {
 public:
  // FailedPrecondition: it takes images itself, somebody publishes scenes to it at least once a
  // second, or regions are allowed there.
  static absl::StatusOr<std::unique_ptr<ReplayServer>> Connect(const Session& session,
                                                               const std::string& address) {
    ASSIGN_OR_RETURN(const Client client,
                     Client::Connect(address, absl::Seconds(session.timeout), session.tls));
    if (client.GetAcquisition().ok()) return InUse(client);
    ASSIGN_OR_RETURN(const auto allowed, client.ListAllowedRegions());
    if (allowed.regions_size() > 0) return InUse(client);
    ASSIGN_OR_RETURN(const uint64_t before, NewestScene(client));
    std::this_thread::sleep_for(absl::ToChronoMilliseconds(kQuiet));
    ASSIGN_OR_RETURN(const uint64_t last, NewestScene(client));
    if (last != before) return InUse(client);
    return absl::WrapUnique(new ReplayServer(client, last));
  }
  ~ReplayServer() {
    for (const auto& [name, allowed] : allowed_) client_.RevokeRegion(name).IgnoreError();
  }
  ReplayServer(const ReplayServer&) = delete;
  ReplayServer& operator=(const ReplayServer&) = delete;

  const Client& client() const { return client_; }
  // The newest scene that was published here.
  uint64_t scene() const { return last_; }

  // Publishes a scene, and allows these regions with it. FailedPrecondition: somebody else
  // published, too.
  absl::Status Publish(const v1::Scene& scene, const v1::ServedState& state) {
    const auto now = client::RunningClock::now();
    ASSIGN_OR_RETURN(const v1::Scene made, client_.PublishScene(RequestOf(scene), now));
    if (made.id() != last_ + 1) return InUse(client_);
    last_ = made.id();
    return Allow(state);
  }

 private:
  ReplayServer(Client client, uint64_t last) : client_(std::move(client)), last_(last) {}

  // 0: none.
  static absl::StatusOr<uint64_t> NewestScene(const Client& client) {
    const absl::StatusOr<v1::Scene> scene = client.GetScene();
    if (absl::IsNotFound(scene.status())) return 0;
    RETURN_IF_ERROR(scene.status());
    return scene->id();
  }

  struct Allowed {
    std::string asked;  // an AllowRegionRequest
    client::RunningClock::time_point renewal;
  };

  // Ends all others.
  absl::Status Allow(const v1::ServedState& state) {
    const auto now = client::RunningClock::now();
    std::map<std::string, Allowed> ended = allowed_;
    for (const v1::AllowedRegion& region : state.regions()) {
      v1::AllowRegionRequest request;
      request.set_name(region.name());
      *request.mutable_views() = region.views();
      *request.mutable_duration() = client::ToMessage(kAllowedFor);
      ended.erase(region.name());
      Allowed& allowed = allowed_[region.name()];
      std::string asked = request.SerializeAsString();
      if (allowed.asked == asked && now < allowed.renewal) continue;
      allowed = {std::move(asked), now + absl::ToChronoNanoseconds(kAllowedFor / 2)};
      RETURN_IF_ERROR(client_.AllowRegion(request).status());
    }
    for (const auto& [name, allowed] : ended) {
      RETURN_IF_ERROR(client_.RevokeRegion(name).status());
      allowed_.erase(name);
    }
    return absl::OkStatus();
  }

  const Client client_;
  uint64_t last_;
  std::map<std::string, Allowed> allowed_;  // by name
};

// Of another generation, answers are of its robot images, not of those of the recording.
absl::Status CompareDatabases(const Client& client, const v1::GetDatabaseResponse& recorded) {
  if (recorded.cell_name().empty()) {
    return FailedPrecondition("the part of the recording that says of which cell it is, is lost");
  }
  ASSIGN_OR_RETURN(const v1::GetDatabaseResponse served, client.GetDatabase());
  if (served.cell_name() != recorded.cell_name()) {
    return FailedPrecondition("the recording is of the cell '", recorded.cell_name(),
                              "', and the server at ", client.address(), " serves '",
                              served.cell_name(), "'");
  }
  if (recorded.cell_digest() != 0 && served.cell_digest() != recorded.cell_digest()) {
    return FailedPrecondition("the recording is of another cell or grid of the name '",
                              recorded.cell_name(), "' than the server at ", client.address(),
                              " serves; start it with the database that was served then");
  }
  if (served.generation() != recorded.generation()) {
    std::cerr << "silhouette: warning: the recording is of database generation "
              << recorded.generation() << ", and the server has " << served.generation()
              << std::endl;
  }
  return absl::OkStatus();
}

// A path, and what was said of it then; nothing: it was not watched.
struct Question {
  std::vector<Configuration> waypoints;
  std::optional<v1::WatchedPath> watched;
};

absl::StatusOr<std::vector<Question>> QuestionsAt(const Session& session,
                                                  const ReplayArguments& arguments,
                                                  const RecordedMoment& moment) {
  std::vector<Question> questions;
  if (!arguments.path.waypoints.empty() || !arguments.path.file.empty()) {
    ASSIGN_OR_RETURN(auto waypoints,
                     WaypointsOf(session, arguments.path, [&] { return moment.database; }));
    questions.push_back({.waypoints = std::move(waypoints), .watched = {}});
    return questions;
  }
  for (const RecordedPath& recorded : moment.paths) {
    Question& question = questions.emplace_back();
    for (const v1::Configuration& q : recorded.path.request().waypoints()) {
      question.waypoints.emplace_back(q.positions().begin(), q.positions().end());
    }
    question.watched = recorded.path;
  }
  if (questions.empty()) {
    return InvalidArgument("no path was watched at that moment; give a configuration or a path");
  }
  return questions;
}

// Never empty.
std::string DefectText(const v1::SceneDefect& defect) {
  if (!defect.message().empty()) return defect.message();
  if (defect.reason() == v1::Verdict::REASON_UNSPECIFIED) return "a defect";
  return NameOf(client::FromMessage(defect.reason()));
}

// Why everything was unknown then, whatever the preset; empty: it was not.
std::string UnknownThen(const RecordedMoment& moment) {
  if (!moment.scene) {
    return absl::StrCat("no scene is recorded in the ", SpokenTime(kLongest),
                        " before that moment");
  }
  if (!moment.state) return "what held beside the scene is not recorded";
  for (const v1::SceneDefect& defect : moment.scene->defects()) return DefectText(defect);
  for (const v1::SceneDefect& defect : moment.state->defects()) return DefectText(defect);
  if (moment.state->unknown_reason() == v1::Verdict::REASON_UNSPECIFIED) return "";
  return NameOf(client::FromMessage(moment.state->unknown_reason()));
}

// Waits; false if the user has had enough.
bool WaitUntil(absl::Time time) {
  while (!StopRequested() && absl::Now() < time) {
    std::this_thread::sleep_for(
        absl::ToChronoMilliseconds(std::min(time - absl::Now(), kLookWhileFeeding)));
  }
  return !StopRequested();
}

absl::StatusOr<ExitCode> Feed(const Session& session, const ReplayArguments& arguments) {
  ASSIGN_OR_RETURN(const auto recording, OpenRecording(arguments.file));
  ASSIGN_OR_RETURN(const auto server, ReplayServer::Connect(session, arguments.to));
  CatchStopSignals();
  const absl::Time began = absl::Now();
  const RecordingSummary& summary = recording->summary();
  uint64_t published = 0;
  uint64_t unknown = 0;
  for (const absl::Time time : summary.scenes) {
    if (!WaitUntil(began + (time - summary.scenes.front()) / arguments.speed)) break;
    ASSIGN_OR_RETURN(RecordedMoment moment, recording->At(time, kLongest));
    if (published == 0) RETURN_IF_ERROR(CompareDatabases(server->client(), moment.database));
    if (const std::string why = UnknownThen(moment); !why.empty()) {
      moment.scene->add_defects()->set_message(why);  // it goes without joint values
      ++unknown;
    }
    RETURN_IF_ERROR(server->Publish(*moment.scene, moment.state.value_or(v1::ServedState())));
    ++published;
  }
  PrintResult(session.format, Json({{"scenes", published}, {"without_joints", unknown}}),
              absl::StrCat(published, " scenes published",
                           unknown == 0 ? ""
                                        : absl::StrCat(", ", unknown,
                                                       " of them without joint values, as nothing "
                                                       "was known then"),
                           "\n"));
  return published < summary.scenes.size() ? kStopped : DoneOr(summary);
}

// "free", "occupied", "unknown: no scene"
std::string SaidThen(const v1::WatchedPath& path) {
  const v1::Verdict& verdict = path.answer().check().verdict();
  switch (verdict.state()) {
    case v1::Verdict::STATE_FREE:
      return "free";
    case v1::Verdict::STATE_OCCUPIED:
      return "occupied";
    default:
      return "unknown: " + NameOf(client::FromMessage(verdict.reason()));
  }
}

// What `stated` leaves open is as it was asked then.
Session AsAskedThen(const v1::CheckPathRequest& then, Session stated) {
  if (stated.variant.empty()) stated.variant = then.variant();
  const client::Policy& policy = stated.policy;
  const bool states_policy =
      !policy.preset.empty() || policy.min_views || policy.max_occluded_views || policy.off_grid;
  if (!states_policy) stated.policy = client::FromMessage(then.policy());
  return stated;
}

// Checks each question as the moment was; without a server `unknown` is why nothing was known.
absl::StatusOr<bool> Answer(const Session& session, const ReplayServer* server,
                            const std::vector<Question>& questions, const std::string& unknown,
                            Json& json, std::string& text) {
  bool all_free = true;
  for (const Question& question : questions) {
    Json answer = Json::object();
    if (question.watched) {
      answer["client"] = question.watched->client();
      answer["then"] = SaidThen(*question.watched);
      absl::StrAppend(&text, "path of ", question.watched->client(), ", then ",
                      SaidThen(*question.watched), "; ");
    }
    if (server == nullptr) {
      all_free = false;
      answer.update({{"state", "unknown"}, {"message", unknown}});
      absl::StrAppend(&text, "unknown: ", unknown, "\n");
    } else {
      const v1::CheckPathRequest then =
          question.watched ? question.watched->request() : v1::CheckPathRequest();
      const Session asked = AsAskedThen(then, session);
      const std::optional<double> resolution =
          then.has_path_resolution() ? std::optional(then.path_resolution()) : std::nullopt;
      ASSIGN_OR_RETURN(
          const client::PathCheck check,
          server->client()
              .WithVariant(asked.variant)
              .CheckPath(question.waypoints, asked.policy, asked.clearance, resolution));
      if (check.basis.scene_id != server->scene()) return InUse(server->client());
      all_free = all_free && check.verdict.free();
      answer.update(JsonOf(check, session.clearance));
      absl::StrAppend(&text, Spoken(check), "\n");
    }
    json["answers"].push_back(answer);
  }
  return all_free;
}

absl::StatusOr<ExitCode> AskAt(const Session& session, const ReplayArguments& arguments) {
  if (arguments.to.empty()) {
    return InvalidArgument(
        "--at asks a server: name one with --to that serves the recording's database and nothing "
        "else");
  }
  ASSIGN_OR_RETURN(const auto recording, OpenRecording(arguments.file));
  ASSIGN_OR_RETURN(const absl::Time time, TimeIn(arguments, recording->summary()));
  ASSIGN_OR_RETURN(const RecordedMoment moment, recording->At(time, kLongest));
  ASSIGN_OR_RETURN(const std::vector<Question> questions, QuestionsAt(session, arguments, moment));
  Json json = {{"time", Exact(time)}, {"answers", Json::array()}};
  std::string text = absl::StrCat(Exact(time), "\n");
  if (moment.scene) {
    const absl::Duration age = time - client::FromMessage(moment.scene->time());
    json["scene_id"] = moment.scene->id();
    json["scene_age_s"] = absl::ToDoubleSeconds(age);
    text = absl::StrFormat("%s: scene %d, %.0f ms old\n", Exact(time), moment.scene->id(),
                           absl::ToDoubleMilliseconds(age));
  }
  const std::string unknown = UnknownThen(moment);
  std::unique_ptr<ReplayServer> server;
  if (unknown.empty()) {
    ASSIGN_OR_RETURN(server, ReplayServer::Connect(session, arguments.to));
    RETURN_IF_ERROR(CompareDatabases(server->client(), moment.database));
    RETURN_IF_ERROR(server->Publish(*moment.scene, *moment.state));
  }
  ASSIGN_OR_RETURN(const bool all_free,
                   Answer(session, server.get(), questions, unknown, json, text));
  PrintResult(session.format, json, text);
  return all_free ? DoneOr(recording->summary()) : kNo;
}

absl::StatusOr<ExitCode> Summarize(const Session& session, const ReplayArguments& arguments) {
  ASSIGN_OR_RETURN(const auto recording, OpenRecording(arguments.file));
  const RecordingSummary& summary = recording->summary();
  const bool empty = summary.empty();
  Json json = {{"cell", summary.cell},
               {"start", empty ? Json() : Json(Exact(summary.start))},
               {"end", empty ? Json() : Json(Exact(summary.end))},
               {"scenes", summary.scenes.size()},
               {"cut", summary.cut},
               {"damage", summary.damage},
               {"stops", Json::array()}};
  std::string text =
      empty ? "empty\n"
            : absl::StrCat(summary.cell.empty() ? "which cell it is of, is lost"
                                                : absl::StrCat("cell '", summary.cell, "'"),
                           ", ", Exact(summary.start), " to ", Exact(summary.end), ": ",
                           summary.scenes.size(), " scenes, ", summary.stops.size(),
                           summary.stops.size() == 1 ? " stop" : " stops",
                           summary.cut ? "; cut at its end" : "", "\n");
  for (const RecordedStop& stop : summary.stops) {
    json["stops"].push_back({{"time", Exact(stop.time)},
                             {"client", stop.path.client()},
                             {"path", stop.path.id()},
                             {"verdict", SaidThen(stop.path)}});
    absl::StrAppend(&text, Exact(stop.time), ": path of ", stop.path.client(), " ",
                    SaidThen(stop.path), "\n");
  }
  PrintResult(session.format, json, text);
  return DoneOr(summary);
}

absl::StatusOr<ExitCode> Replay(const Session& session, const ReplayArguments& arguments) {
  if (!arguments.at.empty()) return AskAt(session, arguments);
  if (!arguments.path.waypoints.empty() || !arguments.path.file.empty()) {
    return InvalidArgument("give the moment that is asked about, with --at");
  }
  return arguments.to.empty() ? Summarize(session, arguments) : Feed(session, arguments);
}

}  // namespace

void AddReplayCommand(CLI::App& program, Session& session) {
  CLI::App* command = program.add_subcommand(
      "replay",
      "Summarise a recording of silhouette-record, replay it, or ask about a moment of it");
  auto arguments = std::make_shared<ReplayArguments>();
  command->add_option("recording", arguments->file, "An MCAP file of silhouette-record")
      ->required();
  command->add_option(
      "--to", arguments->to,
      "Publish the scenes to the server at this address: one that serves the recording's\n"
      "database and that no planner relies on");
  CLI::Option* at = command->add_option(
      "--at", arguments->at,
      "Only the scene of this moment: a time, or one after the file's beginning, "
      "12.5s.\nThen check the path, or all that clients watched, e.g. with another "
      "--preset");
  command->add_option("--speed", arguments->speed, "Playback speed factor")
      ->check(PositiveNumber())
      ->capture_default_str()
      ->needs("--to")
      ->excludes(at);
  AddPathArguments(*command, session, arguments->path);
  AddVerdictOptions(*command, session);
  for (const char* of_verdicts :
       {"--preset", "--min-views", "--max-occluded-views", "--off-grid", "--variant"}) {
    command->get_option(of_verdicts)
        ->needs(at)
        ->group(
            "How verdicts are made (default: as the client asked then; for a path given here, the "
            "server's)");
  }
  command->get_option("--degrees")->needs(at);
  command->get_option("--variant")
      ->description("The variant that is tested: with this tool, this part; else the scene's");
  command->footer(
      "Without --to and --at: from when to when it is, and its stops. To look at it: "
      "silhouette-server "
      "--replay.\n"
      "Exit codes: 0 done; 1 a path is not free at that moment; 2 wrong arguments or files; 3 a "
      "part\n"
      "of the recording is damaged and was left out, or the server failed; 130 Ctrl-C ended it.\n\n"
      "Example:\n"
      "  silhouette replay recordings/stop-20260131T120000.123Z.mcap\n"
      "  silhouette replay stop.mcap --to 127.0.0.1:50052 --speed 0.5\n"
      "  silhouette replay stop.mcap --to 127.0.0.1:50052 --at 29.5s --preset paper\n"
      "  silhouette replay stop.mcap --to 127.0.0.1:50052 --at 29.5s 0.1,0.2 0.5,0.2");
  Runs(*command, session, Replay, arguments);
}

}  // namespace silhouette
