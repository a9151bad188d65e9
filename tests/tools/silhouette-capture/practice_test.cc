// SPDX-License-Identifier: Apache-2.0
// Devices that silhouette-sim lets fail, and what silhouette-capture says and asks then, with and
// without a terminal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>

#include <utility>

#include "absl/strings/str_replace.h"
#include "capture/drivers/robots/feedback_robot.h"
#include "capture/drivers/robots/simple_message_link.h"
#include "tests/capture/drivers/robot_places.h"
#include "tests/capture/drivers/served_process.h"
#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// silhouette-capture at a terminal.
class AtTerminal {
 public:
  explicit AtTerminal(const std::vector<std::string>& arguments) {
    child_ = forkpty(&terminal_, nullptr, nullptr, nullptr);
    if (child_ == 0) Become("silhouette-capture", arguments);
  }
  ~AtTerminal() {
    kill(child_, SIGKILL);
    if (!ended_) waitpid(child_, nullptr, 0);
    close(terminal_);
  }

  // Reads until it has shown `text`, since what was read before; false: it ended.
  bool Shows(const std::string& text) {
    size_t from = shown_.size();
    while (shown_.find(text, from) == std::string::npos) {
      if (!ReadSome()) return false;
    }
    return true;
  }

  void Close() { close(std::exchange(terminal_, -1)); }

