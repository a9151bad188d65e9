// SPDX-License-Identifier: Apache-2.0
// A server that takes images itself is told which variant shows the robot.
#include "server/service/answers.h"
#include "server/service/messages.h"
#include "silhouette/client.h"
#include "silhouette/local_space.h"
#include "silhouette/v1/scene_service.pb.h"
#include "tests/server/live/http_get.h"
#include "tests/server/service/test_server.h"
#include "tests/server/tool_variant.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

// Where the tool alone touches a block: joint a at 1, the tool at 2.
const Configuration kChangeVariantServiceToolTouches = At(1, 1);
constexpr int kChangeVariantServiceBlock = 2;

std::shared_ptr<const ServedDatabase> ChangeVariantServiceBothVariants() {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db");
  AddTools(folder / "db");
  BuildIndex(folder / "db");
  return LoadDatabase(folder / "db");
}

struct ChangeVariantServiceTest : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database = ChangeVariantServiceBothVariants();
  ServingSettings settings;

  static std::shared_ptr<LiveRecord> NewRecord(const Clock& clock, KnownVariant known = {}) {
    return std::make_shared<LiveRecord>(kViewNames, absl::Seconds(1), clock, std::move(known));
  }

  static grpc::Status Change(TestServer& server, const std::string& variant, bool changing,
                             v1::ChangeVariantResponse* response) {
    v1::ChangeVariantRequest request;
    request.set_variant(variant);
    request.set_changing(changing);
    return server.Call(&v1::SceneService::Stub::ChangeVariant, request, response);
  }
  // Empty: it is changing.
  static v1::ChangeVariantResponse Tell(TestServer& server, const std::string& variant) {
    v1::ChangeVariantResponse response;
    const grpc::Status status = Change(server, variant, variant.empty(), &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  }

  // A scene of the images that arrived then, made with what is known now, as a LiveLoop does.
  Scene Made(const SceneInput& images, const Moment& arrived) {
    SceneInput input = images;
    const auto variant = settings.live->known_variant().Of(arrived.running, database->variants());
    if (variant.ok()) {
      input.variant = *variant;
    } else {
      input.without_variant = std::string(variant.status().message());
    }
    return *MakeScene(*database, input, settings.scene, {}, arrived);
  }
  uint64_t Publish(TestServer& server, Scene scene) {
    return server.server->Publish(std::move(scene), database).value()->id;
  }

  static v1::RobotVariant Acquired(TestServer& server) {
    return server.Ask(&v1::SceneService::Stub::GetAcquisition, v1::GetAcquisitionRequest())
        .acquisition()
        .robot_variant();
  }
};

