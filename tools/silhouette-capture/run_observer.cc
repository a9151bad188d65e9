#include "tools/silhouette-capture/run_observer.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <vector>

#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "tools/program/program.h"

namespace silhouette {
namespace {

// Waits until somebody has typed a line, or wants to stop: then false.
bool Typed() {
  constexpr int kMilliseconds = 100;
  pollfd terminal{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
  while (!StopRequested()) {
    if (poll(&terminal, 1, kMilliseconds) > 0) return true;
  }
  return false;
}

// Which of `answers` somebody at the terminal gives; empty: he ends the session, or there is
// nobody.
std::string Ask(const std::string& question, const std::vector<std::string>& answers) {
  if (isatty(STDIN_FILENO) == 0 || isatty(STDERR_FILENO) == 0) return "";
  std::string answer;
  while (!StopRequested()) {
    std::cerr << "\n"
              << question << "  e  end the session; what was captured is stored\n"
              << absl::StrJoin(answers, ", ") << " or e: " << std::flush;
    if (!Typed() || !std::getline(std::cin, answer) || answer == "e") break;
    if (std::ranges::find(answers, answer) != answers.end()) return answer;
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
  const std::string answer = Ask(
      "The robot was lost and is back. See that nobody is with it: it begins to move as soon as\n"
      "you answer.\n"
      "  g  go on\n",
      {"g"});
  if (answer == "g") log_.Write("somebody says: the robot may move");
  return answer == "g";
}

}  // namespace silhouette
