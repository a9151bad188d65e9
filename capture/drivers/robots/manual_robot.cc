// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/robots/manual_robot.h"

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <iostream>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMillimetre = 1e-3;

double UnitOf(const ManualJoint& joint) { return joint.prismatic ? kMillimetre : kDegree; }

std::vector<std::string> NamesOf(const std::vector<ManualJoint>& joints) {
  std::vector<std::string> names;
  for (const ManualJoint& joint : joints) names.push_back(joint.name);
  return names;
}

// Numbers with spaces or commas between them; nothing if it is anything else.
std::optional<std::vector<double>> Numbers(const std::string& line) {
  std::vector<double> numbers;
  for (const auto word : absl::StrSplit(line, absl::ByAnyChar(" ,\t"), absl::SkipEmpty())) {
    double number = 0;
    if (!absl::SimpleAtod(word, &number) || !std::isfinite(number)) return std::nullopt;
    numbers.push_back(number);
  }
  return numbers;
}

}  // namespace

ManualRobot::ManualRobot(std::vector<ManualJoint> joints, Operator person, Reading reading)
    : joints_(std::move(joints)),
      names_(NamesOf(joints_)),
      person_(std::move(person)),
      reading_(reading) {}

ManualRobot::ManualRobot(std::vector<ManualJoint> joints, Operator person,
                         std::unique_ptr<Robot> reader, double tolerance)
    : joints_(std::move(joints)),
      names_(NamesOf(joints_)),
      person_(std::move(person)),
      reader_(std::move(reader)),
      tolerance_(tolerance) {}

std::string ManualRobot::Spoken(std::span<const double> positions,
                                const std::optional<std::vector<double>>& known) const {
  std::vector<std::string> words;
  for (size_t j = 0; j < joints_.size(); ++j) {
    if (known && std::abs((*known)[j] - positions[j]) < 1e-6) continue;
    words.push_back(absl::StrFormat("%s %.2f %s", names_[j], positions[j] / UnitOf(joints_[j]),
                                    joints_[j].prismatic ? "mm" : "deg"));
  }
  return absl::StrJoin(words, ", ");
}

absl::StatusOr<std::string> ManualRobot::Ask(const std::string& question) const {
  absl::StatusOr<std::string> answer = person_.ask(question);
  if (!answer.ok()) return answer;
  const std::string word(absl::StripAsciiWhitespace(*answer));
  if (absl::AsciiStrToLower(word) == "stop") return absl::CancelledError("stopped by the operator");
  return word;
}

absl::StatusOr<std::vector<double>> ManualRobot::AskForPositions(
    const std::string& question, std::span<const double> if_confirmed) const {
  while (true) {
    ASSIGN_OR_RETURN(const std::string answer, Ask(question));
    if (answer.empty() && !if_confirmed.empty()) {
      return std::vector<double>(if_confirmed.begin(), if_confirmed.end());
    }
    std::optional<std::vector<double>> numbers = Numbers(answer);
    if (numbers && numbers->size() == joints_.size()) {
      for (size_t j = 0; j < joints_.size(); ++j) (*numbers)[j] *= UnitOf(joints_[j]);
      return *std::move(numbers);
    }
    person_.tell(absl::StrCat("not understood: ", joints_.size(), " numbers are expected, for ",
                              absl::StrJoin(names_, ", ")));
  }
}

absl::Status ManualRobot::WaitUntilThere(std::span<const double> goal) {
  while (true) {
    RETURN_IF_ERROR(Ask("Enter when it stands there, or stop: ").status());
    ASSIGN_OR_RETURN(const RobotState state, reader_->State());
    std::vector<std::string> off;
    for (size_t j = 0; j < joints_.size(); ++j) {
      double deviation = state.positions[j] - goal[j];
      if (joints_[j].continuous) deviation = std::remainder(deviation, 2 * std::numbers::pi);
      if (std::abs(deviation) <= tolerance_) continue;
      off.push_back(absl::StrFormat("%s by %.3f %s", names_[j], deviation / UnitOf(joints_[j]),
                                    joints_[j].prismatic ? "mm" : "deg"));
    }
    if (off.empty() && !state.moving) return absl::OkStatus();
    person_.tell(off.empty() ? std::string("it still moves")
                             : absl::StrCat("it is off: ", absl::StrJoin(off, ", ")));
  }
}

absl::Status ManualRobot::MoveTo(std::span<const double> positions) {
  if (positions.size() != joints_.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the robot has ", joints_.size(), " joints, not ", positions.size()));
  }
  const std::string change = Spoken(positions, at_);
  person_.tell(change.empty() ? "leave the robot where it is"
                              : absl::StrCat("move the robot to: ", change,
                                             at_ ? "; the other joints stay" : ""));
  if (reader_) {
    absl::Status there = WaitUntilThere(positions);
    if (there.ok()) at_.emplace(positions.begin(), positions.end());
    return there;
  }
  const bool typed = reading_ == Reading::kTyped;
  ASSIGN_OR_RETURN(const std::vector<double> at,
                   AskForPositions(absl::StrCat(typed ? "" : "Enter when it stands there, or ",
                                                "the values that it shows (",
                                                absl::StrJoin(names_, " "), "), or stop: "),
                                   typed ? std::span<const double>() : positions));
  at_ = at;
  return absl::OkStatus();
}

absl::StatusOr<RobotState> ManualRobot::State() {
  if (reader_) return reader_->State();
  if (!at_) {
    ASSIGN_OR_RETURN(
        const std::vector<double> at,
        AskForPositions(
            absl::StrCat("where does the robot stand? Its values, in degrees and millimetres (",
                         absl::StrJoin(names_, " "), "): "),
            {}));
    at_ = at;
  }
  return RobotState{.positions = *at_, .moving = false};
}

absl::Status ManualRobot::Stop() {
  person_.tell("do not move the robot any more");
  return absl::OkStatus();
}

namespace {

absl::StatusOr<std::string> Ask(const std::string& question, const std::function<bool()>& stopped) {
  const absl::Status ended = absl::CancelledError("stopped by the operator");
  // Of a terminal: what a pipe holds are answers. Flushing would stop a background job.
  if (tcgetpgrp(STDIN_FILENO) == getpgrp()) tcflush(STDIN_FILENO, TCIFLUSH);
  std::cerr << question << std::flush;
  std::string line;
  while (true) {
    pollfd place{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    // Unlike a read, it is not taken up again after a signal.
    const int ready = poll(&place, 1, stopped ? 100 : -1);
    if (stopped && stopped()) return ended;
    if (ready == 0) continue;
    if (ready < 0) {
      if (errno == EINTR) return ended;
      return absl::FailedPreconditionError("the operator cannot be asked: stdin cannot be read");
    }
    char letter = 0;
    if (read(STDIN_FILENO, &letter, 1) != 1) {
      return absl::FailedPreconditionError(
          "a robot that is moved by hand needs somebody to ask; run the program at a terminal");
    }
    if (letter == '\n') return line;
    line += letter;
  }
}

}  // namespace

Operator OperatorAtTerminal(std::function<bool()> stopped) {
  return {.tell = [](const std::string& line) { std::cerr << line << std::endl; },
          .ask = [stopped = std::move(stopped)](
                     const std::string& question) { return Ask(question, stopped); }};
}

}  // namespace silhouette
