// SPDX-License-Identifier: Apache-2.0
// A silhouette-server as a user starts it, for tests.
#pragma once

#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>

#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/files/calibration_message.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "tests/folders.h"
#include "tests/running_program.h"
#include "tests/server/test_cell.h"
#include "tests/shell.h"
#include "tests/test_folder.h"
#include "tools/cell/cell.h"

namespace silhouette {

// A running silhouette-server.
struct ServerProgram : RunningProgram {
  ServerProgram(const std::filesystem::path& folder, std::vector<std::string> arguments)
      : RunningProgram((arguments.insert(arguments.begin(), ProgramFolder() + "/silhouette-server"),
                        arguments),
                       folder / "out", folder / "err") {}
};

struct ServerProgramTest : ::testing::Test {
  const std::filesystem::path folder = FreshFolder();
  std::string cell = folder / "cell.yaml";
  std::string database = folder / "db";

  void SetUp() override {
    WriteFile(cell, kServerTestCellFile);
    MakeDatabase(database, {.missing = {{0, 7}}, .cell = DescriptionOf(*LoadCell(cell))});
  }

  // The cell with a model whose one link has a mesh that is not closed, and a database with
  // cameras. `in_robot`: further lines of the cell file's section `robot`; `rest`: further
  // sections.
  void GiveModelAndCameras(const std::string& in_robot, const std::string& rest) {
    WriteFile(folder / "lid.obj",
              "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n");
    const char* limit = "<limit lower='-4' upper='4' effort='1' velocity='1'/></joint>";
    WriteFile(
        folder / "robot.urdf",
        absl::StrCat("<robot name='r'><link name='base'/><link name='x'/><link name='y'/>"
                     "<link name='lid'><visual><geometry><mesh filename='lid.obj'/>"
                     "</geometry></visual></link><joint name='lift' type='prismatic'>"
                     "<parent link='base'/><child link='x'/>",
                     limit, "<joint name='a' type='prismatic'><parent link='x'/><child link='y'/>",
                     limit,
                     "<joint name='b' type='continuous'><parent link='y'/>"
                     "<child link='lid'/></joint></robot>"));
    std::string text = kServerTestCellFile;
    text.replace(text.find("  joints:"), 0, "  urdf: robot.urdf\n" + in_robot);
    text = std::regex_replace(text, std::regex("mask_size"), "image_size: [64, 48], mask_size");
    text += rest;
    WriteFile(cell, text);
    database = folder / "with-cameras";
    MakeDatabase(database, {.cell = DescriptionOf(*LoadCell(cell))});
    storage::v1::Calibration calibration;
    for (size_t view = 0; view < kViewSizes.size(); ++view) {
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.translation() = Eigen::Vector3d(0, 0.1 * static_cast<double>(view), 8);
      CameraIntrinsics in{.width = 64, .height = 48};
      in.fx = in.fy = 40;
      in.cx = 31.5;
      in.cy = 23.5;
      *calibration.add_cameras() = MessageOf(CameraModel(in, pose));
    }
    ASSERT_TRUE((*Database::Open(database, Database::Access::kWrite))
                    ->SetCalibration(calibration, "test")
                    .ok());
  }

  // Exit code of a start that does not succeed, its one sentence in `errors`.
  int Refused(const std::vector<std::string>& arguments) {
    ServerProgram program(folder, arguments);
    const int code = program.ExitCode();
    EXPECT_EQ(program.Output(), "");
    errors = program.Errors();
    return code;
  }
  std::string errors;
};

inline v1::GetDatabaseResponse DatabaseAt(const std::string& address) {
  const auto stub = v1::DatabaseService::NewStub(
      grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  v1::GetDatabaseResponse response;
  const grpc::Status status = stub->GetDatabase(&context, {}, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response;
}

}  // namespace silhouette
