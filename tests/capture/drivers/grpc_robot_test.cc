// SPDX-License-Identifier: Apache-2.0
// A robot behind the RobotDriverService: that of the simulated cell, and the example in Python.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <future>
#include <memory>
#include <numbers>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/grpc/grpc_robot_link.h"
#include "capture/drivers/robots/feedback_robot.h"
#include "capture/sim/served/grpc_robot_server.h"
#include "capture/sim/served/simulated_controller.h"
#include "tests/capture/drivers/robot_places.h"
#include "tests/capture/sim/small_cell.h"
#include "tests/certificates.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pointwise;

// What a busy machine needs to answer.
constexpr absl::Duration kTimeout = absl::Seconds(20);

std::unique_ptr<FeedbackRobot> Connect(const std::string& address, MotionLimits limits,
                                       absl::Duration timeout = kTimeout) {
  limits.silence = timeout;
  auto link = ConnectGrpcRobot({.address = address, .timeout = timeout});
  EXPECT_TRUE(link.ok()) << link.status();
  return link.ok() ? std::make_unique<FeedbackRobot>(*std::move(link), limits) : nullptr;
}

class GrpcRobotTest : public testing::Test {
 protected:
  void SetUp() override { Serve(); }
  void Serve() { server_ = *GrpcRobotServer::Start(controller_, "127.0.0.1:0"); }

  SimulatedController controller_{ThreeJointRobot(), 0, kHere, [](std::span<const double>) {}};
  std::unique_ptr<GrpcRobotServer> server_;
};

TEST_F(GrpcRobotTest, ArrivesAndTellsWhereItIs) {
  const auto robot = Connect(server_->address(), {.joint_speed = 4});
  EXPECT_THAT(robot->joints(), ElementsAre("turn", "bend", "slide"));
  const absl::Status status = robot->MoveTo(kThere);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_THAT(controller_.state().positions, Pointwise(DoubleNear(kNearRobot), kThere));
  EXPECT_THAT(robot->State()->positions, Pointwise(DoubleNear(kNearRobot), kThere));
  EXPECT_EQ(controller_.stops(), 0);
}

TEST_F(GrpcRobotTest, RobotThatMovesByItselfIsStoppedThoughNobodyAsks) {
  const auto robot = Connect(server_->address(), {.joint_speed = 4});
  ASSERT_TRUE(robot->MoveTo(kThere).ok());
  controller_.SetFault(ControllerFault::kDrifts);
  ASSERT_TRUE(Eventually([&] { return controller_.stops() > 0; }));
  EXPECT_TRUE(Eventually([&] { return !controller_.state().moving; }));
  EXPECT_THAT(robot->State().status().message(), HasSubstr("moves when it should stand still"));
}

TEST_F(GrpcRobotTest, RobotThatStopsHalfWayIsStopped) {
  controller_.SetFault(ControllerFault::kStopsHalfWay);
  const auto robot =
      Connect(server_->address(), {.joint_speed = 4, .patience = absl::Milliseconds(300)});
  const absl::Status status = robot->MoveTo(kThere);
  EXPECT_TRUE(absl::IsDeadlineExceeded(status)) << status;
  EXPECT_GT(controller_.stops(), 0);
}

TEST_F(GrpcRobotTest, WhatTheDriverRefusesIsSaidInItsWords) {
  const auto robot = Connect(server_->address(), {.joint_speed = 4});
  const absl::Status beyond = robot->MoveTo(std::vector<double>{2.5, 0, 0});
  EXPECT_TRUE(absl::IsInvalidArgument(beyond)) << beyond;
  EXPECT_THAT(beyond.message(), HasSubstr("'turn'"));
  controller_.SetFault(ControllerFault::kEmergencyStop);
  EXPECT_TRUE(Eventually(
      [&] { return robot->MoveTo(kThere).message().find("emergency stop") != std::string::npos; }));
}

TEST_F(GrpcRobotTest, DriverThatEndsOnTheWayStopsTheRobotAndTheNextOneGoesOn) {
  auto robot = Connect(server_->address(), {.joint_speed = 0.05}, absl::Seconds(1));
  std::future<absl::Status> move =
      std::async(std::launch::async, [&] { return robot->MoveTo(kThere); });
  ASSERT_TRUE(Eventually([&] { return controller_.state().moving; }));
  server_.reset();
  EXPECT_TRUE(Eventually([&] { return !controller_.state().moving; }));
  const absl::Status lost = move.get();
  EXPECT_TRUE(absl::IsUnavailable(lost)) << lost;
  EXPECT_THAT(lost.message(), HasSubstr("the stop command failed"));
  Serve();
  robot = Connect(server_->address(), {.joint_speed = 4});
  EXPECT_TRUE(robot->MoveTo(kHere).ok());
}