  void Type(const std::string& text) const {
    EXPECT_EQ(write(terminal_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }

  int ExitCode() {
    while (ReadSome()) {
    }
    int status = 0;
    waitpid(child_, &status, 0);
    ended_ = true;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  const std::string& shown() const { return shown_; }

 private:
  bool ReadSome() {
    pollfd ready{.fd = terminal_, .events = POLLIN, .revents = 0};
    constexpr int kMilliseconds = 120'000;
    if (poll(&ready, 1, kMilliseconds) <= 0) return false;
    char bytes[4096];
    const ssize_t length = read(terminal_, bytes, sizeof(bytes));
    if (length <= 0) return false;  // EIO: it has ended
    shown_.append(bytes, static_cast<size_t>(length));
    return true;
  }

  int terminal_ = -1;
  pid_t child_ = 0;
  bool ended_ = false;
  std::string shown_;
};

class Practice : public testing::Test {
 protected:
  void SetUp() override {
    Serve({"--without-robot"});
    cell_.TakeReferences();
  }
  void TearDown() override { served_.reset(); }

  // Serves the cell's devices, with faults, and has the cell's file name them.
  void Serve(const std::vector<std::string>& faults, const std::string& more = "",
             const std::string& protocol = "grpc") {
    served_.reset();
    cell_.WriteCell({kFewSteps});
    std::vector<std::string> arguments = {"--robot",   protocol, "--robot-address", "127.0.0.1:0",
                                          "--cameras", "grpc",   "--camera-port",   "0"};
    arguments.insert(arguments.end(), faults.begin(), faults.end());
    served_ = std::make_unique<Served>(cell_.cell(), arguments);
    nlohmann::json robot = served_->told()["robot"];
    robot.erase("driver");
    if (protocol == "grpc") robot.erase("joints");
    const std::string cameras = served_->told()["cameras"][0]["address"];
    const std::string source = "source: {grpc: {address: \"" + cameras + "\"}}";
    cell_.WriteCell({kFewSteps,
                     {"driver: sim", "driver: " + nlohmann::json{{protocol, robot}}.dump()},
                     {"name: top, source: sim", "name: top, " + source},
                     {"name: front, source: sim", "name: front, " + source},
                     {"settle: 5 ms", "settle: 5 ms\n  joint_speed: 6\n  retry: 10 s" + more}});
  }

  static std::vector<std::string> LostForAMoment() {
    return {"--robot-fault", "lost", "--after-moves", "6", "--fault-time", "2"};
  }

  // 12 configurations.
  const std::pair<std::string, std::string> kFewSteps = {"{joint_1: 9, joint_3: 5}",
                                                         "{joint_1: 4, joint_3: 3}"};
  static constexpr uint64_t kAll = 12;

  // Of the section `capture`: on a busy computer the robot may answer late, and count as lost.
  static constexpr char kRobotMayBeSlow[] = "\n  continue_after_reconnect: true";

  ProgramCell cell_;
  std::unique_ptr<Served> served_;
};

TEST_F(Practice, LostRobotEndsASessionThatNobodyWatchesAndTheNextGoesOn) {
  Serve(LostForAMoment());
  const Outcome lost = cell_.Run(cell_.Arguments("run"));
  EXPECT_EQ(lost.exit_code, 3);
  EXPECT_THAT(lost.err, AllOf(HasSubstr("the robot was lost, or a stop command did not reach it"),
                              HasSubstr("what was captured is stored; go on with: ")));
  EXPECT_LT(cell_.Records(), kAll);
  const Outcome rest = cell_.Run(cell_.Arguments("run"));
  EXPECT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_EQ(cell_.Records(), kAll);
}

TEST_F(Practice, LostRobotMovesOnByItselfOnlyWhereTheCellSaysSo) {
  Serve(LostForAMoment(), kRobotMayBeSlow);
  const Outcome outcome = cell_.Run(cell_.Arguments("run"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("it is back, after"));
  EXPECT_EQ(cell_.Records(), kAll);
}

TEST_F(Practice, LostRobotIsAskedForAtATerminal) {
  Serve(LostForAMoment());
  AtTerminal run(cell_.Arguments("run"));
  run.Type("g\ng\n");  // before it is asked for: no answer
  ASSERT_TRUE(run.Shows("g or e: ")) << run.shown();
  EXPECT_THAT(run.shown(), HasSubstr("Check that no person is near it"));
  const uint64_t before = cell_.Records();
  run.Type("yes\n");
  ASSERT_TRUE(run.Shows("g or e: ")) << run.shown();
  EXPECT_EQ(cell_.Records(), before);
  // On a busy computer the robot may answer late, and count as lost once more.
  do run.Type("g\n");
  while (run.Shows("g or e: "));
  EXPECT_EQ(run.ExitCode(), 0) << run.shown();
  EXPECT_EQ(cell_.Records(), kAll);
}

TEST_F(Practice, FrozenCamerasAreFoundByTheSentinelsAndAskedAboutAtATerminal) {
  Serve({"--camera-fault", "freezes", "--after-images", "14"}, kRobotMayBeSlow);
  AtTerminal run(cell_.Arguments("run"));
  ASSERT_TRUE(run.Shows("a, g or e: ")) << run.shown();
  EXPECT_THAT(run.shown(), HasSubstr("The session pauses; the robot stands still"));
  run.Type("a\n");
  ASSERT_TRUE(run.Shows("a, g or e: ")) << run.shown();
  run.Type("e\n");
  EXPECT_EQ(run.ExitCode(), 1);
  EXPECT_THAT(run.shown(), HasSubstr("--only suspect"));
}

TEST_F(Practice, InterruptIsAnAnswerToo) {
  Serve({"--camera-fault", "freezes", "--after-images", "14"}, kRobotMayBeSlow);
  AtTerminal run(cell_.Arguments("run"));
  ASSERT_TRUE(run.Shows("a, g or e: ")) << run.shown();
  run.Type("\x03");
  EXPECT_EQ(run.ExitCode(), 1) << run.shown();
}

TEST_F(Practice, SecondInterruptAndAClosedTerminalStopTheRobotOnItsWay) {
  for (const bool closes : {false, true}) {
    Serve({}, "", "simple_message");
    WriteText(cell_.cell(),
              absl::StrReplaceAll(ReadText(cell_.cell()), {{"speed: 20", "speed: 0.02"}}));
    const nlohmann::json told = served_->told()["robot"];
    FeedbackRobot robot(*SimpleMessageLink::Connect({.host = told["host"],
                                                     .motion_port = told["motion_port"],
                                                     .state_port = told["state_port"],
                                                     .joints = told["joints"],
                                                     .timeout = absl::Seconds(20)}),
                        {.silence = absl::Seconds(20)});
    const auto moves = [&](bool wanted) {
      const auto state = robot.State();
      return state.ok() && state->moving == wanted;
    };
    AtTerminal run(cell_.Arguments("run"));
    ASSERT_TRUE(Eventually([&] { return moves(true); })) << run.shown();
    if (closes) {
      run.Close();
    } else {
      run.Type("\x03");
      absl::SleepFor(absl::Seconds(1));  // two at once may arrive as one
      run.Type("\x03");
    }
    EXPECT_TRUE(Eventually([&] { return moves(false); }));
  }
}

TEST_F(Practice, EmergencyStopIsAFailureOfADeviceInEveryRun) {
  Serve({"--robot-fault", "e-stop", "--after-moves", "3"});
  for (const char* which : {"first", "second"}) {
    const Outcome outcome = cell_.Run(cell_.Arguments("run"));
    EXPECT_EQ(outcome.exit_code, 3) << which << ": " << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("emergency stop"));
  }
}

TEST_F(Practice, FaultOfADeviceThatIsNotServedIsAMistake) {
  const std::string command = absl::StrCat(ProgramFolder(), "/silhouette-sim serve --cell ",
                                           cell_.cell(), " --cameras grpc ");
  EXPECT_EQ(WEXITSTATUS(system((command + "--robot-fault lost 2>/dev/null").c_str())), 2);
  EXPECT_EQ(WEXITSTATUS(system((command + "--camera-fault drops 2>/dev/null").c_str())), 2);
}

}  // namespace
}  // namespace silhouette