TEST_F(ChangeVariantServiceTest, NothingOfBeforeIsFreeFromTheCallOn) {
  TestClock clock;
  settings.live = NewRecord(clock.clock(), KnownVariant("default"));
  // The server's own clock goes with that of the record.
  TestServer server(database, settings, [&](const Clock&) { return clock.clock(); });
  const auto now = [&] { return clock.clock()(); };
  const SceneInput bare = SceneWithBlock(kChangeVariantServiceBlock);
  const SceneInput with_tool = ToolScene(0, 0, kChangeVariantServiceBlock);

  const uint64_t first = Publish(server, Made(bare, now()));
  EXPECT_EQ(server.CheckOne(kChangeVariantServiceToolTouches).state(), v1::Verdict::STATE_FREE);
  Scene under_way = Made(bare, now());  // published too late

  clock.Advance(absl::Milliseconds(1));
  v1::ChangeVariantResponse told = Tell(server, "");
  EXPECT_TRUE(told.robot_variant().changing());
  EXPECT_THAT(told.robot_variant().unknown(), HasSubstr("being changed"));
  EXPECT_EQ(told.last_scene_before(), first + 1);
  EXPECT_EQ(server.CheckOne(kChangeVariantServiceToolTouches).reason(),
            v1::Verdict::REASON_VARIANT_UNKNOWN);
  EXPECT_EQ(Publish(server, std::move(under_way)), first + 2);
  EXPECT_EQ(server.CheckOne(kChangeVariantServiceToolTouches).reason(),
            v1::Verdict::REASON_VARIANT_UNKNOWN);
  clock.Advance(absl::Milliseconds(500));
  Publish(server, Made(with_tool, now()));
  EXPECT_EQ(server.CheckOne(At(4, 1)).reason(), v1::Verdict::REASON_VARIANT_UNKNOWN);

  told = Tell(server, kTool);
  EXPECT_EQ(told.robot_variant().variant(), kTool);
  EXPECT_EQ(told.robot_variant().unknown(), "");
  EXPECT_EQ(server.CheckOne(At(4, 1)).reason(), v1::Verdict::REASON_VARIANT_UNKNOWN);
  clock.Advance(kClockTolerance - absl::Milliseconds(1));
  Publish(server, Made(with_tool, now()));
  EXPECT_EQ(server.CheckOne(At(4, 1)).reason(), v1::Verdict::REASON_VARIANT_UNKNOWN);
  clock.Advance(absl::Milliseconds(1));
  EXPECT_GT(Publish(server, Made(with_tool, now())), told.last_scene_before());
  EXPECT_EQ(server.CheckOne(At(4, 1)).state(), v1::Verdict::STATE_FREE);
  EXPECT_EQ(server.CheckOne(kChangeVariantServiceToolTouches).state(), v1::Verdict::STATE_OCCUPIED);
  const v1::ChangeVariantResponse again = Tell(server, kTool);
  EXPECT_EQ(again.last_scene_before(), told.last_scene_before());
  EXPECT_EQ(server.CheckOne(At(4, 1)).state(), v1::Verdict::STATE_FREE) << "nothing changed";
}

TEST_F(ChangeVariantServiceTest, AnAnswerThatIsUnderWayIsNotFree) {
  Serving serving(database, settings);
  const Scene scene = *MakeScene(*database, EmptyCellScene(), {}, {}, SystemClock());
  ASSERT_TRUE(serving.publisher.Publish(scene, database).ok());
  const Served begun = serving.scenes.Newest(SystemClock());
  v1::Basis basis;
  EXPECT_EQ(Conclude(serving, begun, {}, &basis), Reason::kNone);
  EXPECT_GT(DurationFrom(basis.valid_for()), absl::ZeroDuration());
  serving.scenes.Withdraw("it has another tool", SystemClock());
  EXPECT_EQ(Conclude(serving, begun, {}, &basis), Reason::kVariantUnknown);
  EXPECT_EQ(DurationFrom(basis.valid_for()), absl::ZeroDuration());
}

