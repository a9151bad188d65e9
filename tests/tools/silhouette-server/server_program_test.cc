// SPDX-License-Identifier: Apache-2.0
// silhouette-server as a user starts it.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>
#include <thread>
#include <vector>

#include "absl/strings/str_split.h"
#include "calib/files/calibration_message.h"
#include "common/recording/recorder.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"
#include "tests/db/store/full_disk.h"
#include "tests/folders.h"
#include "tests/running_program.h"
#include "tests/server/service/raw_call.h"
#include "tests/server/service/test_server.h"
#include "tests/server/test_cell.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pair;
using ::testing::StartsWith;

void WriteFile(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

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

v1::GetDatabaseResponse DatabaseAt(const std::string& address) {
  const auto stub = v1::DatabaseService::NewStub(
      grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  v1::GetDatabaseResponse response;
  const grpc::Status status = stub->GetDatabase(&context, {}, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response;
}

TEST_F(ServerProgramTest, ServesUntilSigtermAndEndsWithZero) {
  for (int signal : {SIGTERM, SIGINT}) {
    ServerProgram program(folder,
                          {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
    const std::string address = program.Address();
    EXPECT_THAT(address, StartsWith("127.0.0.1:"));
    EXPECT_EQ(DatabaseAt(address).captured(), 39u);
    EXPECT_THAT(program.Errors(), AllOf(HasSubstr("1 configuration without a robot image"),
                                        HasSubstr("preset 'uncalibrated': an obstacle of any size"),
                                        HasSubstr("no reference images")));
    program.Signal(signal);
    EXPECT_EQ(program.ExitCode(), 0);
    EXPECT_THAT(program.Errors(), HasSubstr("stopped"));
  }
}

// What a program tells systemd (sd_notify(3)).
class Notifications {
 public:
  explicit Notifications(const std::string& path) {
    sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
    path.copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    constexpr timeval kPatience{.tv_sec = 30, .tv_usec = 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof(kPatience));
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
    setenv("WATCHDOG_USEC", "300000", 1);
  }
  ~Notifications() {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    close(socket_);
  }

  std::string Next() {
    char text[256];
    const ssize_t length = recv(socket_, text, sizeof(text), 0);
    return {text, static_cast<size_t>(std::max<ssize_t>(length, 0))};
  }

 private:
  const int socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
};

TEST_F(ServerProgramTest, TellsSystemdThatItIsReadyThatItLivesAndThatItStops) {
  Notifications notifications(folder / "notify");
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  EXPECT_EQ(notifications.Next(), "READY=1");
  for (int i = 0; i < 3; ++i) EXPECT_EQ(notifications.Next(), "WATCHDOG=1");
  program.Signal(SIGTERM);
  std::string last;
  while ((last = notifications.Next()) == "WATCHDOG=1") continue;
  EXPECT_EQ(last, "STOPPING=1");
  EXPECT_EQ(program.ExitCode(), 0);
}

// Waits until a program reads this FIFO; returns the writing end.
int AwaitReader(const std::string& fifo) {
  for (;;) {
    const int writer = open(fifo.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    if (writer >= 0) return writer;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

TEST_F(ServerProgramTest, EndsAtOnceWithZeroWhileItStillLoads) {
  // A cell file whose end never comes.
  std::filesystem::remove(cell);
  ASSERT_EQ(mkfifo(cell.c_str(), 0600), 0);
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  const int writer = AwaitReader(cell);
  EXPECT_EQ(program.End(SIGTERM), 0);
  EXPECT_EQ(program.Errors(), "");
  close(writer);
}

TEST_F(ServerProgramTest, EndsThoughAThreadOfItsOwnHangs) {
  const std::string check = folder / "check.json";
  WriteFile(check, "");
  ServerProgram program(folder, {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0",
                                 "--calibration-check", check});
  EXPECT_NE(program.Address(), "");
  // A file whose end never comes, like one of a server that is gone.
  const std::string endless = folder / "endless";
  ASSERT_EQ(mkfifo(endless.c_str(), 0600), 0);
  std::filesystem::rename(endless, check);
  const int writer = AwaitReader(check);
  EXPECT_EQ(program.End(SIGTERM), 3);
  EXPECT_THAT(program.Errors(), HasSubstr("ended while something hangs"));
  close(writer);
}

TEST_F(ServerProgramTest, NamesTheLinksWhoseMeshesAreNotClosedToTheSoundPresets) {
  GiveModelAndCameras("", "sound: {least_obstacle: 0.5, voxel_edge: 0.4}\n");
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  EXPECT_THAT(program.Address(), StartsWith("127.0.0.1:"));
  EXPECT_THAT(program.Errors(), HasSubstr("the meshes of link 'lid' are not closed: an obstacle "
                                          "may be inside, so that the sound presets may block"));
}

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

TEST_F(ServerProgramTest, WarnsOfImagesThatMayBeOldOrFarApart) {
  WriteFile(cell, std::string(kServerTestCellFile) + "server: {max_age: 500, max_skew: 50}\n");
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  EXPECT_THAT(program.Address(), StartsWith("127.0.0.1:"));
  EXPECT_THAT(program.Errors(), AllOf(HasSubstr("images 8 min 20 s old; a number without a unit"),
                                      HasSubstr("images 50 s apart")));
}

TEST_F(ServerProgramTest, DrawnImagesOfAModelThatIsNotVerifiedAreServedOnlyOnDemand) {
  GiveModelAndCameras("  images: drawn\n", "");
  std::vector<std::string> arguments{"--cell", cell,       "--database",
                                     database, "--listen", "127.0.0.1:0"};
  EXPECT_EQ(Refused(arguments), 2);
  EXPECT_THAT(errors, AllOf(HasSubstr("drawn from a model that is not verified: no captured"),
                            HasSubstr("silhouette-capture verify-model --cell")));
  arguments.push_back("--unverified");
  ServerProgram program(folder, arguments);
  EXPECT_EQ(DatabaseAt(program.Address()).images(), "drawn");
  EXPECT_THAT(program.Errors(), HasSubstr("robot images are drawn"));
}

TEST_F(ServerProgramTest, ListensOnAUnixSocketAndTakesItOverFromADeadServer) {
  const std::string address = "unix:" + (folder / "socket").string();
  for (int round = 0; round < 2; ++round) {
    ServerProgram program(folder, {"--cell", cell, "--database", database, "--listen", address});
    EXPECT_EQ(program.Address(), address);
    EXPECT_EQ(DatabaseAt(address).cell_name(), "server test");
    program.Signal(SIGKILL);
    EXPECT_EQ(program.ExitCode(), -1);
  }
}

TEST_F(ServerProgramTest, CellFileSaysDatabaseAndAddress) {
  WriteFile(cell,
            std::string(kServerTestCellFile) + "database: db\nserver: {listen: '127.0.0.1:0'}\n");
  ServerProgram program(folder, {"--cell", cell});
  EXPECT_EQ(DatabaseAt(program.Address()).configurations(), 40u);
}

TEST_F(ServerProgramTest, RobotImagesStayInTheDatabaseIfTheyTakeMoreMemoryThanTheyMay) {
  const std::vector<std::string> start = {"--cell", cell,       "--database",
                                          database, "--listen", "127.0.0.1:0"};
  const auto log_of = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = start;
    arguments.insert(arguments.end(), more.begin(), more.end());
    ServerProgram server(folder, arguments);
    EXPECT_NE(server.Address(), "");
    return server.Errors();
  };
  const std::string in_memory = "robot images: 0.00 GB, in memory";
  const std::string in_place = "read from '" + database + "' when needed";
  EXPECT_THAT(log_of({}), AllOf(HasSubstr(in_memory), Not(HasSubstr(in_place))));
  EXPECT_THAT(log_of({"--robot-image-memory", "1kB"}), HasSubstr(in_place));
  WriteFile(cell, std::string(kServerTestCellFile) + "server: {robot_image_memory: 0 B}\n");
  EXPECT_THAT(log_of({}), HasSubstr(in_place));
  EXPECT_THAT(log_of({"--robot-image-memory", "1GB"}), HasSubstr(in_memory));
}

TEST_F(ServerProgramTest, SighupReadsTheDatabaseAnew) {
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  const std::string address = program.Address();
  const uint64_t before = DatabaseAt(address).generation();
  {
    const auto opened = Database::Open(database, Database::Access::kWrite);
    auto writer = (*opened)->Write("test");
    ASSERT_TRUE(writer->Put(TestRobotImage((*opened)->grid(), 0, 7)).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  EXPECT_EQ(DatabaseAt(address).generation(), before) << "not before it is told to";
  program.Signal(SIGHUP);
  for (int i = 0; i < 1000 && DatabaseAt(address).generation() == before; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(DatabaseAt(address).captured(), 40u);
}

TEST_F(ServerProgramTest, SighupSaysThatAChangedCellFileNeedsARestart) {
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  program.Address();
  const auto reload = [&](size_t times) {
    program.Signal(SIGHUP);
    const auto reloads = [&] {
      const std::vector<std::string> parts = absl::StrSplit(program.Errors(), "reloaded; ");
      return parts.size() - 1;
    };
    for (int i = 0; i < 1000 && reloads() < times; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_EQ(reloads(), times);
  };
  reload(1);
  EXPECT_THAT(program.Errors(), testing::Not(HasSubstr("restart the server")));
  WriteFile(cell, std::string(kServerTestCellFile) + "margin: 5 px\n");
  reload(2);
  EXPECT_THAT(program.Errors(), HasSubstr("has changed, and its former settings still hold: "
                                          "restart the server"));
}

TEST_F(ServerProgramTest, SighupWithADatabaseThatCannotBeReadServesTheOldStateOn) {
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  const std::string address = program.Address();
  std::filesystem::rename(database, folder / "away");
  program.Signal(SIGHUP);
  for (int i = 0; i < 1000 && program.Errors().find("not reloaded") == std::string::npos; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_THAT(program.Errors(), HasSubstr("not reloaded"));
  EXPECT_EQ(DatabaseAt(address).captured(), 39u);
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
  EXPECT_EQ(Refused({"--cell", cell, "--database", missing}), 2);
  EXPECT_THAT(errors, AllOf(HasSubstr("there is no database in '" + missing + "'"),
                            HasSubstr("silhouette-capture reference --cell " + cell)));
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

TEST_F(ServerProgramTest, TakesMarginsAndIgnoredPixelsFromTheCellFile) {
  std::string text = kServerTestCellFile;
  text.replace(text.find("[16, 12]}"), 9, "[16, 12], ignore: pillar.png}");
  WriteFile(cell, text + "margin: 1.5 px\n");
  cv::Mat pillar(12, 16, CV_8UC1, cv::Scalar(0));
  pillar.col(4) = 255;
  WriteFile(folder / "pillar.png", PngOf(pillar));
  {
    ServerProgram program(folder, {"--cell", cell, "--database", database, "--listen",
                                   "unix:" + (folder / "s").string()});
    const v1::GetDatabaseResponse served = DatabaseAt(program.Address());
    EXPECT_EQ(served.views(0).ignored_pixels(), 12u);
    EXPECT_EQ(served.views(1).ignored_pixels(), 0u);
    EXPECT_EQ(served.views(1).margin(), 1.5);
    EXPECT_THAT(program.Errors(), AllOf(HasSubstr("view 'left': margin of 1.50 pixels"),
                                        HasSubstr("view 'left': 12 pixels ignored")));
  }
  WriteFile(folder / "pillar.png", PngOf(cv::Mat(5, 5, CV_8UC1, cv::Scalar(0))));
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
  EXPECT_THAT(errors, AllOf(HasSubstr("view 'left': ignore: "), HasSubstr("5x5 pixels large"),
                            HasSubstr("16x12")));
  const std::vector<std::pair<int, std::string>> wrong = {{1, "neither black (0) nor white (255)"},
                                                          {255, "white everywhere"}};
  for (const auto& [value, message] : wrong) {
    WriteFile(folder / "pillar.png", PngOf(cv::Mat(12, 16, CV_8UC1, cv::Scalar(value))));
    EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
    EXPECT_THAT(errors, AllOf(HasSubstr("view 'left': ignore: "), HasSubstr(message)));
  }
  WriteFile(folder / "pillar.png", "no image");
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
  EXPECT_THAT(errors, HasSubstr("it is not an image"));
  std::remove((folder / "pillar.png").c_str());
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 2);
  EXPECT_THAT(errors, HasSubstr("pillar.png"));
}

TEST_F(ServerProgramTest, TellsInItsLogWhoAllowsARegionAndWhenItEnds) {
  ServerProgram program(folder, {"--cell", cell, "--database", database, "--listen",
                                 "unix:" + (folder / "s").string()});
  const auto stub = v1::SceneService::NewStub(
      grpc::CreateChannel(program.Address(), grpc::InsecureChannelCredentials()));
  const auto allow = [&](const std::string& name, int milliseconds) {
    v1::AllowRegionRequest request;
    request.set_name(name);
    request.mutable_duration()->set_seconds(milliseconds / 1000);
    request.mutable_duration()->set_nanos(milliseconds % 1000 * 1'000'000);
    v1::RegionPixels& pixels = *request.add_views();
    pixels.set_view("top");
    for (const auto& [x, y] : {std::pair(0, 0), {2, 0}, {2, 2}, {0, 2}}) {
      v1::Point& corner = *pixels.mutable_polygon()->add_corners();
      corner.set_x(x);
      corner.set_y(y);
    }
    grpc::ClientContext context;
    v1::AllowRegionResponse response;
    const grpc::Status status = stub->AllowRegion(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
  };
  allow("part", 200);
  allow("other", 60'000);
  grpc::ClientContext context;
  v1::RevokeRegionRequest request;
  request.set_name("other");
  v1::RevokeRegionResponse response;
  ASSERT_TRUE(stub->RevokeRegion(&context, request, &response).ok());
  for (int i = 0; i < 1000 && program.Errors().find("has ended") == std::string::npos; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_THAT(
      program.Errors(),
      AllOf(HasSubstr("allows region 'part' for 200ms: 9 pixels in 'top'"),
            HasSubstr("allowed region 'part' has ended"), HasSubstr("revokes region 'other'")));
  EXPECT_THAT(program.Errors(), Not(HasSubstr("region 'other' has ended")));
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

TEST_F(ServerProgramTest, TruncatedDatabaseIsTold) {
  const std::string file = database + "/data.mdb";
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  EXPECT_EQ(Refused({"--cell", cell, "--database", database}), 3);
  EXPECT_THAT(errors, HasSubstr(database));
}

TEST_F(ServerProgramTest, PlainTextForOtherMachinesIsRefusedUnlessAskedFor) {
  EXPECT_EQ(Refused({"--cell", cell, "--database", database, "--listen", "0.0.0.0:0"}), 2);
  EXPECT_THAT(errors,
              AllOf(HasSubstr("will not speak plain text on 0.0.0.0:0"), HasSubstr("--insecure")));
  ServerProgram program(
      folder, {"--cell", cell, "--database", database, "--listen", "0.0.0.0:0", "--insecure"});
  EXPECT_THAT(program.Address(), StartsWith("0.0.0.0:"));
}

TEST_F(ServerProgramTest, CertificatesOfTheToolLetAPlannerCheckAndNotPublish) {
  const std::string made =
      SourceFolder() + "/tools/certificates '" + folder.string() + "' 127.0.0.1 > /dev/null";
  ASSERT_EQ(std::system(made.c_str()), 0);
  WriteFile(cell,
            absl::StrCat(kServerTestCellFile,
                         "server: {tls: {certificate: server.pem, key: server.key, client_ca: "
                         "ca.pem}, roles: {planner: [planner]}, audit: audit.jsonl}\n"));
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  const std::string client =
      absl::StrCat("cd '", folder.string(), "' && ", ProgramFolder(), "/silhouette --server ",
                   program.Address(), " > client.out 2>&1 ");
  const std::string tls = "--tls-ca ca.pem --tls-certificate planner.pem --tls-key planner.key ";
  const auto run = [&](const std::string& arguments) {
    const int status = std::system((client + arguments).c_str());
    std::ostringstream text;
    text << std::ifstream(folder / "client.out").rdbuf();
    return std::pair(WEXITSTATUS(status), text.str());
  };
  EXPECT_THAT(run(tls + "check 1,0"), Pair(1, HasSubstr("no scene")));
  EXPECT_THAT(run(tls + "region revoke part"),
              Pair(2, HasSubstr("which needs the role operator: it has the role planner")));
  EXPECT_THAT(run("check 1,0"), Pair(3, HasSubstr("no server answers")));
  EXPECT_THAT(run("--tls-ca ca.pem check 1,0"), Pair(2, HasSubstr("needs three files")));
  program.Signal(SIGHUP);
  while (program.Errors().find("reloaded") == std::string::npos) std::this_thread::yield();
  EXPECT_THAT(program.Errors(), HasSubstr("server.pem' is valid until"));
  EXPECT_EQ(program.End(SIGTERM), 0);
  const std::string verify = absl::StrCat(ProgramFolder(), "/silhouette-db audit verify ",
                                          (folder / "audit.jsonl").string(), " > /dev/null");
  EXPECT_EQ(std::system(verify.c_str()), 0);
  std::ofstream(folder / "audit.jsonl", std::ios::app) << "{}\n";
  EXPECT_EQ(WEXITSTATUS(std::system(verify.c_str())), 1);
}

// A server of a database with a collision index, and scenes for it.
struct DamagedFileTest : ServerProgramTest {
  void SetUp() override {
    ServerProgramTest::SetUp();
    database = folder / "indexed";
    MakeDatabase(database, {.index = true, .cell = DescriptionOf(*LoadCell(cell))});
    program.emplace(folder, std::vector<std::string>{"--cell", cell, "--database", database,
                                                     "--listen", "127.0.0.1:0"});
    channel = grpc::CreateChannel(program->Address(), grpc::InsecureChannelCredentials());
  }

  // A scene with a block, and its map.
  v1::GetConfigurationSpaceResponse NewMap() {
    SceneInput input = SceneWithBlock(3);
    for (ViewInput& view : input.views) view.captured = SystemClock();
    grpc::ClientContext publishing, asking;
    v1::PublishSceneResponse published;
    const grpc::Status status =
        v1::SceneService::NewStub(channel)->PublishScene(&publishing, RequestOf(input), &published);
    EXPECT_TRUE(status.ok()) << status.error_message();
    v1::GetConfigurationSpaceResponse map;
    const auto reader = v1::CollisionService::NewStub(channel)->GetConfigurationSpace(&asking, {});
    EXPECT_TRUE(reader->Read(&map));
    v1::GetConfigurationSpaceResponse rest;
    EXPECT_FALSE(reader->Read(&rest));
    EXPECT_TRUE(reader->Finish().ok());
    return map;
  }

  // Whether all 8 configurations are occupied that the block is in the way of.
  static bool BlockIsOccupied(const v1::GetConfigurationSpaceResponse& map) {
    const ConfigurationGrid grid = *GridOf(ServerTestCell());
    if (map.tiles_size() != 1) return false;
    for (int b = 0; b < 8; ++b) {
      const uint64_t place = grid.NumberOf({3, b});
      if ((map.tiles(0).occupied()[place / 8] >> (place % 8) & 1) == 0) return false;
    }
    return true;
  }

  void WaitForLog(const std::string& text) const {
    for (int i = 0; i < 1000 && program->Errors().find(text) == std::string::npos; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_THAT(program->Errors(), HasSubstr(text));
  }

  std::optional<ServerProgram> program;
  std::shared_ptr<grpc::Channel> channel;
};

TEST_F(DamagedFileTest, PagesZeroedUnderARunningServerMakeAllUnknownUntilItReloads) {
  EXPECT_TRUE(BlockIsOccupied(NewMap()));
  EXPECT_EQ(HealthOf(channel, "silhouette.v1.Database"), "\x08\x01");
  ZeroIndex(**Database::Open(database, Database::Access::kRead));
  WaitForLog("nothing is free: the file of the database '" + database + "' has changed");
  EXPECT_EQ(NewMap().unknown_reason(), v1::Verdict::REASON_DATABASE_DAMAGED);
  const std::string not_serving = "\x08\x02";
  for (int i = 0; i < 1000 && HealthOf(channel, "silhouette.v1.Database") != not_serving; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(HealthOf(channel, "silhouette.v1.Database"), not_serving);
  program->Signal(SIGHUP);
  WaitForLog("reloaded; ");
  const v1::GetConfigurationSpaceResponse map = NewMap();
  EXPECT_EQ(map.unknown_reason(), v1::Verdict::REASON_UNSPECIFIED);
  EXPECT_TRUE(BlockIsOccupied(map)) << "without the damaged tile";
}

TEST_F(DamagedFileTest, FileCutUnderARunningServerMakesAllUnknown) {
  EXPECT_TRUE(BlockIsOccupied(NewMap()));
  std::filesystem::resize_file(database + "/data.mdb", 8192);
  WaitForLog("nothing is free: the file of the database");
  EXPECT_EQ(NewMap().unknown_reason(), v1::Verdict::REASON_DATABASE_DAMAGED);
  program->Signal(SIGHUP);
  WaitForLog("not reloaded, still serving the old state");
  EXPECT_EQ(NewMap().unknown_reason(), v1::Verdict::REASON_DATABASE_DAMAGED);
  EXPECT_EQ(program->End(SIGTERM), 0);
}

using FullDiskOfAServer = FullDisk;

TEST_F(FullDiskOfAServer, LeavesItsVerdictsAndLosesNoRecordOfAChange) {
  const std::string cell = disk_ + "/cell.yaml";
  WriteFile(cell, std::string(kServerTestCellFile) +
                      "database: db\nserver: {max_age: 1 min, audit: audit.jsonl}\n");
  MakeDatabase(disk_ + "/db", {.index = true, .cell = DescriptionOf(*LoadCell(cell))});
  ServerProgram program(FreshFolder(), {"--cell", cell, "--listen", "127.0.0.1:0"});
  const auto channel = grpc::CreateChannel(program.Address(), grpc::InsecureChannelCredentials());
  const auto logged = [&](const std::string& text) {
    return program.Errors().find(text) != std::string::npos;
  };
  const auto wait_until = [](const std::function<bool()>& so) {
    for (int i = 0; i < 12'000 && !so(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ASSERT_TRUE(so());
  };
  const auto recorded = [&] {
    int changes = 0;
    std::ifstream audit(disk_ + "/audit.jsonl");
    for (std::string line; std::getline(audit, line);) {
      if (line.find("region.allow") != std::string::npos) ++changes;
    }
    return changes;
  };
  // Of a scene with a block: where it is not, and where it is.
  const auto verdicts = [&] {
    SceneInput input = SceneWithBlock(3);
    for (ViewInput& view : input.views) view.captured = SystemClock();
    grpc::ClientContext publishing, asking;
    v1::PublishSceneResponse published;
    EXPECT_TRUE(v1::SceneService::NewStub(channel)
                    ->PublishScene(&publishing, RequestOf(input), &published)
                    .ok());
    v1::CheckConfigurationsRequest request;
    for (const int a : {1, 3}) Set(At(a, 0), request.add_configurations());
    v1::CheckConfigurationsResponse response;
    EXPECT_TRUE(v1::CollisionService::NewStub(channel)
                    ->CheckConfigurations(&asking, request, &response)
                    .ok());
    std::vector<v1::Verdict::State> states;
    for (const v1::Verdict& verdict : response.verdicts()) states.push_back(verdict.state());
    return states;
  };
  const auto right = ElementsAre(v1::Verdict::STATE_FREE, v1::Verdict::STATE_OCCUPIED);
  EXPECT_THAT(verdicts(), right);
  Fill();
  program.Signal(SIGHUP);
  wait_until([&] { return logged("reloaded; "); });
  // The file's last page has room for some.
  int changes = 0;
  for (; !logged("cannot write the audit file"); ++changes) {
    ASSERT_LT(changes, 1000) << program.Errors();
    grpc::ClientContext context;
    v1::AllowRegionResponse allowed;
    ASSERT_TRUE(v1::SceneService::NewStub(channel)
                    ->AllowRegion(&context, RegionAt("part", 1, absl::Minutes(1)), &allowed)
                    .ok());
  }
  EXPECT_THAT(verdicts(), right);
  Empty();
  wait_until([&] { return logged("is written again") && recorded() >= changes; });
  EXPECT_THAT(verdicts(), right);
  EXPECT_EQ(program.End(SIGTERM), 0);
  EXPECT_EQ(recorded(), changes);
  const std::string verify = absl::StrCat(ProgramFolder(), "/silhouette-db audit verify ", disk_,
                                          "/audit.jsonl > /dev/null");
  EXPECT_EQ(std::system(verify.c_str()), 0);
}

// Sockets on which the process listens.
int ListeningSockets(pid_t pid) {
  std::set<std::string> inodes;
  for (const auto& entry :
       std::filesystem::directory_iterator(absl::StrCat("/proc/", pid, "/fd"))) {
    std::error_code error;
    const std::string target = std::filesystem::read_symlink(entry.path(), error);
    if (target.starts_with("socket:[")) inodes.insert(target.substr(8, target.size() - 9));
  }
  int listening = 0;
  for (const char* table : {"tcp", "tcp6"}) {
    std::ifstream lines(absl::StrCat("/proc/", pid, "/net/", table));
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      std::vector<std::string> fields(std::istream_iterator<std::string>(words), {});
      if (fields.size() > 9 && fields[3] == "0A" && inodes.contains(fields[9])) ++listening;
    }
  }
  return listening;
}

TEST_F(ServerProgramTest, ReplayOpensThePageAndNothingElse) {
  v1::GetDatabaseResponse recorded;
  recorded.set_cell_name(LoadCell(cell)->name);
  Recorder recorder({.folder = folder}, recorded);
  v1::WatchScenesResponse news;
  news.mutable_state();
  recorder.Take(news, absl::Now());
  ASSERT_TRUE(recorder.Close().ok());
  const std::vector<std::string> replay = {"--cell", cell,       "--database",
                                           database, "--replay", recorder.path()};
  const auto with = [&](std::vector<std::string> further) {
    further.insert(further.begin(), replay.begin(), replay.end());
    return further;
  };
  ServerProgram program(folder, with({"--page", "127.0.0.1:0"}));
  for (int i = 0; i < 1000 && program.Output().empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_THAT(program.Output(), StartsWith("recording at http://127.0.0.1:"));
  EXPECT_EQ(ListeningSockets(program.pid()), 1);
  EXPECT_EQ(program.End(SIGTERM), 0);

  EXPECT_EQ(Refused(replay), 2);
  EXPECT_THAT(errors, HasSubstr("--page"));
  for (const std::vector<std::string>& other :
       {std::vector<std::string>{"--live"}, {"--listen", "127.0.0.1:0"}}) {
    std::vector<std::string> further = {"--page", "127.0.0.1:0"};
    further.insert(further.end(), other.begin(), other.end());
    EXPECT_EQ(Refused(with(further)), 2);
    EXPECT_THAT(errors, HasSubstr("leave out --live, --listen"));
  }
  EXPECT_EQ(Refused(with({"--page", "127.0.0.1:0", "--preset", "best"})), 2);
  EXPECT_THAT(errors, HasSubstr("best"));
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
