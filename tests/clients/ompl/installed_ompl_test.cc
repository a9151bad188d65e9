// SPDX-License-Identifier: Apache-2.0
// silhouette::ompl as its users get it: installed, found by CMake, built against, run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/folders.h"
#include "tests/server/service/test_server.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

TEST(InstalledOmpl, PlansInAProjectOfItsOwn) {
  const Shell shell;
  for (const std::string& command :
       {SILHOUETTE_CMAKE " --install " + BuildFolder() + " --component client --prefix prefix",
        SILHOUETTE_CMAKE " -G Ninja -S " + SourceFolder() +
            "/clients/ompl/example -B build -DCMAKE_BUILD_TYPE=Debug "
            "-DCMAKE_PREFIX_PATH=$PWD/prefix "
            "-DCMAKE_CXX_COMPILER=" SILHOUETTE_CXX " '-DCMAKE_CXX_FLAGS=" SILHOUETTE_CXX_FLAGS "'",
        std::string(SILHOUETTE_CMAKE " --build build")}) {
    const Ended ended = shell.Run(command);
    ASSERT_EQ(ended.exit_code, 0) << ended.out << ended.err;
  }
  TestServer server(NewDatabase({}), {}, [](const silhouette::Clock&) { return SystemClock; });
  server.Publish(EmptyCellScene());
  const std::string program = "build/plan_path " + server.server->address();
  const Ended path = shell.Run(program + " 0.4,0.1 3.5,0.5");
  // The scene may have aged meanwhile on a busy computer.
  EXPECT_TRUE(path.exit_code == 0 || path.err.starts_with("unknown")) << path.out << path.err;
}

}  // namespace
}  // namespace silhouette