TEST_F(GrpcRobotTest, JointsAreNotOlderThanTheQuestionForThem) {
  const absl::Duration before = RunningNow();
  const auto robot = Connect(server_->address(), {});
  const absl::StatusOr<RobotState> state = robot->State();
  ASSERT_TRUE(state.ok() && state->not_before) << state.status();
  EXPECT_GE(*state->not_before, before);
  EXPECT_LE(*state->not_before, RunningNow());
  // A driver that has not answered since: the same positions, and as old.
  server_.reset();
  const absl::Duration ended = RunningNow();
  const absl::StatusOr<RobotState> later = robot->State();
  EXPECT_TRUE(!later.ok() || later->not_before <= ended);
}

TEST_F(GrpcRobotTest, DriverThatNamesItsJointsInAnotherOrderIsNotBelieved) {
  const auto robot = Connect(server_->address(), {}, absl::Seconds(1));
  const std::string address = server_->address();
  server_.reset();
  ASSERT_TRUE(Eventually([&] { return !robot->State().ok(); }));
  std::string urdf = ThreeJointUrdf();
  urdf = absl::StrReplaceAll(urdf, {{"\"turn\"", "\"bend\""}, {"\"bend\"", "\"turn\""}});
  SimulatedController other(
      RobotModel::FromUrdf(WriteFile(FreshFolder() / "other.urdf", urdf)).value(), 0, kHere,
      [](std::span<const double>) {});
  const auto restarted = GrpcRobotServer::Start(other, address);
  ASSERT_TRUE(restarted.ok()) << restarted.status();
  EXPECT_TRUE(Eventually([&] {
    return absl::StrContains(robot->State().status().message(),
                             "now names the joints bend, turn, slide and named turn, bend, slide");
  }));
}

TEST_F(GrpcRobotTest, ProxyOfTheEnvironmentIsNotUsed) {
  for (const char* direct : {"no_grpc_proxy", "no_proxy"}) unsetenv(direct);
  setenv("http_proxy", "http://127.0.0.1:1", /*overwrite=*/1);
  const absl::Status status =
      ConnectGrpcRobot({.address = server_->address(), .timeout = kTimeout}).status();
  unsetenv("http_proxy");
  EXPECT_TRUE(status.ok()) << status;
}

TEST_F(GrpcRobotTest, NobodyThereIsSaidWithTheAddress) {
  const std::string address = server_->address();
  server_.reset();
  const absl::Status status =
      ConnectGrpcRobot({.address = address, .timeout = absl::Seconds(1)}).status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr(address));
}

// The example driver in a process of its own.
class PythonDriver {
 public:
  // `certificates`: of tools/certificates; empty: plain text.
  explicit PythonDriver(const std::filesystem::path& certificates = {}) {
    std::vector<std::string> arguments = {
        SourceFolder() + "/clients/drivers/python/robot_driver.py", "--listen", "127.0.0.1:0",
        "--start", "0,10,0,0,0,-90"};
    if (!certificates.empty()) {
      arguments.insert(arguments.end(), {"--tls", certificates / "server.pem",
                                         certificates / "server.key", certificates / "ca.pem"});
    }
    std::vector<char*> words;
    for (std::string& argument : arguments) words.push_back(argument.data());
    words.push_back(nullptr);
    int out[2];
    if (pipe(out) != 0) return;
    child_ = fork();
    if (child_ == 0) {
      dup2(out[1], STDOUT_FILENO);
      close(out[0]);
      execv(words[0], words.data());
      _exit(127);
    }
    close(out[1]);
    char letter = 0;
    while (read(out[0], &letter, 1) == 1 && letter != '\n') line_ += letter;
    close(out[0]);
  }
  ~PythonDriver() {
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
  }
  std::string address() const { return line_.substr(line_.rfind(' ') + 1); }

 private:
  pid_t child_ = -1;
  std::string line_;
};

