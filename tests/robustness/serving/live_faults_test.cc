// SPDX-License-Identifier: Apache-2.0
// silhouette-server --live while calls to the system go wrong. In its simulated cell nothing moves:
// each configuration is free always, or never.
#include <gtest/gtest.h>

#include <cerrno>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/time/clock.h"
#include "silhouette/client.h"
#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"
#include "tests/running_program.h"

namespace silhouette {
namespace {

using Numbers = std::set<ConfigurationNumber>;

constexpr absl::Duration kPatience = absl::Seconds(60);

// A server of `cell`, with a ball in it. `fault`: as FAULT of ../faults/preload/faults.cc, or
// empty.
class LiveServer {
 public:
  LiveServer(const ProgramCell& cell, const std::string& fault)
      : program_({"/usr/bin/env", "FAULT=" + fault, "FAULT_DONE=" + (folder_ / "done").string(),
                  "LD_PRELOAD=" + BuildFolder() + "/tests/libfaults.so",
                  ProgramFolder() + "/silhouette-server", "--cell", cell.cell(), "--database",
                  cell.database(), "--listen", "unix:" + (folder_ / "s").string(), "--live",
                  "--simulated-obstacles", cell / "obstacles.yaml"},
                 folder_ / "out", folder_ / "err"),
        client_(*client::Client::Connect(program_.Address(), absl::Seconds(20))) {}

  // What is free now; nothing is if the server does not answer.
  Numbers Free() const {
    Numbers free;
    const auto space = client_.GetConfigurationSpace();
    if (!space.ok()) return free;
    for (ConfigurationNumber number = 0; number < space->grid().size(); ++number) {
      if (space->IsFree(number)) free.insert(number);
    }
    return free;
  }

  bool FaultIsDone() const { return std::filesystem::exists(folder_ / "done"); }
  std::string Log() const { return program_.Errors(); }

 private:
  const std::filesystem::path folder_ = FreshFolder();
  RunningProgram program_;
  const client::Client client_;
};

class LiveFaults : public testing::TestWithParam<std::string> {
 protected:
  static void SetUpTestSuite() {
    cell_ = new ProgramCell;
    cell_->CaptureAll();
    WriteText(*cell_ / "obstacles.yaml",
              "obstacles:\n  - {name: ball, sphere: {radius: 0.3}, position: [0.9, 0.5, 1.2],\n"
              "     brightness: 0.9}\n");
    const LiveServer undisturbed(*cell_, "");
    for (const absl::Time end = absl::Now() + kPatience; free_.empty() && absl::Now() < end;) {
      free_ = undisturbed.Free();
    }
    ASSERT_FALSE(free_.empty()) << undisturbed.Log();
    ASSERT_LT(free_.size(), cell_->Records()) << "the ball blocks no configuration";
  }
  static void TearDownTestSuite() { delete cell_; }

  static inline ProgramCell* cell_ = nullptr;
  static inline Numbers free_;  // in truth
};

TEST_P(LiveFaults, NeverFreeWhatIsOccupiedAndPass) {
  const LiveServer server(*cell_, GetParam());
  bool recovered = false;
  for (const absl::Time end = absl::Now() + kPatience; !recovered && absl::Now() < end;) {
    const Numbers free = server.Free();
    for (const ConfigurationNumber number : free) EXPECT_TRUE(free_.contains(number)) << number;
    recovered = server.FaultIsDone() && free == free_;
  }
  EXPECT_TRUE(recovered) << server.Log();
}

INSTANTIATE_TEST_SUITE_P(Of, LiveFaults,
                         testing::Values(absl::StrCat("accept:1:", EMFILE),
                                         absl::StrCat("accept:1:", ECONNABORTED),
                                         absl::StrCat("send:8:", EPIPE),
                                         absl::StrCat("send:9:", ENOBUFS), "send:10:delay",
                                         "clock:400:step", "clock:400:back"),
                         [](const auto& test) {
                           return absl::StrReplaceAll(test.param, {{":", "_"}});
                         });

}  // namespace
}  // namespace silhouette
