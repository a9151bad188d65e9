// SPDX-License-Identifier: Apache-2.0
// What silhouette-server refuses as the user's mistake.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/server/test_cell.h"
#include "tests/test_folder.h"
#include "tests/tools/silhouette-server/server_program.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST_F(ServerProgramTest, WorkspaceThatTheRobotLeavesRefusesToStart) {
  const std::string box = "workspace: {lower: [-6, -6, -6], upper: [2, 6, 6]}\n";
  GiveModelAndCameras("", "");
  std::ifstream file(cell);
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  for (const char* use : {"sound: {least_obstacle: 0.5, voxel_edge: 0.4}\n", "margin: 5 cm\n"}) {
    WriteFile(cell, text + use + box);
    EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
    EXPECT_THAT(errors, AllOf(HasSubstr(cell), HasSubstr("'lid' is 3.5"),
                              HasSubstr("m beyond the upper face of 'workspace' across x at a = 4"),
                              HasSubstr("enlarge 'workspace'")));
  }
}

TEST_F(ServerProgramTest, PortInUseIsTheUsersMistake) {
  ServerProgram first(folder, {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  const std::string address = first.Address();
  const std::filesystem::path other = FreshFolder();
  ServerProgram second(other, {"--cell", cell, "--database", database, "--listen", address});
  EXPECT_EQ(second.ExitCode(), 2);
  EXPECT_THAT(second.Errors(),
              AllOf(HasSubstr("silhouette-server: cannot listen on " + address + ": port "),
                    HasSubstr("in use"), HasSubstr("choose another port")));
  EXPECT_EQ(second.Output(), "");
}

TEST_F(ServerProgramTest, MissingDatabaseIsRefusedWithTheCommandThatBeginsOne) {
  const std::string missing = database + "/none.lmdb";
  WriteFile(cell, std::string(kServerTestCellFile) + "server: {max_age: 500}\n");
  EXPECT_EQ(Refused({"--cell", cell, "--database", missing}), 2);
  EXPECT_EQ(std::ranges::count(errors, '\n'), 1) << "doubts of the cell come later: " << errors;
  EXPECT_THAT(errors, AllOf(HasSubstr("there is no database in '" + missing + "'"),
                            HasSubstr("silhouette-capture reference --database " + missing +
                                      " --cell " + cell)));
}

TEST_F(ServerProgramTest, DatabaseOfAnotherCellIsTheUsersMistake) {
  std::string text = kServerTestCellFile;
  text.replace(text.find("a: 5"), 4, "a: 9");
  WriteFile(cell, text);
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
  EXPECT_THAT(errors, AllOf(HasSubstr(database), HasSubstr(cell),
                            HasSubstr("joint 'a': steps is 9 in the cell file, 5 in the "
                                      "database")));
}

TEST_F(ServerProgramTest, PolicyThatTheDatabaseCannotServeIsTheUsersMistake) {
  WriteFile(cell, std::string(kServerTestCellFile) + "policy: {preset: calibrated}\n");
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
  EXPECT_THAT(errors, AllOf(HasSubstr(cell), HasSubstr(database),
                            HasSubstr("'calibrated' needs a calibration"),
                            HasSubstr("silhouette-db calibration import")));
}

TEST_F(ServerProgramTest, MetreMarginWithoutCameraModelsRefusesToStart) {
  const std::string workspace = "workspace: {lower: [-1, -1, 0], upper: [1, 1, 1]}\n";
  WriteFile(cell, std::string(kServerTestCellFile) + "margin: 5 cm\n" + workspace);
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
  EXPECT_THAT(errors, AllOf(HasSubstr(cell), HasSubstr("view 'left'"), HasSubstr("camera models"),
                            HasSubstr("silhouette-db calibration import")));
  WriteFile(cell, std::string(kServerTestCellFile) + "margin: 5 cm\n");
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
  EXPECT_THAT(errors, HasSubstr("workspace"));
}

TEST_F(ServerProgramTest, CalibrationForOtherImagesIsTheUsersMistake) {
  {
    const auto opened = Database::Open(database, Database::Access::kWrite);
    ASSERT_TRUE((*opened)->SetCalibration(TestCalibration(), "test").ok());
  }
  ServerProgram program(folder, {"--cell", cell, "--database", database, "--listen",
                                 "unix:" + (folder / "s").string()});
  EXPECT_TRUE(DatabaseAt(program.Address()).calibrated());
  // The cell file speaks of images of another size than those that the database was made for.
  std::string text = kServerTestCellFile;
  text.replace(text.find("[16, 12]"), 8, "[16, 12], image_size: [640, 480]");
  WriteFile(cell, text);
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
  EXPECT_THAT(errors, HasSubstr("view 'left'"));
}

TEST_F(ServerProgramTest, DatabaseThatIsNotThereIsTheUsersMistake) {
  EXPECT_EQ(Refused({"--cell", cell, "--database", folder / "nothing"}), 2);
  EXPECT_THAT(errors, AllOf(StartsWith("silhouette-server: "), HasSubstr(folder / "nothing")));
}

TEST_F(ServerProgramTest, FolderThatIsNoDatabaseIsTheUsersMistake) {
  std::filesystem::create_directories(folder / "foreign");
  WriteFile(folder / "foreign/data.mdb", std::string(20'000, 'x'));
  EXPECT_EQ(Refused({"--cell", cell, "--database", folder / "foreign"}), 2);
  EXPECT_THAT(errors, HasSubstr(folder / "foreign"));
}

TEST_F(ServerProgramTest, PlainTextForOtherMachinesIsRefusedUnlessAskedFor) {
  EXPECT_EQ(Refused({"--cell", cell, "--database", database, "--listen", "0.0.0.0:0"}), 2);
  EXPECT_THAT(errors,
              AllOf(HasSubstr("will not speak plain text on 0.0.0.0:0"), HasSubstr("--insecure")));
  ServerProgram program(
      folder, {"--cell", cell, "--database", database, "--listen", "0.0.0.0:0", "--insecure"});
  EXPECT_THAT(program.Address(), StartsWith("0.0.0.0:"));
}

TEST_F(ServerProgramTest, WrongCommandLinesAreTheUsersMistake) {
  EXPECT_EQ(Refused({}), 2);
  EXPECT_THAT(errors, HasSubstr("--cell"));
  EXPECT_EQ(Refused({"--cell", cell, "--robot-image-memory", "8"}), 2);
  EXPECT_THAT(errors, HasSubstr("'8' is no size with its unit"));
  EXPECT_EQ(Refused({"--cell", cell, "--database", database, "--page", "nonsense"}), 2);
  EXPECT_THAT(errors, HasSubstr("'nonsense' is not host:port, as in 127.0.0.1:50051 or [::1]"));
  EXPECT_EQ(Refused({"--cell", folder / "nothing.yaml", "--database", database}), 2);
  EXPECT_THAT(errors, HasSubstr("nothing.yaml"));
  EXPECT_EQ(Refused({"--cell", cell}), 2);
  EXPECT_THAT(errors, HasSubstr("--database DIR"));
  EXPECT_EQ(Refused({"--cell", cell, "--database", database, "--listen", "here"}), 2);
  EXPECT_THAT(errors, HasSubstr("'here'"));
  EXPECT_EQ(Refused({"--cell", cell, "--database", database, "--listen", "unix:/no/such/s"}), 2);
  WriteFile(cell, std::string(kServerTestCellFile) + "vews: 3\n");
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
  EXPECT_THAT(errors, HasSubstr("cell.yaml:13: unknown key 'vews'"));
}

}  // namespace
}  // namespace silhouette
