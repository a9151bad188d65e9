#include "capture/program/run_observer.h"

#include <unistd.h>

#include <iostream>

#include "absl/time/clock.h"
#include "tools/program/program.h"

namespace silhouette {

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
  observer.alarm = [this](const std::string& why) { return Ask(why); };
  return observer;
}

void RunObserver::Say(const std::string& line) {
  log_.Write(line);
  progress_ ? progress_->Say(line) : void(std::cerr << line << std::endl);
}

AfterAlarm RunObserver::Ask(const std::string& why) {
  log_.Write("the session pauses and the robot stands still: " + why);
  if (isatty(STDIN_FILENO) == 0 || isatty(STDERR_FILENO) == 0) return AfterAlarm::kEnd;
  std::string answer;
  while (!StopRequested()) {
    std::cerr << "\nThe session pauses; the robot stands still, and begins to move as soon as you "
                 "answer.\n"
                 "  a  look again (you put the camera back, or the light)\n"
                 "  g  go on nonetheless (what is captured stays suspect)\n"
                 "  e  end the session; what was captured is stored\n"
                 "a, g or e: "
              << std::flush;
    if (!std::getline(std::cin, answer)) break;
    if (answer == "a") {
      log_.Write("somebody says: look again");
      return AfterAlarm::kCheckAgain;
    }
    if (answer == "g") {
      log_.Write("somebody says: go on nonetheless");
      return AfterAlarm::kGoOn;
    }
    if (answer == "e") break;
  }
  return AfterAlarm::kEnd;
}

}  // namespace silhouette
