// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/session_log.h"

#include <spdlog/logger.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <unistd.h>
#include <algorithm>
#include <exception>
#include <fstream>
#include <iostream>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "capture/drivers/robots/manual_robot.h"
#include "common/log/log_lines.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"

namespace silhouette {
namespace {

constexpr absl::Duration kBetweenProgress = absl::Minutes(5);

}  // namespace

absl::StatusOr<SessionLog> SessionLog::Open(const std::string& file) {
  std::ifstream before(file, std::ios::binary);
  if (before.peek() == '\0') {  // as a database begins, to which nothing must be added
    return absl::InvalidArgumentError(
        absl::StrCat("the log '", file, "' is no text file; name another with --log"));
  }
  SessionLog log;
  try {
    auto sink = std::make_shared<spdlog::sinks::basic_file_sink_st>(file, /*truncate=*/false);
    log.logger_ = std::make_shared<spdlog::logger>("session", std::move(sink));
  } catch (const std::exception& error) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the log '", file, "' cannot be written; name another with --log: ", error.what()));
  }
  log.logger_->set_formatter(LineFormatter("%Y-%m-%d %H:%M:%S  %v"));
  log.logger_->flush_on(spdlog::level::info);
  // The capture itself reports a full disk.
  log.logger_->set_error_handler([](const std::string&) {});
  log.file_ = file;
  return log;
}

void SessionLog::Write(const std::string& line) {
  if (logger_) logger_->info("{}", line);
}

void SessionLog::WriteProgress(uint64_t done, uint64_t total, absl::Time begin) {
  const absl::Time now = absl::Now();
  if (next_progress_ == absl::InfinitePast()) next_progress_ = now + kBetweenProgress;
  if (now < next_progress_ || done == 0 || done >= total) return;
  next_progress_ = now + kBetweenProgress;
  const double share = static_cast<double>(done) / static_cast<double>(total);
  const absl::Duration left = (now - begin) * ((1 - share) / share);
  Write(absl::StrFormat("%d of %d configurations (%.0f %%), %s left, done about %s", done, total,
                        100 * share, Spoken(left), ClockTime(now + left, now)));
}

namespace {

// Which of `answers` the operator gives at the terminal; empty: the operator ends the session, or
// there is no terminal.
std::string Ask(const std::string& question, const std::vector<std::string>& answers) {
  if (isatty(STDIN_FILENO) == 0 || isatty(STDERR_FILENO) == 0) return "";
  const Operator person = OperatorAtTerminal(StopRequested);
  while (!StopRequested()) {
    const absl::StatusOr<std::string> answer = person.ask(
        absl::StrCat("\n", question, "  e  end the session; what was captured is stored\n",
                     absl::StrJoin(answers, ", "), " or e: "));
    if (!answer.ok() || *answer == "e") break;
    if (std::ranges::find(answers, *answer) != answers.end()) return *answer;
  }
  return "";
}

}  // namespace

RunObserver::RunObserver(uint64_t total, SessionLog& log)
    : total_(total), log_(log), begin_(absl::Now()) {
  if (total > 0) progress_.emplace("capturing", total, "configurations");
}

CaptureObserver RunObserver::Observer() {
  CaptureObserver observer;
  observer.progress = [this](uint64_t done) {
    progress_->Update(done);
    log_.WriteProgress(done, total_, begin_);
  };
  observer.say = [this](const std::string& line) { Say(line); };
  observer.note = [this](const std::string& line) { log_.Write(line); };
  observer.stop_requested = StopRequested;
  observer.alarm = [this](const std::string& why) { return AskAfterAlarm(why); };
  observer.robot_may_move = [this] { return AskWhetherRobotMayMove(); };
  return observer;
}

void RunObserver::Say(const std::string& line) {
  log_.Write(line);
  progress_ ? progress_->Say(line) : void(std::cerr << line << std::endl);
}

AfterAlarm RunObserver::AskAfterAlarm(const std::string& why) {
  log_.Write("the session pauses and the robot stands still: " + why);
  const std::string answer =
      Ask("The session pauses; the robot stands still, and begins to move as soon as you answer.\n"
          "  a  look again (you put the camera back, or the light)\n"
          "  g  go on nonetheless (what is captured stays suspect)\n",
          {"a", "g"});
  if (answer == "a") {
    log_.Write("somebody says: look again");
    return AfterAlarm::kCheckAgain;
  }
  if (answer == "g") {
    log_.Write("somebody says: go on nonetheless");
    return AfterAlarm::kGoOn;
  }
  return AfterAlarm::kEnd;
}

bool RunObserver::AskWhetherRobotMayMove() {
  Say("the robot is back, and stands still until somebody says that it may move");
  const std::string answer =
      Ask("The robot was lost, or a stop command did not reach it. Check that no person is near "
          "it: it\n"
          "begins to move as soon as you answer.\n"
          "  g  go on\n",
          {"g"});
  if (answer == "g") log_.Write("somebody says: the robot may move");
  return answer == "g";
}

}  // namespace silhouette
