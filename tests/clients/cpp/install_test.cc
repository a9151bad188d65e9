// SPDX-License-Identifier: Apache-2.0
// The client library as its users get it: installed, found by CMake, built against, run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/clients/cpp/fake_server.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const std::string kInstall = SILHOUETTE_CMAKE " --install " + BuildFolder() +
                             " --component client --prefix prefix && " SILHOUETTE_CMAKE
                             " --install " +
                             BuildFolder() + " --component library --prefix prefix";

// Builds the example by `build`, which makes it from the library in ./prefix, and asks a server.
void ExpectAnswers(const std::string& build, const std::string& program) {
  const Shell shell;
  for (const std::string& command : {kInstall, build}) {
    const Ended ended = shell.Run(command);
    ASSERT_EQ(ended.exit_code, 0) << ended.out << ended.err;
  }
  FakeServer server;
  server.check_configurations = [](auto&, const v1::CheckConfigurationsRequest& request,
                                   v1::CheckConfigurationsResponse& response) {
    response.mutable_basis()->set_scene_id(1);
    response.mutable_basis()->mutable_valid_for()->set_seconds(60);
    const bool free = request.configurations(0).positions(0) > 0;
    response.add_verdicts()->set_state(free ? v1::Verdict::STATE_FREE
                                            : v1::Verdict::STATE_OCCUPIED);
    return grpc::Status::OK;
  };
  const std::string ask = program + " " + server.address;
  const Ended free = shell.Run(ask + " 0.5 0");
  EXPECT_EQ(free.exit_code, 0) << free.err;
  EXPECT_EQ(free.out, "free\n");
  const Ended occupied = shell.Run(ask + " -0.5 0");
  EXPECT_EQ(occupied.exit_code, 1);
  EXPECT_EQ(occupied.out, "occupied\n");
  server.Stop();
  const Ended gone = shell.Run(ask + " 0.5 0");
  EXPECT_EQ(gone.exit_code, 3);
  EXPECT_THAT(gone.err, HasSubstr("no server answers at " + server.address));
}

// The example by CMake; `option`: of its configuration.
std::string ByCMake(const std::string& option) {
  return SILHOUETTE_CMAKE " -G Ninja -S " + SourceFolder() +
         "/clients/cpp/example -B build -DCMAKE_BUILD_TYPE=Debug "
         "-DCMAKE_PREFIX_PATH=$PWD/prefix -DCMAKE_CXX_COMPILER=" SILHOUETTE_CXX
         " '-DCMAKE_CXX_FLAGS=" SILHOUETTE_CXX_FLAGS "' " +
         option + " && " SILHOUETTE_CMAKE " --build build";
}

TEST(InstalledClient, IsFoundAndUsedByAProjectOfItsOwn) {
  ExpectAnswers(ByCMake(""), "build/may_i_go");
}

TEST(InstalledClient, IsASharedLibraryForWhoeverAsksForOne) {
  ExpectAnswers(ByCMake("-DBUILD_SHARED_LIBS=ON") +
                    " && readelf -d build/may_i_go | grep -q 'NEEDED.*libsilhouette.so'",
                "build/may_i_go");
}

TEST(InstalledClient, IsFoundByPkgConfig) {
  ExpectAnswers("PKG_CONFIG_PATH=$PWD/prefix/lib/pkgconfig; export PKG_CONFIG_PATH; " SILHOUETTE_CXX
                " -std=c++20 " SILHOUETTE_CXX_FLAGS " " +
                    SourceFolder() +
                    "/clients/cpp/example/may_i_go.cc $(pkg-config --cflags --libs silhouette) "
                    "-o may_i_go",
                "LD_LIBRARY_PATH=$PWD/prefix/lib ./may_i_go");
}

TEST(InstalledClient, HeadersIncludeOnlyWhatIsInstalled) {
  const Shell shell;
  const Ended install = shell.Run(kInstall);
  ASSERT_EQ(install.exit_code, 0) << install.err;
  int headers = 0;
  const std::filesystem::path folder = shell.folder() / "prefix" / "include" / "silhouette";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".h") continue;
    ++headers;
    for (const char* source : {"db/", "proto/", "clients/", "server/", "tools/"}) {
      EXPECT_THAT(ContentOf(entry.path()), Not(HasSubstr(std::string("#include \"") + source)));
    }
  }
  EXPECT_GE(headers, 11);
}

}  // namespace
}  // namespace silhouette
