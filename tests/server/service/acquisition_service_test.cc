// SPDX-License-Identifier: Apache-2.0
// A server that takes images itself, and what it tells of that.
#include <fstream>
#include <iterator>
#include <regex>
#include <string>
#include <thread>

#include "tests/folders.h"
#include "tests/server/live/http_get.h"
#include "tests/server/service/raw_call.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

struct AcquisitionServiceTest : ::testing::Test {
  TestClock clock;  // of the record
  std::shared_ptr<LiveRecord> record =
      std::make_shared<LiveRecord>(kViewNames, absl::Seconds(1), clock.clock());

  ServingSettings Live(const std::string& metrics = "") {
    ServingSettings settings;
    settings.live = record;
    settings.metrics = metrics;
    return settings;
  }
  Moment Now() { return clock.clock()(); }
  void AllGood() {
    for (size_t view = 0; view < 3; ++view) record->NoteImage(view, Now(), Now());
    record->NoteJoints(Now());
  }
  static grpc::Status Get(TestServer& server, v1::Acquisition* acquisition) {
    v1::GetAcquisitionResponse response;
    const grpc::Status status = server.Call(&v1::SceneService::Stub::GetAcquisition,
                                            v1::GetAcquisitionRequest(), &response);
    *acquisition = response.acquisition();
    return status;
  }
};

TEST_F(AcquisitionServiceTest, ServerThatTakesImagesItselfTakesNobodyElses) {
  TestServer server(NewDatabase(), Live());
  const grpc::Status status = server.PublishStatus(RequestOf(EmptyCellScene()));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), AllOf(HasSubstr("--live"), HasSubstr("must not mix")));
  EXPECT_EQ(server.CheckOne(At(0, 0)).reason(), v1::Verdict::REASON_NO_SCENE);
}

TEST_F(AcquisitionServiceTest, ServerThatDoesNotSaysSo) {
  TestServer server(NewDatabase());
  v1::Acquisition acquisition;
  const grpc::Status status = Get(server, &acquisition);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_THAT(status.error_message(), HasSubstr("start it with --live"));
  EXPECT_EQ(server.server->metrics_address(), "");
}

TEST_F(AcquisitionServiceTest, ScenesMadeInProcessAreServed) {
  const auto database = NewDatabase();
  TestServer server(database, Live());
  absl::StatusOr<Scene> scene =
      MakeScene(*database, EmptyCellScene(), {}, {}, server.clock.clock()());
  ASSERT_TRUE(scene.ok()) << scene.status();
  ASSERT_TRUE(server.server->Publish(*std::move(scene), database).ok());
  EXPECT_EQ(server.CheckOne(At(3, 0)).state(), v1::Verdict::STATE_FREE);
}

TEST_F(AcquisitionServiceTest, ReasonNamesTheDeviceAndWhatItDoes) {
  const auto database = NewDatabase();
  TestServer server(database, Live());
  const auto the_defect = [&](v1::Verdict::Reason reason) {
    const v1::CheckConfigurationsResponse response = server.Check({At(3, 0)});
    EXPECT_EQ(response.verdicts(0).reason(), reason);
    EXPECT_EQ(response.basis().defects_size(), 1);
    EXPECT_EQ(response.basis().defects(0).reason(), reason);
    return response.basis().defects(0).message();
  };
  EXPECT_THAT(the_defect(v1::Verdict::REASON_NO_SCENE),
              AllOf(HasSubstr("cameras 'left', 'right', 'top' do not serve: no image yet"),
                    HasSubstr("robot does not serve: no joint values yet")));
  AllGood();
  Scene scene = *MakeScene(*database, EmptyCellScene(), {}, {}, server.clock.clock()());
  ASSERT_TRUE(server.server->Publish(std::move(scene), database).ok());
  EXPECT_EQ(server.Check({At(3, 0)}).basis().defects_size(), 0);
  for (TestClock* each : {&clock, &server.clock}) each->Advance(absl::Seconds(2));
  record->NoteImage(0, Now(), Now());
  record->NoteImageError(1, absl::UnavailableError("cable pulled"));
  record->NoteJoints(Now());
  const std::string stale = the_defect(v1::Verdict::REASON_SCENE_STALE);
  EXPECT_THAT(stale, AllOf(HasSubstr("2 s old"), HasSubstr("camera 'right' does not serve: cable"),
                           HasSubstr("camera 'top' does not serve: the last image came 2 s ago")));
  EXPECT_THAT(stale, Not(AnyOf(HasSubstr("'left'"), HasSubstr("robot"), HasSubstr("publish"))));
}

TEST_F(AcquisitionServiceTest, AcquisitionIsToldPerCameraAndRobot) {
  TestServer server(NewDatabase(), Live());
  AllGood();
  record->NoteImageError(1, absl::UnavailableError("cable pulled"));
  const Moment arrived = Now();
  clock.Advance(absl::Milliseconds(8));
  record->NoteScene(arrived);
  record->NoteMap(arrived);
  v1::Acquisition acquisition;
  ASSERT_TRUE(Get(server, &acquisition).ok());
  EXPECT_TRUE(acquisition.serving());
  EXPECT_EQ(acquisition.scenes(), 1u);
  ASSERT_EQ(acquisition.cameras_size(), 3);
  EXPECT_EQ(acquisition.cameras(0).view(), "left");
  EXPECT_EQ(acquisition.cameras(0).images(), 1u);
  EXPECT_EQ(acquisition.cameras(0).last_image_age().nanos(), 8'000'000);
  EXPECT_EQ(acquisition.cameras(1).errors(), 1u);
  EXPECT_EQ(acquisition.cameras(1).fault(), "cable pulled");
  EXPECT_EQ(acquisition.robot().samples(), 1u);
  EXPECT_EQ(acquisition.to_map().median().nanos(), 8'000'000);
  EXPECT_EQ(acquisition.to_map().count(), 1u);
}

