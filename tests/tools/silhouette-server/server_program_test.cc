// SPDX-License-Identifier: Apache-2.0
// silhouette-server as a user starts it.
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/recording/recorder.h"
#include "silhouette/v1/scene_service.grpc.pb.h"
#include "tests/folders.h"
#include "tests/server/test_cell.h"
#include "tests/shell.h"
#include "tests/tools/silhouette-server/server_program.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pair;
using ::testing::StartsWith;

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

TEST_F(ServerProgramTest, NamesTheLinksWhoseMeshesAreNotClosedToTheSoundPresets) {
  GiveModelAndCameras("", "sound: {least_obstacle: 0.5, voxel_edge: 0.4}\n");
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  EXPECT_THAT(program.Address(), StartsWith("127.0.0.1:"));
  EXPECT_THAT(program.Errors(), HasSubstr("the meshes of link 'lid' are not closed, "));
  EXPECT_THAT(program.Errors(), HasSubstr("so that the sound presets may block"));
}

TEST_F(ServerProgramTest, SaysWhatTheSoundPresetsLackWhereCamerasAndModelAreThere) {
  const auto said = [&] {
    ServerProgram program(folder,
                          {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
    EXPECT_THAT(program.Address(), StartsWith("127.0.0.1:"));
    return program.Errors().find("add 'sound: {least_obstacle: 0.15}' to the cell file") !=
           std::string::npos;
  };
  EXPECT_FALSE(said()) << "no model, no cameras";
  GiveModelAndCameras("", "");
  EXPECT_TRUE(said());
  std::filesystem::remove_all(database);
  GiveModelAndCameras("", "sound: {least_obstacle: 0.5, voxel_edge: 0.4}\n");
  EXPECT_FALSE(said());
}

TEST_F(ServerProgramTest, StepsOfTheGridAreWarnedOfWhereRobotImagesAreCapturedAndNotDrawn) {
  const std::string steps = "the robot moves by up to ";
  for (const std::string images : {"captured", "drawn"}) {
    std::filesystem::remove_all(folder / "with-cameras");
    GiveModelAndCameras("  images: " + images + "\n",
                        "sound: {least_obstacle: 0.5, voxel_edge: 0.4}\n");
    ServerProgram program(folder, {"--cell", cell, "--database", database, "--listen",
                                   "127.0.0.1:0", "--unverified"});
    EXPECT_THAT(program.Address(), StartsWith("127.0.0.1:"));
    EXPECT_THAT(program.Errors(), AllOf(HasSubstr("million voxels of 0.400 m in "),
                                        Not(HasSubstr("this may take minutes"))));
    EXPECT_EQ(program.Errors().find(steps) != std::string::npos, images == "captured")
        << program.Errors();
  }
}

TEST_F(ServerProgramTest, DistancesOfAModelThatMayLackSomethingAreWarnedOf) {
  for (const bool whole : {false, true}) {
    std::filesystem::remove_all(folder / "with-cameras");
    GiveModelAndCameras("", absl::StrCat("sound: {least_obstacle: 0.5, voxel_edge: 0.4, "
                                         "whole_model: ",
                                         whole ? "true" : "false",
                                         "}\n"
                                         "separation: {levels: [{name: slow, speed: 0.25, "
                                         "stopping_time: 0.1, stopping_distance: 0.02}]}\n"));
    ServerProgram program(folder,
                          {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
    EXPECT_THAT(program.Address(), StartsWith("127.0.0.1:"));
    const std::string said = program.Errors();
    EXPECT_THAT(said, HasSubstr("distances to people: up to "));
    EXPECT_EQ(said.find("state 'sound: whole_model: true'") == std::string::npos, whole) << said;
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

TEST_F(ServerProgramTest, SettingsThatACalibrationCannotRestOnAreToldWhereThereIsOne) {
  GiveModelAndCameras(
      "", "segmentation: {min_cover: 0.5}\ncapture: {first_look: {least_overlap: 0}}\n");
  const std::string unknown =
      "what rests on the calibration is unknown, never free: segmentation: min_cover: 0.5";
  const std::string not_compared = "least_overlap: 0: the server does not compare the calibration";
  const auto said = [&] {
    ServerProgram program(folder,
                          {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
    EXPECT_THAT(program.Address(), StartsWith("127.0.0.1:"));
    return program.Errors();
  };
  EXPECT_THAT(said(), AllOf(HasSubstr(unknown), HasSubstr(not_compared)));
  ASSERT_TRUE(
      (*Database::Open(database, Database::Access::kWrite))->RemoveCalibration("test").ok());
  EXPECT_THAT(said(), AllOf(Not(HasSubstr(unknown)), Not(HasSubstr(not_compared))));
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

TEST_F(ServerProgramTest, SuspectImagesAreUnknownWithoutAReloadBeingAskedFor) {
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  program.Address();
  storage::v1::CaptureHistory history;
  const auto log_after = [&](size_t reloads) {
    EXPECT_TRUE(
        (*Database::Open(database, Database::Access::kWrite))->SetCaptureHistory(history).ok());
    std::vector<std::string> parts;
    for (int i = 0; i < 1000 && parts.size() <= reloads; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      parts = absl::StrSplit(program.Errors(), "reloaded; ");
    }
    return parts.size() > reloads ? parts[reloads - 1] : "not reloaded";
  };
  history.add_suspects()->mutable_until()->set_seconds(absl::ToUnixSeconds(absl::Now()));
  EXPECT_THAT(log_after(1), HasSubstr("39 configurations with a robot image that was captured "
                                      "while the cell may have changed"));
  history.clear_suspects();
  EXPECT_THAT(log_after(2), AllOf(HasSubstr("39 captured"), Not(HasSubstr("may have changed"))));
}

TEST_F(ServerProgramTest, ReloadForSuspectImagesIsTriedAgainUntilItSucceeds) {
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  const std::string address = program.Address();
  const auto says = [&](const std::string& what) {
    for (int i = 0; i < 2000 && program.Errors().find(what) == std::string::npos; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return program.Errors().find(what) != std::string::npos;
  };
  {
    const auto opened = Database::Open(database, Database::Access::kWrite);
    std::filesystem::rename(database, folder / "away");
    storage::v1::CaptureHistory history;
    history.add_suspects()->mutable_until()->set_seconds(absl::ToUnixSeconds(absl::Now()));
    EXPECT_TRUE((*opened)->SetCaptureHistory(history).ok());
  }
  EXPECT_TRUE(says("not reloaded, and nothing is free"));
  std::filesystem::rename(folder / "away", database);
  EXPECT_TRUE(says("reloaded; "));
}

TEST_F(ServerProgramTest, SighupSaysThatAChangedCellFileOrModelNeedsARestart) {
  GiveModelAndCameras("", "");
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
  const std::string changed =
      "' has changed, and its former contents still hold: restart the server";
  EXPECT_THAT(program.Errors(), Not(HasSubstr(changed)));
  WriteFile(cell, ContentOf(cell) + "margin: 5 px\n");
  reload(2);
  EXPECT_THAT(program.Errors(),
              AllOf(HasSubstr("cell.yaml" + changed), Not(HasSubstr("lid.obj" + changed)),
                    Not(HasSubstr("robot.urdf" + changed))));
  for (const std::string name : {"lid.obj", "robot.urdf"}) {
    WriteFile(folder / name, ContentOf(folder / name) + "\n");
  }
  reload(3);
  EXPECT_THAT(program.Errors(),
              AllOf(HasSubstr("lid.obj" + changed), HasSubstr("robot.urdf" + changed)));
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
      AllOf(HasSubstr("allows region 'part' for 200 ms: 9 pixels in 'top'"),
            HasSubstr("allowed region 'part' has ended"), HasSubstr("revokes region 'other'")));
  EXPECT_THAT(program.Errors(), Not(HasSubstr("region 'other' has ended")));
}

TEST_F(ServerProgramTest, ClientAsksWhetherDegreesAreMeantAlsoWhereAJointTurnsForever) {
  GiveModelAndCameras("", "");
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  const auto said = [&](const std::string& values) {
    const std::string command =
        absl::StrCat(ProgramFolder(), "/silhouette --server ", program.Address(), " check ", values,
                     " > '", (folder / "said").string(), "'");
    EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 1);
    return ContentOf(folder / "said");
  };
  EXPECT_THAT(said("0,-45"), HasSubstr("did you mean degrees?"));
  EXPECT_THAT(said("20,0"), Not(HasSubstr("degrees"))) << "metres";
}

TEST_F(ServerProgramTest, RegionForbiddenAfterTheCaptureIsExcluded) {
  WriteFile(cell,
            absl::StrCat(kServerTestCellFile,
                         "capture: {forbidden_regions: [{name: post, joints: {a: [2, 3]}}]}\n"));
  ServerProgram program(folder,
                        {"--cell", cell, "--database", database, "--listen", "127.0.0.1:0"});
  EXPECT_EQ(DatabaseAt(program.Address()).excluded(), 16u);
}

TEST_F(ServerProgramTest, FilesThatAreMissingAreNamedBeforeTheDatabaseIsLoaded) {
  const auto complaint = [this](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(),
                     {"--database", folder / "not_yet", "--listen", "127.0.0.1:0"});
    ServerProgram program(folder, arguments);
    EXPECT_EQ(program.ExitCode(), 2);
    return program.Errors();
  };
  EXPECT_THAT(complaint({"--cell", SourceFolder() + "/capture/sim/cells/demo/cell.yaml", "--live",
                         "--simulated-obstacles", "no_obstacles.yaml"}),
              HasSubstr("no_obstacles.yaml"));
  WriteFile(cell, absl::StrCat(kServerTestCellFile,
                               "server: {tls: {certificate: no.pem, key: no.key, client_ca: "
                               "no.pem}, roles: {planner: [planner]}}\n"));
  EXPECT_THAT(complaint({"--cell", cell}), HasSubstr("no.pem"));
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
  recorder.Take(news, {.wall = absl::Now(), .running = {}});
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

}  // namespace
}  // namespace silhouette
