// SPDX-License-Identifier: Apache-2.0
// silhouette-server while it is disturbed: no verdict FREE that no fresh and true scene justifies,
// and FREE verdicts again afterwards.
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tests/folders.h"
#include "tests/robustness/serving/checker.h"
#include "tests/running_program.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// A server of that cell; `fault`: as FAULT of ../faults/preload/faults.cc, or empty.
class ServingProgram {
 public:
  explicit ServingProgram(const std::string& fault = "") {
    std::ofstream(folder_ / "cell.yaml") << kServerTestCellFile << "server: {max_age: 400 ms}\n";
    MakeDatabase(database(),
                 {.index = true, .cell = DescriptionOf(*LoadCell(folder_ / "cell.yaml"))});
    std::vector<std::string> command = {"/usr/bin/env"};
    if (!fault.empty()) {
      command.push_back("FAULT=" + fault);
      command.push_back("FAULT_DONE=" + (folder_ / "done").string());
      command.push_back("LD_PRELOAD=" + BuildFolder() + "/tests/libfaults.so");
    }
    for (const std::string& word :
         {ProgramFolder() + "/silhouette-server", std::string("--cell"),
          (folder_ / "cell.yaml").string(), std::string("--database"), database(),
          std::string("--listen"), "unix:" + (folder_ / "s").string()}) {
      command.push_back(word);
    }
    program_.emplace(command, folder_ / "out", folder_ / "err");
    address_ = program_->Address();
  }

  const std::string& address() const { return address_; }
  std::string database() const { return folder_ / "db"; }
  RunningProgram& program() { return *program_; }
  bool FaultIsDone() const { return fs::exists(folder_ / "done"); }

  // Resident memory in MiB, and open descriptors.
  std::pair<double, int> Size() const {
    const fs::path of = fs::path("/proc") / std::to_string(program_->pid());
    std::ifstream statm(of / "statm");
    uint64_t pages = 0;
    statm >> pages >> pages;
    int descriptors = 0;
    for ([[maybe_unused]] const auto& entry : fs::directory_iterator(of / "fd")) ++descriptors;
    return {static_cast<double>(pages) * 4096 / (1 << 20), descriptors};
  }

  // Connections that say nothing.
  std::vector<int> Connect(int count) const {
    std::vector<int> connections;
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    address_.copy(name.sun_path, sizeof(name.sun_path) - 1, 5);
    for (int i = 0; i < count; ++i) {
      connections.push_back(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
      connect(connections.back(), reinterpret_cast<sockaddr*>(&name), sizeof(name));
    }
    return connections;
  }

 private:
  const fs::path folder_ = FreshFolder();
  std::optional<RunningProgram> program_;
  std::string address_;
};

// Watches of the map that take its first message, and no other.
class SlowWatchers {
 public:
  SlowWatchers(const std::string& address, int count)
      : stub_(v1::CollisionService::NewStub(
            grpc::CreateChannel(address, grpc::InsecureChannelCredentials()))) {
    for (int i = 0; i < count; ++i) {
      contexts_.push_back(std::make_unique<grpc::ClientContext>());
      watches_.push_back(stub_->WatchConfigurationSpace(contexts_.back().get(), {}));
      v1::WatchConfigurationSpaceResponse message;
      watches_.back()->Read(&message);
    }
  }
  ~SlowWatchers() {
    for (const auto& context : contexts_) context->TryCancel();
  }

