// SPDX-License-Identifier: Apache-2.0
// silhouette-record: records what silhouette-server sees and answers.
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "common/recording/recorder.h"
#include "db/status/status_macros.h"
#include "silhouette/client.h"
#include "silhouette/messages.h"
#include "silhouette/running_clock.h"
#include "tools/program/program.h"

namespace silhouette {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kProgram[] = "silhouette-record";
constexpr absl::Duration kLook = absl::Milliseconds(50);
constexpr absl::Duration kBetweenFlushes = absl::Milliseconds(500);
constexpr absl::Duration kBetweenAttempts = absl::Seconds(1);

// What each file begins with, to be read alone, takes up to a tenth of it.
constexpr uint64_t kLeastFile = 1'000'000;

struct Arguments {
  std::string server = client::kDefaultAddress;
  client::ClientTls tls;
  RecorderSettings recorder;
  bool images = false;
  std::string format = "text";
};

// What no server will answer, however often it is asked.
bool IsHopeless(const absl::Status& status) {
  return ExitCodeOf(status) == kUserMistake || absl::IsUnimplemented(status);
}

std::string TimeText(absl::Time time) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", time, absl::UTCTimeZone());
}

RecorderTime Now() {
  return {.wall = absl::Now(),
          .running = absl::FromChrono(client::RunningClock::now().time_since_epoch())};
}

class Program {
 public:
  Program(Client client, const Arguments& arguments)
      : client_(std::move(client)), arguments_(arguments) {}

  absl::StatusOr<ExitCode> Run() {
    CatchStopSignals();
    while (!StopRequested()) {
      const absl::Status ended = RecordOnce();
      if (ended.ok()) break;
      if (IsHopeless(ended)) {
        if (!recorder_ && path_.empty()) return ended;
        const ExitCode recorded = End();
        if (recorded == kDone) return ended;
        Report("silhouette-record", ended);
        return recorded;
      }
      if (!lost_since_) {
        const RecorderTime now = Now();
        lost_since_ = now.running;
        if (recorder_) recorder_->Lose(now);
        Note("lost", absl::StrCat(ended.message(), "; trying again"));
      }
      for (absl::Duration waited; waited < kBetweenAttempts && !StopRequested(); waited += kLook) {
        Flush();
        std::this_thread::sleep_for(absl::ToChronoMilliseconds(kLook));
      }
    }
    return End();
  }

 private:
  // One connection, until it ends: why it ended, OK if nothing more is wanted.
  absl::Status RecordOnce() {
    client::SceneWatch watch = client_.WatchScenes(arguments_.images);
    database_known_ = false;
    while (!StopRequested()) {
      const auto news = watch.Next(kLook);
      if (!news.ok() && !absl::IsDeadlineExceeded(news.status())) return news.status();
      if (news.ok()) {
        if (absl::Status taken = Take(*news); !taken.ok()) {
          TakeQueued(watch, *news);
          return taken;
        }
      }
      Flush();
    }
    return absl::OkStatus();
  }

  // Whether the message is of the generation that the recorder's files are of.
  bool Fits(const v1::WatchScenesResponse& news) const {
    return database_known_ && (!news.has_state() || news.state().database_generation() ==
                                                        recorder_->database().generation());
  }

  // What has come after `news` from a server that does not answer any more.
  void TakeQueued(client::SceneWatch& watch, absl::StatusOr<v1::WatchScenesResponse> news) {
    while (news.ok() && Fits(*news)) {
      news = watch.Next(absl::ZeroDuration());
      if (news.ok() && Fits(*news)) Keep(*news, Now());
    }
  }

  absl::Status Take(const v1::WatchScenesResponse& news) {
    const RecorderTime now = Now();
    if (lost_since_) {
      Note("back", absl::StrFormat("recording again after %.0f s",
                                   absl::ToDoubleSeconds(now.running - *lost_since_)));
      lost_since_.reset();
    }
    // First: after a stop the server may not answer any more.
    const bool fits = Fits(news);
    if (fits) Keep(news, now);
    // A file is of one generation. A new state may be that of another check of the calibration.
    if (!database_known_ || news.has_state()) {
      ASSIGN_OR_RETURN(auto database, client_.GetDatabase());
      if (recorder_ && database.generation() == recorder_->database().generation()) {
        recorder_->Update(std::move(database), now);
      } else {
        CloseFiles();
        recorder_.emplace(arguments_.recorder, std::move(database));
      }
      database_known_ = true;
    }
    if (!fits) Keep(news, now);
    return absl::OkStatus();
  }

