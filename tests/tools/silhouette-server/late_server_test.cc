// SPDX-License-Identifier: Apache-2.0
// A client that is there before its server. The server is another process: one in this process
// reads the client's sockets, too, and hides that nothing else does.
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "absl/time/clock.h"
#include "silhouette/client.h"
#include "tests/folders.h"
#include "tests/running_program.h"
#include "tests/server/service/test_server.h"
#include "tests/server/test_cell.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

TEST(LateServer, IsFoundByAClientThatOnlyCallsThoughEachCallBeforeFailedAtOnce) {
  const std::filesystem::path folder = FreshFolder();
  const std::string cell = folder / "cell.yaml";
  std::ofstream(cell) << kServerTestCellFile;
  MakeDatabase(folder / "db", {.cell = DescriptionOf(*LoadCell(cell))});
  const auto start = [&](const std::string& address) {
    return std::make_unique<RunningProgram>(
        std::vector<std::string>{ProgramFolder() + "/silhouette-server", "--cell", cell,
                                 "--database", folder / "db", "--listen", address},
        folder / "out", folder / "err");
  };
  // A port that is free again.
  auto server = start("127.0.0.1:0");
  const std::string address = server->Address();
  server->End(SIGTERM);

  const auto client = client::Client::Connect(address, absl::Seconds(1)).value();
  const auto is_found = [&] { return client.GetDatabase().ok(); };
  EXPECT_FALSE(is_found());
  EXPECT_FALSE(is_found());
  server = start(address);
  ASSERT_EQ(server->Address(), address);
  // An attempt to connect is made every second, at least.
  const absl::Time end = absl::Now() + absl::Seconds(3);
  bool found = false;
  while (!found && absl::Now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    found = is_found();
  }
  EXPECT_TRUE(found);
}

}  // namespace
}  // namespace silhouette
