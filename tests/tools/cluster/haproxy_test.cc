// SPDX-License-Identifier: Apache-2.0
// Two servers of one snapshot of a database behind a real HAProxy, with tools/cluster/haproxy.cfg.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "silhouette/client.h"
#include "silhouette/messages.h"
#include "tests/folders.h"
#include "tests/running_program.h"
#include "tests/tools/silhouette/small_served_cell.h"

namespace silhouette {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;

// A port that is free now.
int FreePort() {
  const int probe = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  EXPECT_EQ(bind(probe, reinterpret_cast<sockaddr*>(&address), size), 0);
  EXPECT_EQ(getsockname(probe, reinterpret_cast<sockaddr*>(&address), &size), 0);
  close(probe);
  return ntohs(address.sin_port);
}

struct Call {
  SteadyTime asked;
  absl::Status status;
  bool right = false;  // the verdicts that both servers give
};

// Threads that ask without pause, one call at a time each.
class Load {
 public:
  Load(const Client& client, size_t threads) {
    for (size_t i = 0; i < threads; ++i) {
      threads_.emplace_back([this, caller = client] {
        while (!stop_) {
          Call call;
          call.asked = std::chrono::steady_clock::now();
          const auto checks = caller.CheckConfigurations({{0.9, 0.9}, {0.6, 0.1}});
          call.status = checks.status();
          if (checks.ok()) {
            call.right =
                checks->verdicts[0].free() && checks->verdicts[1].state == client::State::kOccupied;
          }
          const std::lock_guard lock(mutex_);
          calls_.push_back(call);
        }
      });
    }
  }
  std::vector<Call> Finish() {
    stop_ = true;
    threads_.clear();
    return calls_;
  }
  size_t count() {
    const std::lock_guard lock(mutex_);
    return calls_.size();
  }
  // Waits for more calls.
  void Await(size_t more) {
    const size_t goal = count() + more;
    while (count() < goal) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }

 private:
  std::atomic<bool> stop_ = false;
  std::mutex mutex_;
  std::vector<Call> calls_;
  std::vector<std::jthread> threads_;
};

struct HaproxyTest : testing::Test {
  void SetUp() override {
    if (std::system("PATH=$PATH:/usr/sbin command -v haproxy >/dev/null") != 0) {
      GTEST_SKIP() << "haproxy is not installed (tools/install-packages): several servers behind "
                   << "one address were not tested";
    }
    cell.StopServer();
    const Ended snapshot =
        cell.shell().Run(ProgramFolder() + "/silhouette-db compact cell.lmdb snapshot.lmdb");
    ASSERT_EQ(snapshot.exit_code, 0) << snapshot.err;
    for (size_t i = 0; i < 2; ++i) {
      servers[i] = NewServer(absl::StrCat("server", i), "127.0.0.1:0");
      addresses[i] = servers[i]->Address();
    }
    for (const std::string& address : addresses) Publish(address);
    port = absl::StrCat("127.0.0.1:", FreePort());
    proxy = std::make_unique<RunningProgram>(
        std::vector<std::string>{"/usr/bin/env", "PLANNERS=" + port, "SERVER_A=" + addresses[0],
                                 "SERVER_B=" + addresses[1], "PATH=/usr/sbin:/usr/bin:/bin",
                                 "haproxy", "-db", "-f",
                                 SourceFolder() + "/tools/cluster/haproxy.cfg"},
        folder() / "haproxy.out", folder() / "haproxy.err");
    // A new connection each time: one that was refused is not tried again at once.
    const SteadyTime end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    absl::Status status;
    do {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      status = Client::Connect(port, absl::Seconds(5))->GetDatabase().status();
    } while (!status.ok() && std::chrono::steady_clock::now() < end);
    ASSERT_TRUE(status.ok()) << status << proxy->Errors();
  }

  const std::filesystem::path& folder() const { return cell.shell().folder(); }

  std::unique_ptr<RunningProgram> NewServer(const std::string& name,
                                            const std::string& listen) const {
    return std::make_unique<RunningProgram>(
        std::vector<std::string>{ProgramFolder() + "/silhouette-server", "--cell",
                                 (folder() / "cell.yaml").string(), "--database",
                                 (folder() / "snapshot.lmdb").string(), "--listen", listen},
        folder() / (name + ".out"), folder() / (name + ".err"));
  }

  // A wall, and the robot at (0, 0), to one server.
  Ended TryPublish(const std::string& address) const {
    WriteMask(folder() / "left.png", kWall | RobotAt(0, 0));
    WriteMask(folder() / "right.png", kWall | RobotAt(0, 0));
    return cell.shell().Run("SILHOUETTE_SERVER=" + address + " " + ProgramFolder() +
                            "/silhouette scene publish --as mask --view left=left.png --view "
                            "right=right.png --joint x=0 --joint y=0");
  }
  void Publish(const std::string& address) const {
    const Ended published = TryPublish(address);
    ASSERT_EQ(published.exit_code, 0) << published.err;
  }

  SmallServedCell cell;
  std::unique_ptr<RunningProgram> servers[2];
  std::string addresses[2];
  std::string port;
  std::unique_ptr<RunningProgram> proxy;
};

TEST_F(HaproxyTest, ServerThatIsKilledUnderLoadFailsNoCallBeyondThoseInFlight) {
  constexpr size_t kThreads = 4;
  const auto client = Client::Connect(port, absl::Seconds(10));
  ASSERT_TRUE(client.ok());
  Load load(*client, kThreads);
  load.Await(2000);
  servers[0]->End(SIGKILL);
  const SteadyTime dead = std::chrono::steady_clock::now();
  load.Await(2000);
  const std::vector<Call> calls = load.Finish();
  size_t failed = 0;
  size_t after = 0;
  for (const Call& call : calls) {
    after += call.asked > dead ? 1 : 0;
    if (call.status.ok()) {
      EXPECT_TRUE(call.right);
      continue;
    }
    ++failed;
    EXPECT_LE(call.asked, dead) << call.status;
  }
  RecordProperty("calls", static_cast<int>(calls.size()));
  RecordProperty("failed", static_cast<int>(failed));
  EXPECT_LE(failed, kThreads);
  EXPECT_GE(after, 1000u);
}

TEST_F(HaproxyTest, CallsAreBalancedSinglyAndAServerThatIsBackTakesSome) {
  const auto client = Client::Connect(port, absl::Seconds(10));
  ASSERT_TRUE(client.ok());
  // One connection, and answers from both.
  servers[1]->End(SIGKILL);
  servers[1] = NewServer("again", addresses[1]);
  servers[1]->Address();  // without a scene: all is unknown there
  size_t of[2] = {0, 0};
  const SteadyTime end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while ((of[0] < 20 || of[1] < 20) && std::chrono::steady_clock::now() < end) {
    const auto checks = client->CheckConfigurations({{0.9, 0.9}});
    if (checks.ok()) ++of[checks->verdicts[0].free() ? 0 : 1];
  }
  EXPECT_GE(of[0], 20u);
  EXPECT_GE(of[1], 20u);
}

TEST_F(HaproxyTest, CallsThatBelongToOneServerAreRefused) {
  const Ended published = TryPublish(port);
  EXPECT_NE(published.exit_code, 0) << published.out;
}

}  // namespace
}  // namespace silhouette