TEST_F(ChangeVariantServiceTest, AcquisitionAndMetricsTellWhatClientsTold) {
  settings.live = NewRecord(SystemClock);
  settings.metrics = "127.0.0.1:0";
  TestServer server(database, settings);
  const Client client = Client::Connect(server.server->address()).value();
  const auto acquired = [&] { return client.GetAcquisition().value().robot_variant(); };
  const auto metrics = [&] { return HttpGet(server.server->metrics_address(), "/metrics"); };
  EXPECT_THAT(acquired().unknown(), HasSubstr("the robot's variant is not known"));
  EXPECT_THAT(metrics(), HasSubstr("silhouette_live_variant_known 0"));
  const auto begun = client.BeginVariantChange();
  ASSERT_TRUE(begun.ok()) << begun.status();
  EXPECT_TRUE(begun->robot_variant().changing());
  EXPECT_TRUE(acquired().changing());
  const auto done = client.ChangeVariant(kTool);
  ASSERT_TRUE(done.ok()) << done.status();
  EXPECT_EQ(done->robot_variant().variant(), kTool);
  EXPECT_EQ(acquired().variant(), kTool);
  EXPECT_FALSE(acquired().changing());
  EXPECT_THAT(metrics(), HasSubstr("silhouette_live_variant_known 1"));
  EXPECT_EQ(client.ChangeVariant("none").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(ChangeVariantServiceTest, ADatabaseWithoutTheVariantMakesItUnknown) {
  settings.live = NewRecord(SystemClock, KnownVariant(kTool));
  TestServer server(database, settings);
  server.server->ReplaceDatabase(NewDatabase());
  EXPECT_THAT(Acquired(server).unknown(), HasSubstr("'tool'"));
  server.server->ReplaceDatabase(database);
  EXPECT_THAT(Acquired(server).unknown(), HasSubstr("'tool'")) << "until it is told anew";
}

TEST_F(ChangeVariantServiceTest, MistakesAreToldInOneSentence) {
  v1::ChangeVariantResponse response;
  TestServer without(database, settings);
  EXPECT_EQ(Change(without, kTool, false, &response).error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
  settings.live = NewRecord(SystemClock, KnownVariant("default"));
  TestServer server(database, settings);
  const grpc::Status unknown = Change(server, "none", false, &response);
  EXPECT_EQ(unknown.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(unknown.error_message(),
              HasSubstr("no variant 'none'; its variants are default, tool"));
  EXPECT_EQ(Change(server, "", false, &response).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(Change(server, kTool, true, &response).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(Acquired(server).variant(), "default") << "nothing of that was taken";
}

// Who holds the map of the old variant in memory is told at once, and gets that of the new one.
TEST_F(ChangeVariantServiceTest, LocalSpaceAndWatchFollowTheChangeAndAreNeverFreeInBetween) {
  settings.scene.max_age = absl::Minutes(10);
  settings.live = NewRecord(SystemClock, KnownVariant("default"));
  TestServer server(database, settings, [](const Clock&) { return SystemClock; });
  const client::LocalSpace space(client::Client::Connect(server.server->address()).value(),
                                 {.max_age = absl::Minutes(10)});
  grpc::ClientContext context;
  const auto watch = server.collision->WatchConfigurationSpace(&context, {});
  const auto number = GridOf(ServerTestCell())->NumberOf({1, 1});
  // The watch's next update that has the map of a scene of this variant; none before it may be
  // free.
  const auto await_watch = [&](const std::string& variant) {
    v1::WatchConfigurationSpaceResponse update;
    do {
      ASSERT_TRUE(watch->Read(&update));
    } while (update.unknown_reason() != v1::Verdict::REASON_UNSPECIFIED);
    EXPECT_EQ(update.basis().scene_variant(), variant);
    const bool free = (update.tiles(0).free()[number / 8] >> (number % 8) & 1) != 0;
    EXPECT_EQ(free, variant == "default");
  };
  const auto await_space = [&](client::State state) {
    for (int i = 0; i < 12000 && space.Check(kChangeVariantServiceToolTouches).state != state;
         ++i) {
      absl::SleepFor(absl::Milliseconds(5));
    }
    EXPECT_EQ(space.Check(kChangeVariantServiceToolTouches).state, state);
  };

  Publish(server, Made(SceneWithBlock(kChangeVariantServiceBlock), SystemClock()));
  await_space(client::State::kFree);
  await_watch("default");
  Tell(server, "");
  await_space(client::State::kUnknown);
  EXPECT_EQ(space.unknown_reason(), client::Reason::kVariantUnknown);
  // Images of before the variant was told, and of after; nothing is free until the last of them.
  const Moment before = SystemClock();
  Publish(server, Made(ToolScene(0, 0, kChangeVariantServiceBlock), before));
  Tell(server, kTool);
  Publish(server, Made(ToolScene(0, 0, kChangeVariantServiceBlock), SystemClock()));
  EXPECT_EQ(space.Check(kChangeVariantServiceToolTouches).state, client::State::kUnknown);
  absl::SleepFor(kClockTolerance);
  Publish(server, Made(ToolScene(0, 0, kChangeVariantServiceBlock), SystemClock()));
  await_space(client::State::kOccupied);
  await_watch(kTool);
  EXPECT_TRUE(space.Check(At(4, 1)).free());
  context.TryCancel();
}

}  // namespace
}  // namespace silhouette