  void Keep(const v1::WatchScenesResponse& news, const RecorderTime& now) {
    const std::vector<RecordedStop> stops = recorder_->Take(news, now);
    if (!stops.empty()) FlushNow();
    for (const RecordedStop& stop : stops) NoteStop(stop);
  }

  void NoteStop(const RecordedStop& stop) {
    ++stops_;
    const v1::CheckPathResponse& check = stop.path.answer().check();
    const std::string reason =
        check.verdict().state() == v1::Verdict::STATE_OCCUPIED
            ? "occupied"
            : "unknown: " + NameOf(client::FromMessage(check.verdict().reason()));
    const std::string file = recorder_->stops_are_written() ? recorder_->stop_path() : "";
    if (arguments_.format == "json") {
      std::cout << Json({{"event", "stop"},
                         {"time", TimeText(stop.time)},
                         {"client", stop.path.client()},
                         {"path", stop.path.id()},
                         {"reason", reason},
                         {"file", file}})
                       .dump()
                << std::endl;
      return;
    }
    std::cout << TimeText(stop.time) << ": a path of " << stop.path.client()
              << " is not free any more (" << reason << "); "
              << (file.empty() ? "waits in memory for the disk" : "kept in " + file) << std::endl;
  }

  // News of connection and disk.
  void Note(const std::string& event, const std::string& text) const {
    if (arguments_.format == "json") {
      std::cout
          << Json({{"event", event}, {"time", TimeText(absl::Now())}, {"message", text}}).dump()
          << std::endl;
    }
    std::cerr << kProgram << ": " << text << std::endl;
  }

  void Flush() {
    if (recorder_ && Now().running - flushed_ >= kBetweenFlushes) FlushNow();
  }

  void FlushNow() {
    flushed_ = Now().running;
    const absl::Status status = recorder_->Flush();
    if (status.ok() && disk_failed_) Note("disk", "the disk takes the recording again");
    if (!status.ok() && !disk_failed_) {
      Note("disk", absl::StrCat(status.message(),
                                "; until the disk takes it, the newest 64 MB wait in memory"));
    }
    disk_failed_ = !status.ok();
  }

  // Ends the files of the recorder.
  void CloseFiles() {
    if (!recorder_) return;
    const absl::Status closed = recorder_->Close();
    if (!closed.ok()) Note("disk", absl::StrCat(closed.message(), "; the file has no index"));
    scenes_ += recorder_->scenes();
    missed_ += recorder_->missed_scenes();
    lost_ += recorder_->lost() + recorder_->unwritten();
    const std::string path = recorder_->path();
    const std::string path_of_stop = recorder_->stop_path();
    recorder_.reset();
    // A file of which the disk took nothing is not there.
    std::error_code error;
    if (std::filesystem::exists(path, error)) path_ = path;
    if (std::filesystem::exists(path_of_stop, error)) path_of_stop_ = path_of_stop;
  }

  ExitCode End() {
    CloseFiles();
    if (arguments_.format == "json") {
      std::cout << Json({{"event", "end"},
                         {"scenes", scenes_},
                         {"missed_scenes", missed_},
                         {"lost_messages", lost_},
                         {"stops", stops_},
                         {"file", path_},
                         {"stop_file", path_of_stop_}})
                       .dump()
                << std::endl;
      return lost_ > 0 ? kWorldFailed : kDone;
    }
    std::cout << scenes_ << (scenes_ == 1 ? " scene, " : " scenes, ") << stops_
              << (stops_ == 1 ? " stop" : " stops");
    if (missed_ > 0) std::cout << ", " << missed_ << " scenes missed";
    if (lost_ > 0) std::cout << ", " << lost_ << " messages lost to the disk";
    for (const std::string& file : {path_, path_of_stop_}) {
      if (!file.empty()) std::cout << "; " << file;
    }
    std::cout << std::endl;
    return lost_ > 0 ? kWorldFailed : kDone;
  }