TEST(PythonRobotDriver, IsDrivenAndStopped) {
  const PythonDriver driver;
  ASSERT_THAT(driver.address(), HasSubstr("127.0.0.1:"));
  const auto robot = Connect(driver.address(), {.joint_speed = 4});
  ASSERT_NE(robot, nullptr);
  constexpr double kDegree = std::numbers::pi / 180;
  EXPECT_THAT(robot->joints(),
              ElementsAre("joint_1", "joint_2", "joint_3", "joint_4", "joint_5", "joint_6"));
  EXPECT_THAT(robot->State()->positions,
              Pointwise(DoubleNear(kNearRobot),
                        std::vector<double>{0, 10 * kDegree, 0, 0, 0, -90 * kDegree}));
  const std::vector<double> goal = {0.5, 0, 0, 0, 0.25, -1};
  const absl::Status status = robot->MoveTo(goal);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_THAT(robot->State()->positions, Pointwise(DoubleNear(kNearRobot), goal));
  EXPECT_THAT(robot->MoveTo(std::vector<double>{4, 0, 0, 0, 0, 0}).message(),
              HasSubstr("joint_1 cannot go to 229.2 degrees"));

  const auto slow = Connect(driver.address(), {.joint_speed = 0.05});
  std::future<absl::Status> move =
      std::async(std::launch::async, [&] { return slow->MoveTo(std::vector<double>(6, 0.0)); });
  ASSERT_TRUE(Eventually([&] {
    const auto state = slow->State();
    return state.ok() && state->moving;
  }));
  EXPECT_TRUE(slow->Stop().ok());
  EXPECT_TRUE(absl::IsAborted(move.get()));
  EXPECT_TRUE(Eventually([&] {
    const auto state = slow->State();
    return state.ok() && !state->moving;
  }));
}

TEST(PythonRobotDriver, StartsBesideTheClientPackage) {
  const std::filesystem::path packages = FreshFolder();
  WriteFile(packages / "silhouette" / "__init__.py", "");
  setenv("PYTHONPATH", packages.c_str(), /*overwrite=*/1);
  const PythonDriver driver;
  unsetenv("PYTHONPATH");
  EXPECT_THAT(driver.address(), HasSubstr("127.0.0.1:"));
}

TEST(PythonRobotDriver, WithoutProtocSaysWhatToInstall) {
  const Shell shell;
  std::filesystem::copy(SourceFolder() + "/clients/drivers/python/robot_driver.py", shell.folder());
  const Ended driver = shell.Run("PATH=/none /usr/bin/python3 robot_driver.py");
  EXPECT_EQ(driver.exit_code, 2);
  EXPECT_THAT(driver.err,
              AllOf(HasSubstr("robot_driver.py: protoc cannot make the service's modules"),
                    HasSubstr("install protobuf-compiler and protobuf-compiler-grpc"),
                    Not(HasSubstr("Traceback"))));
}

TEST(PythonRobotDriver, StartWithoutAValueForEachJointIsRefused) {
  const Shell shell;
  const std::string driver = SourceFolder() + "/clients/drivers/python/robot_driver.py";
  for (const char* start : {"0,0,0", "a"}) {
    const Ended ended =
        shell.Run(absl::StrCat("'", driver, "' --listen 127.0.0.1:0 --start ", start));
    EXPECT_EQ(ended.exit_code, 2);
    EXPECT_THAT(ended.err, AllOf(HasSubstr("argument --start: "), Not(HasSubstr("Traceback"))));
  }
}

TEST(PythonRobotDriver, MistakeOnTheCommandLineIsOneSentence) {
  const Shell shell;
  for (const std::string arguments : {"--start a", "--start 0,0", "--tls none none none"}) {
    const Ended driver = shell.Run("/usr/bin/python3 " + SourceFolder() +
                                   "/clients/drivers/python/robot_driver.py " + arguments);
    EXPECT_EQ(driver.exit_code, 2) << arguments;
    EXPECT_THAT(driver.err,
                AllOf(HasSubstr("robot_driver.py: error: "), Not(HasSubstr("Traceback"))));
  }
}

TEST(PythonRobotDriver, WithCertificatesServesOnlyWhoHasOne) {
  const std::filesystem::path certificates = MakeCertificates();
  const PythonDriver driver(certificates);
  ASSERT_THAT(driver.address(), HasSubstr("127.0.0.1:"));
  GrpcRobotSettings settings{.address = driver.address(),
                             .timeout = kTimeout,
                             .tls = TlsFilesOf("operator", certificates)};
  EXPECT_EQ(ConnectGrpcRobot(settings).status(), absl::OkStatus());
  settings.tls = TlsFilesOf("operator", MakeCertificates());  // another authority's
  settings.timeout = absl::Seconds(3);
  EXPECT_TRUE(absl::IsUnavailable(ConnectGrpcRobot(settings).status()));
  settings.tls = {};
  EXPECT_TRUE(absl::IsUnavailable(ConnectGrpcRobot(settings).status()));
  settings.tls = {.ca = certificates / "ca.pem"};
  EXPECT_TRUE(absl::IsInvalidArgument(ConnectGrpcRobot(settings).status()));
}

}  // namespace
}  // namespace silhouette