TEST_F(AcquisitionServiceTest, HealthServiceTellsCamerasAndTheWhole) {
  TestServer server(NewDatabase(), Live());
  const auto serving = [&](const std::string& name) {
    return HealthOf(server.channel, name) == "\x08\x01";
  };
  const auto wait_for = [&](const std::string& name, bool expected) {
    for (int i = 0; i < 6000 && serving(name) != expected; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_EQ(serving(name), expected) << name;
  };
  wait_for("silhouette.v1.Acquisition", false);
  AllGood();
  wait_for("silhouette.v1.Acquisition", true);
  wait_for("silhouette.v1.Camera/right", true);
  clock.Advance(absl::Seconds(2));
  record->NoteImage(0, Now(), Now());
  wait_for("silhouette.v1.Camera/right", false);
  wait_for("silhouette.v1.Camera/left", true);
  wait_for("silhouette.v1.Acquisition", false);
}

TEST_F(AcquisitionServiceTest, MetricsAreToldToPrometheus) {
  const auto database = NewDatabase();
  ServingSettings settings = Live("127.0.0.1:0");
  settings.map_time = absl::ZeroDuration();  // the server's own thread finishes no map
  TestServer server(database, settings);
  AllGood();
  record->NoteImageError(1, absl::UnavailableError("cable pulled"));
  record->NoteMap(Now());
  absl::StatusOr<Scene> scene =
      MakeScene(*database, EmptyCellScene(), {}, {}, server.clock.clock()());
  ASSERT_TRUE(server.server->Publish(*std::move(scene), database).ok());
  server.clock.Advance(absl::Milliseconds(250));
  server.CheckOne(At(3, 0));
  server.CheckNumbers({0, 1, 2});
  const std::string told = HttpGet(server.server->metrics_address(), "/metrics");
  for (const char* line :
       {"silhouette_database_generation ", "silhouette_scenes_total 1",
        "silhouette_scene_age_seconds 0.25", "silhouette_scene_max_age_seconds 1\n",
        "silhouette_verdicts_total{verdict=\"free\"} ",
        "silhouette_live_images_total{view=\"left\"} 1",
        "silhouette_live_image_errors_total{view=\"right\"} 1",
        "silhouette_live_image_age_seconds{view=\"top\"} 0", "silhouette_live_joints_total 1",
        "silhouette_live_latency_seconds_bucket{to=\"map\",le=\"0.01\"} 1",
        "# TYPE silhouette_live_latency_seconds histogram"}) {
    EXPECT_THAT(told, HasSubstr(line));
  }
  EXPECT_THAT(told, HasSubstr("200 OK"));
  EXPECT_THAT(told, HasSubstr("silhouette_build_info{version=\""));
  EXPECT_THAT(told, Not(ContainsRegex("reason=\"[^\"]* "))) << "words are joined in labels";
}

TEST_F(AcquisitionServiceTest, AlertRulesAndDashboardNameMetricsThatExist) {
  const auto database = NewDatabase();
  TestServer server(database, Live("127.0.0.1:0"));
  AllGood();
  record->NoteMap(Now());
  server.CheckOne(At(3, 0));
  absl::StatusOr<Scene> scene =
      MakeScene(*database, EmptyCellScene(), {}, {}, server.clock.clock()());
  ASSERT_TRUE(server.server->Publish(*std::move(scene), database).ok());
  const std::string told = HttpGet(server.server->metrics_address(), "/metrics");
  const std::regex name("silhouette_[a-z_]+");
  int named = 0;
  for (const char* file : {"alerts.yaml", "grafana.json"}) {
    std::ifstream in(SourceFolder() + "/docs/monitoring/" + file);
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    for (std::sregex_iterator match(text.begin(), text.end(), name), end; match != end; ++match) {
      // No client was refused.
      if (match->str() == "silhouette_client_refused_total") continue;
      EXPECT_THAT(told, HasSubstr(match->str())) << file;
      ++named;
    }
  }
  EXPECT_GT(named, 20);
}

TEST_F(AcquisitionServiceTest, MetricsAreServedByIpv6AtAnAddressForAUrl) {
  ServingSettings settings;
  settings.metrics = "[::1]:0";
  const auto server = Server::Start("127.0.0.1:0", NewDatabase(), settings);
  if (!server.ok()) GTEST_SKIP() << "this machine has no IPv6: " << server.status();
  const std::string address = (*server)->metrics_address();
  EXPECT_TRUE(address.starts_with("[::1]:")) << address;
  EXPECT_THAT(HttpGet(address, "/metrics"), HasSubstr("silhouette_"));
}

TEST_F(AcquisitionServiceTest, MetricsAddressThatCannotBeIsToldAtTheStart) {
  TestServer other(NewDatabase(), Live("127.0.0.1:0"));
  const auto status_of = [](const std::string& metrics) {
    ServingSettings settings;
    settings.metrics = metrics;
    return Server::Start("127.0.0.1:0", NewDatabase(), settings).status();
  };
  EXPECT_EQ(status_of("nowhere").code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status_of("::1:9464").code(), absl::StatusCode::kInvalidArgument) << "no brackets";
  EXPECT_EQ(status_of("unix:/tmp/x").code(), absl::StatusCode::kInvalidArgument);
  const absl::Status taken = status_of(other.server->metrics_address());
  EXPECT_EQ(taken.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(taken.message()), AllOf(HasSubstr("metrics"), HasSubstr("in use")));
}

}  // namespace
}  // namespace silhouette
