// SPDX-License-Identifier: Apache-2.0
// A session of silhouette-capture over GigE Vision cameras, as its user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_split.h"
#include "tests/capture/drivers/own_network.h"
#include "tests/capture/drivers/served_process.h"
#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

// Before there are any threads.
const bool kOwnNetwork = EnterOwnNetwork(2);

// How many pixels differ.
size_t Differing(const Mask& a, const Mask& b) { return ((a - b) | (b - a)).Count(); }

class ServedSession : public testing::Test {
 protected:
  void SetUp() override {
    if (!kOwnNetwork) GTEST_SKIP() << "the system lets a test have no network of its own";
    WriteCell({});
  }

  void WriteCell(std::vector<std::pair<std::string, std::string>> more) {
    more.insert(more.end(),
                {{"name: top, source: sim", "name: top, source: {gige: {serial: top}}"},
                 {"name: front, source: sim", "name: front, source: {gige: {serial: front}}"},
                 {"settle: 5 ms", "settle: 30 ms\n  joint_speed: 6\n  retry: 1 s"}});
    cell_.WriteCell(more);
  }

  void TakeReferences() {
    const Served empty(cell_.cell(), {"--cameras", "gige", "--without-robot"});
    cell_.TakeReferences();
  }

  // Waits until the database has at least `records`.
  void WaitForRecords(uint64_t records) const {
    for (int i = 0; i < 6000 && cell_.Records() < records; ++i) {
      absl::SleepFor(absl::Milliseconds(5));
    }
  }

  ProgramCell cell_;
};

TEST_F(ServedSession, CamerasAreListedAndShowTheCell) {
  const Served served(cell_.cell(), {"--cameras", "gige"});
  EXPECT_EQ(served.told()["cameras"][1]["serial"], "front");
  EXPECT_EQ(served.told()["cameras"][1]["address"], "127.0.0.2");
  const Outcome outcome = cell_.Run({"cameras", "--cell", cell_.cell(), "--out", cell_ / "pictures",
                                     "--sets", "5", "--format", "json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["found"][0]["serial"], "front");
  EXPECT_EQ(json["found"][1]["serial"], "top");
  EXPECT_EQ(json["complete"], 5);
  for (const auto& view : json["views"]) {
    EXPECT_EQ(view["taken"], 5);
    EXPECT_EQ(view["width"], 160);
    EXPECT_TRUE(std::filesystem::exists(view["picture"].get<std::string>()));
  }
  EXPECT_TRUE(std::filesystem::exists(cell_ / "pictures/all.png"));
}

TEST_F(ServedSession, RobotAndCamerasOfTheNetworkGiveTheRobotImagesOfTheCell) {
  const ProgramCell in_process;
  in_process.CaptureAll();
  const auto expected = in_process.Content();
  WriteCell({{"driver: sim",
              "driver: {simple_message: {host: 127.0.0.1, byte_order: little, joints: [joint_1, "
              "joint_2, joint_3, joint_4, joint_5, joint_6]}}"}});
  TakeReferences();
  const Served served(cell_.cell(), {"--cameras", "gige", "--robot", "simple_message"});
  const Outcome outcome = cell_.Run(cell_.Arguments("run"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto content = cell_.Content();
  ASSERT_EQ(content.size(), expected.size());
  for (const auto& [number, image] : content) {
    for (size_t v = 0; v < image.masks.size(); ++v) {
      // The joints' values come as numbers of 32 bits.
      EXPECT_LE(Differing(image.masks[v], expected.at(number).masks[v]), 3u) << number << ", " << v;
    }
  }
}

TEST_F(ServedSession, ReferenceIsRefusedWhileTheRobotStandsInAView) {
  const auto shell = [](const std::string& command) {
    const std::string whole = ProgramFolder() + "/" + command + " >/dev/null 2>&1";
    ASSERT_EQ(std::system(whole.c_str()), 0) << whole;
  };
  cell_.WriteCell({});
  shell("silhouette-sim calibration --cell " + cell_.cell() + " --out " + cell_ / "true");
  WriteCell({{"driver: sim",
              "driver: {simple_message: {host: 127.0.0.1, byte_order: little, joints: [joint_1, "
              "joint_2, joint_3, joint_4, joint_5, joint_6]}}"}});
  // The camera models come with a calibration. Without it nothing says where the robot would be.
  TakeReferences();
  shell("silhouette-db calibration import " + cell_.database() + " " + cell_ / "true");
  {
    const Served empty(cell_.cell(),
                       {"--cameras", "gige", "--robot", "simple_message", "--without-robot"});
    const Outcome looked = cell_.Run(cell_.Arguments("reference"));
    EXPECT_EQ(looked.exit_code, 0);
    EXPECT_THAT(looked.out, HasSubstr("not looked for: people and things that stand still; make"));
  }
  const Served served(cell_.cell(), {"--cameras", "gige", "--robot", "simple_message"});
  const Outcome refused = cell_.Run(cell_.Arguments("reference"));
  EXPECT_EQ(refused.exit_code, 1) << refused.out;
  EXPECT_THAT(refused.err, AllOf(HasSubstr("the robot stands in 'top', 'front'"),
                                 HasSubstr("no reference images were stored")));
  EXPECT_TRUE(std::filesystem::exists(cell_.database() + ".robot.png"));
  EXPECT_EQ(cell_.Run(cell_.Arguments("reference", {"--accept-robot"})).exit_code, 0);
}

TEST_F(ServedSession, ReferenceOfAFirstSessionSaysThatTheRobotIsNotLookedFor) {
  const std::string driver =
      "driver: {simple_message: {host: 127.0.0.1, byte_order: little, joints: [joint_1, joint_2, "
      "joint_3, joint_4, joint_5, joint_6]}}";
  WriteCell({{"driver: sim", driver}});
  const Served served(cell_.cell(), {"--cameras", "gige", "--robot", "simple_message"});
  const Outcome taken = cell_.Run(cell_.Arguments("reference"));
  EXPECT_EQ(taken.exit_code, 0) << taken.err;
  const std::vector<std::string> lines = absl::StrSplit(taken.out, '\n', absl::SkipEmpty());
  ASSERT_GE(lines.size(), 2u);
  EXPECT_THAT(
      lines[lines.size() - 2],
      AllOf(HasSubstr("not looked for: people and things that stand still, and the robot "
                      "(the database has no calibration with camera models yet); make sure")));
}

TEST_F(ServedSession, EndsSafelyWhenTheCamerasGoAwayAndGoesOnWhenTheyAreBack) {
  // The served robot stands still: the one that moves is not the one that the cameras see.
  WriteCell({{"keep_free: 0 B", "keep_free: 0 B\n  first_look: {configurations: 0}"}});
  TakeReferences();
  Served served(cell_.cell(), {"--cameras", "gige"});
  const pid_t run = cell_.Start(cell_.Arguments("run"));
  WaitForRecords(3);
  served.End();
  const Outcome outcome = cell_.Wait(run);
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("the camera of the view 'top': "),
                                 HasSubstr("what was captured is stored; go on with: ")));
  const uint64_t stored = cell_.Records();
  EXPECT_GE(stored, 3u);
  EXPECT_LT(stored, 45u);
  const Served again(cell_.cell(), {"--cameras", "gige"});
  const Outcome rest = cell_.Run(cell_.Arguments("run"));
  EXPECT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_THAT(cell_.Content(), SizeIs(45));
}

}  // namespace
}  // namespace silhouette