  const Client client_;
  const Arguments arguments_;
  std::optional<Recorder> recorder_;
  bool database_known_ = false;               // the recorder's is that of this connection's server
  std::optional<absl::Duration> lost_since_;  // running
  absl::Duration flushed_ = -absl::InfiniteDuration();
  bool disk_failed_ = false;
  // Of recorders that are closed.
  uint64_t scenes_ = 0;
  uint64_t missed_ = 0;
  uint64_t lost_ = 0;
  uint64_t stops_ = 0;
  std::string path_;
  std::string path_of_stop_;
};

// Locks the folder for this recorder until the process ends: recorders would remove each other's
// files. FailedPrecondition: another one has locked it. Without effect on a disk without locks.
absl::Status TakeFolder(const std::string& folder) {
  const int file = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0 || flock(file, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) {
    return absl::OkStatus();
  }
  close(file);
  return FailedPrecondition("--folder ", folder,
                            ": another silhouette-record writes into it; name another folder, one "
                            "folder per recorder");
}

absl::StatusOr<ExitCode> Record(const Arguments& arguments) {
  std::error_code error;
  std::filesystem::create_directories(arguments.recorder.folder, error);
  if (!error && access(arguments.recorder.folder.c_str(), W_OK | X_OK) != 0) {
    error.assign(errno, std::generic_category());
  }
  if (error) return InvalidArgument("--folder ", arguments.recorder.folder, ": ", error.message());
  RETURN_IF_ERROR(TakeFolder(arguments.recorder.folder));
  ASSIGN_OR_RETURN(Client client,
                   Client::Connect(arguments.server, absl::Seconds(10), arguments.tls));
  return Program(std::move(client), arguments).Run();
}

int Main(int argc, char** argv) {
  setenv("GRPC_VERBOSITY", "NONE", /*overwrite=*/0);
  CLI::App app("Records scenes, watched paths and stops of silhouette-server into MCAP files.",
               kProgram);
  Arguments arguments;
  app.add_option("server,--server", arguments.server,
                 "Address of silhouette-server: host:port, unix:path")
      ->envname("SILHOUETTE_SERVER")
      ->capture_default_str();
  app.add_option("--folder", arguments.recorder.folder, "Where the files go")->required();
  app.add_flag("--images", arguments.images,
               "Record camera images, too (JPEG, 5 a second), of a server that runs with --live");
  app.add_option("--size", arguments.recorder.file_bytes,
                 "Size of one file, e.g. 256MB, 1GB; at least 1MB")
      ->check(PositiveNumber())
      ->transform(ByteSize())
      ->default_str("256MB");
  app.add_option("--files", arguments.recorder.files,
                 "How many files are kept, of recordings and of stops each; the oldest make room")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_flag("--only-stops", arguments.recorder.only_stops,
               "Record only 30 s before and after each stop");
  AddFormatOption(app, arguments.format);
  app.add_option("--tls-ca", arguments.tls.ca,
                 "PEM file of the authority that signed the server's certificate")
      ->envname("SILHOUETTE_TLS_CA");
  app.add_option("--tls-certificate", arguments.tls.certificate,
                 "PEM file of this client's certificate, whose name has the role operator")
      ->envname("SILHOUETTE_TLS_CERTIFICATE");
  app.add_option("--tls-key", arguments.tls.key, "PEM file of its private key")
      ->envname("SILHOUETTE_TLS_KEY");
  app.footer(
      "A stop: a path that a client watches (WatchPath) was free and is not any more. 30 s before\n"
      "and after each stop go into stop-TIME.mcap, everything into recording-TIME.mcap. A lost\n"
      "server is tried again. Ctrl-C ends the recording with exit code 0.\n\n"
      "Example:\n"
      "  silhouette-record 127.0.0.1:50051 --folder recordings --size 1GB --files 20\n"
      "  silhouette-record --folder stops --only-stops --images");
  return RunProgram(
      app, argc, argv, Work([&] {
        if (arguments.recorder.file_bytes < kLeastFile) {
          return absl::StatusOr<ExitCode>(InvalidArgument(
              "--size ", arguments.recorder.file_bytes, "B: a file has at least 1MB; state more"));
        }
        return Record(arguments);
      }));
}

}  // namespace
}  // namespace silhouette

int main(int argc, char** argv) { return silhouette::Main(argc, argv); }