 private:
  std::unique_ptr<v1::CollisionService::Stub> stub_;
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts_;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::WatchConfigurationSpaceResponse>>> watches_;
};

void FlipBit(const std::string& file, size_t at, int bit) {
  std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
  bytes.seekg(static_cast<std::streamoff>(at));
  const char flipped = static_cast<char>(bytes.get() ^ 1 << bit);
  bytes.seekp(static_cast<std::streamoff>(at)).put(flipped);
}

// With which of the faults of the system's calls a server runs. Each comes while the clients work.
class ServingFaults : public testing::TestWithParam<std::string> {};

TEST_P(ServingFaults, NeverMakeUnjustifiedVerdictsFreeAndPass) {
  ServingProgram server(GetParam());
  Checker checker(server.address());
  checker.Note(GetParam());
  EXPECT_TRUE(checker.WaitForFree(1000)) << server.program().Errors();
  EXPECT_TRUE(server.FaultIsDone());
}

INSTANTIATE_TEST_SUITE_P(Of, ServingFaults,
                         testing::Values(absl::StrCat("accept:2:", EMFILE),
                                         absl::StrCat("accept:2:", ECONNABORTED),
                                         absl::StrCat("send:40:", EPIPE),
                                         absl::StrCat("send:60:", ENOBUFS), "send:80:delay",
                                         "clock:400:step", "clock:400:back"),
                         [](const auto& test) {
                           return absl::StrReplaceAll(test.param, {{":", "_"}});
                         });

TEST(DisturbedServer, ThatStandsStillLetsNoVerdictOutliveItsScene) {
  ServingProgram server;
  Checker checker(server.address());
  ASSERT_TRUE(checker.WaitForFree(200));
  for (int i = 0; i < 3; ++i) {
    checker.Note("it is stopped (SIGSTOP)");
    server.program().Signal(SIGSTOP);
    absl::SleepFor(2 * Checker::kMaxAge);
    checker.Note("it goes on (SIGCONT)");
    server.program().Signal(SIGCONT);
    EXPECT_TRUE(checker.WaitForFree(200)) << server.program().Errors();
  }
}

TEST(DisturbedServer, ServesOthersWhateverConnectionsAndSlowWatchersItHas) {
  ServingProgram server;
  Checker checker(server.address());
  ASSERT_TRUE(checker.WaitForFree(200));
  checker.Note("there are 500 silent connections");
  std::vector<int> connections = server.Connect(500);
  EXPECT_TRUE(checker.WaitForFree(200)) << server.program().Errors();
  checker.Note("there are watchers that read nothing");
  for (const int connection : connections) close(connection);
  const SlowWatchers watchers(server.address(), 20);
  EXPECT_TRUE(checker.WaitForFree(500)) << server.program().Errors();
}

// Records are in memory; the index is not, and is read again by and by.
TEST(DisturbedServer, WhoseFileHasFlippedBitsIsRightOrSaysThatItIsDamaged) {
  ServingProgram server;
  Checker checker(server.address());
  ASSERT_TRUE(checker.WaitForFree(200));
  const std::string file = server.database() + "/data.mdb";
  Random random;
  for (size_t meta = 0; meta < 2; ++meta) {
    checker.Note("a bit of a meta page is flipped");
    const size_t at = meta * 4096 + random() % 152;
    FlipBit(file, at, 2);
    server.program().Signal(SIGHUP);
    EXPECT_TRUE(checker.WaitForFree(200)) << server.program().Errors();
    FlipBit(file, at, 2);
  }
  checker.Note("a bit in every page is flipped");
  const size_t pages = fs::file_size(file) / 4096;
  for (size_t page = 2; page < pages; ++page) FlipBit(file, page * 4096 + random() % 4096, 5);
  absl::SleepFor(absl::Seconds(1));
  server.program().Signal(SIGHUP);
  absl::SleepFor(absl::Milliseconds(500));
  checker.Stop();
  EXPECT_EQ(server.program().End(SIGTERM), 0);
}

// For some seconds, or ROBUSTNESS_SECONDS of them (tools/soak).
TEST(DisturbedServer, GrowsNeitherInMemoryNorInDescriptors) {
  const char* const text = std::getenv("ROBUSTNESS_SECONDS");
  const absl::Duration whole = absl::Seconds(text == nullptr ? 4 : std::atoi(text));
  ServingProgram server;
  Checker checker(server.address());
  ASSERT_TRUE(checker.WaitForFree(500));
  const absl::Time start = absl::Now();
  std::optional<std::pair<double, int>> settled;
  std::pair<double, int> now;
  int rounds = 0;
  for (; absl::Now() < start + whole; ++rounds) {
    {
      const std::vector<int> connections = server.Connect(100);
      const SlowWatchers watchers(server.address(), 5);
      ASSERT_TRUE(checker.WaitForFree(100)) << server.program().Errors();
      for (const int connection : connections) close(connection);
    }
    absl::SleepFor(absl::Milliseconds(100));
    now = server.Size();
    if (!settled && absl::Now() > start + whole / 3) settled = now;
  }
  ASSERT_TRUE(settled);
  std::cout << rounds << " rounds, " << checker.free() << " verdicts FREE, " << checker.published()
            << " scenes; memory " << settled->first << " to " << now.first << " MiB, descriptors "
            << settled->second << " to " << now.second << std::endl;
  EXPECT_LE(now.first, settled->first * 1.1 + 8);
  EXPECT_LE(now.second, settled->second + 20);
}

}  // namespace
}  // namespace silhouette
