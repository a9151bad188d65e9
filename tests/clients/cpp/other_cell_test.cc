// SPDX-License-Identifier: Apache-2.0
// Another cell's server at the same address: its verdicts are of other configurations.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "silhouette/check_stream.h"
#include "silhouette/client.h"
#include "silhouette/local_space.h"
#include "silhouette/messages.h"
#include "silhouette/path_watch.h"
#include "tests/clients/cpp/watched_space.h"
#include "tests/server/service/test_server.h"

namespace silhouette::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr absl::Duration kOtherCellLong = absl::Seconds(20);

storage::v1::CellDescription CellNamed(const std::string& name) {
  storage::v1::CellDescription cell = ServerTestCell();
  cell.set_name(name);
  return cell;
}

// One server after the other at one address.
class OneAddress : public testing::Test {
 protected:
  OneAddress() {
    MakeDatabase(path_, {.cell = CellNamed("press")});
    Serve(LoadDatabase(path_));
    client_ = std::make_unique<Client>(*Client::Connect(address_));
  }

  // With that block in the newest scene; 5: none.
  void Serve(std::shared_ptr<const ServedDatabase> database, int block = 5) {
    server_.reset();
    ServingSettings settings;
    settings.scene.max_age = absl::Minutes(10);
    settings.clock = SystemClock;
    auto started = Server::Start(address_, std::move(database), settings);
    ASSERT_TRUE(started.ok()) << started.status();
    server_ = *std::move(started);
    address_ = server_->address();
    const auto publish = [&] {
      return Client::Connect(address_)->PublishScene(
          RequestOf(block == 5 ? EmptyCellScene() : SceneWithBlock(block)), RunningClock::now());
    };
    auto scene = publish();
    // gRPC may still hold that the server before is gone.
    for (const absl::Time start = absl::Now();
         absl::IsUnavailable(scene.status()) && absl::Now() - start < kOtherCellLong;) {
      scene = publish();
    }
    ASSERT_TRUE(scene.ok()) << scene.status();
  }
  void ServeOther(const storage::v1::CellDescription& cell) { Serve(NewDatabase({.cell = cell})); }

  // The state at At(2, 0), from a question that ends well.
  State Asked(const Client& client) {
    const auto checks = client.CheckConfigurations({At(2, 0)});
    EXPECT_TRUE(checks.ok()) << checks.status();
    return checks.ok() ? checks->verdicts[0].state : State::kUnknown;
  }

  const std::filesystem::path path_ = FreshFolder() / "db";
  std::string address_ = "127.0.0.1:0";
  std::unique_ptr<Server> server_;
  std::unique_ptr<Client> client_;
};

TEST_F(OneAddress, OtherCellAnswersNoQuestion) {
  Serve(LoadDatabase(path_), /*block=*/2);
  ASSERT_EQ(Asked(*client_), State::kOccupied);
  ServeOther(CellNamed("lathe"));
  ASSERT_EQ(Asked(*Client::Connect(address_)), State::kFree) << "a new client is of the new cell";

  const std::vector<Configuration> path = {At(2, 0), At(2, 1)};
  CheckStream stream = client_->StreamChecks();
  ASSERT_TRUE(stream.Send(1, {At(2, 0)}).ok());
  PathWatch watch = *client_->WatchPath(path);
  for (const absl::Status& status :
       {client_->CheckConfigurations({At(2, 0)}).status(),
        client_->CheckNumbers(std::vector<uint32_t>{0}).status(), client_->CheckPath(path).status(),
        client_->GetConfigurationSpace().status(),
        client_->WithTimeout(absl::Seconds(5)).Explain(At(2, 0)).status(),
        client_->GetDatabase().status(), stream.Receive().status(),
        watch.Next(kOtherCellLong).status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
    EXPECT_EQ(status.message(), "the server at " + address_ +
                                    " now serves cell 'lathe', not cell 'press'; connect again");
  }
}

// A region that is allowed for one robot's part would hide what stands in another's way.
TEST_F(OneAddress, OtherCellIsNotChanged) {
  ASSERT_EQ(Asked(*client_), State::kFree);
  ServeOther(CellNamed("lathe"));
  ASSERT_EQ(Asked(*Client::Connect(address_)), State::kFree);
  const v1::AllowRegionRequest region = RegionAt("part", 2, absl::Minutes(1));
  v1::PublishSceneRequest scene = RequestOf(EmptyCellScene());
  for (v1::ViewImage& image : *scene.mutable_views()) {
    *image.mutable_capture_time() = ToMessage(absl::Now());
  }
  for (const absl::Status& status :
       {client_->AllowRegion(region).status(), client_->ChangeVariant("default").status(),
        client_->BeginVariantChange().status(), client_->PublishScene(scene).status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("now serves cell 'lathe'"));
  }
  EXPECT_EQ(Client::Connect(address_)->ListAllowedRegions()->regions_size(), 0);
}

TEST_F(OneAddress, OtherCellLeavesNothingKnownInALocalSpace) {
  Serve(LoadDatabase(path_), /*block=*/2);
  const LocalSpace space(*client_, {.max_age = absl::Minutes(5)});
  ASSERT_FALSE(space.WaitForUpdate(0, kOtherCellLong)->unknown_reason().has_value());
  ASSERT_EQ(space.Check(At(2, 0)).state, State::kOccupied);
  ServeOther(CellNamed("lathe"));
  for (int i = 0; i < 4000 && space.unknown_reason() != Reason::kRefused; ++i) {
    ASSERT_NE(space.Check(At(2, 0)).state, State::kFree);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(space.Check(At(2, 0)).reason, Reason::kRefused);
  EXPECT_THAT(std::string(space.status().problem.message()),
              AllOf(HasSubstr("'lathe'"), HasSubstr("'press'")));
  EXPECT_EQ(space.CheckMotionOrAsk(At(2, 0), At(2, 1)).state, State::kUnknown);
}

TEST_F(OneAddress, OtherGridOfTheSameNameIsAnotherCell) {
  ASSERT_EQ(Asked(*client_), State::kFree);
  storage::v1::CellDescription cell = CellNamed("press");
  cell.mutable_grid_joints(0)->set_lower(-4);
  ServeOther(cell);
  const absl::Status status = client_->CheckConfigurations({At(2, 0)}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("cell 'press' with another grid"));
}

TEST_F(OneAddress, SameCellIsFollowedThroughARestartANewGenerationAndNewMasks) {
  ASSERT_EQ(Asked(*client_), State::kFree);
  const uint64_t generation = client_->GetDatabase()->generation();
  {
    const auto database = Database::Open(path_, Database::Access::kWrite);
    ASSERT_TRUE(database.ok()) << database.status();
    ASSERT_TRUE((*database)->SetReferences(TestReferences(), "test").ok());
  }
  Serve(LoadDatabase(path_));
  EXPECT_EQ(Asked(*client_), State::kFree);
  EXPECT_GT(client_->GetDatabase()->generation(), generation);
  storage::v1::CellDescription segmented = CellNamed("press");
  segmented.set_segmentation("threshold: 3\n");
  ServeOther(segmented);
  EXPECT_EQ(Asked(*client_), State::kFree);
}

TEST_F(OneAddress, LocalSpaceKnowsAgainSoonAfterTheServerIsBack) {
  const LocalSpace space(*client_, {.max_age = absl::Minutes(5)});
  for (const int down : {1, 4}) {
    for (int i = 0; i < 4000 && !space.Check(At(0, 0)).free(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ASSERT_TRUE(space.Check(At(0, 0)).free());
    server_.reset();
    std::this_thread::sleep_for(std::chrono::seconds(down));
    ASSERT_FALSE(space.Check(At(0, 0)).free());
    Serve(LoadDatabase(path_));
    const absl::Time back = absl::Now();
    while (!space.Check(At(0, 0)).free() && absl::Now() - back < kOtherCellLong) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    EXPECT_LT(absl::Now() - back, absl::Seconds(6)) << "down for " << down << " s";
  }
}

v1::Basis BasisOfCell(const std::string& name, uint64_t digest) {
  v1::Basis basis = BasisOf(1);
  basis.set_cell_name(name);
  basis.set_cell_digest(digest);
  return basis;
}

TEST(OtherCell, BehindOneProxyDoesNotSetTheClockOfAWatch) {
  FakeServer fake;
  fake.check_configurations = [](auto&, auto&, v1::CheckConfigurationsResponse& response) {
    *response.mutable_basis() = BasisOfCell("lathe", 2);
    return grpc::Status::OK;
  };
  fake.watch_path = [](auto&, auto&, grpc::ServerWriter<v1::WatchPathResponse>& writer) {
    v1::WatchPathResponse response;
    *response.mutable_check()->mutable_basis() = BasisOfCell("press", 1);
    response.mutable_check()->mutable_verdict()->set_state(v1::Verdict::STATE_FREE);
    writer.Write(response);
    return grpc::Status::OK;
  };
  PathWatch watch = *ClientOfHere(fake).WatchPath(std::vector<Configuration>{{0, 0}});
  EXPECT_EQ(watch.Next(kOtherCellLong).status().code(), absl::StatusCode::kFailedPrecondition);
}

// The clock, which is asked for once a second, does not notice it.
TEST(OtherCell, OfTheLastInstantGetsNoSceneThatTheClientStamps) {
  FakeServer fake;
  v1::Basis basis = BasisOfCell("press", 1);
  fake.check_configurations = [&](auto&, auto&, v1::CheckConfigurationsResponse& response) {
    *response.mutable_basis() = basis;
    return grpc::Status::OK;
  };
  int published = 0;
  fake.publish_scene = [&](auto&, auto&, auto&) {
    ++published;
    return grpc::Status::OK;
  };
  const Client client = ClientOfHere(fake);
  v1::PublishSceneRequest scene;
  scene.add_views()->set_view("top");
  ASSERT_TRUE(client.PublishScene(scene, RunningClock::now()).ok());
  basis = BasisOfCell("lathe", 2);
  EXPECT_EQ(client.PublishScene(scene, RunningClock::now()).status().code(),
            absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(published, 1);
}

TEST(OtherCell, IsOneThatIsNoLongerNamed) {
  FakeServer fake;
  std::vector<v1::Basis> answers = {BasisOfCell("press", 1), BasisOf(1)};
  fake.check_configurations = [&](auto&, auto&, v1::CheckConfigurationsResponse& response) {
    *response.mutable_basis() = answers.front();
    answers.erase(answers.begin());
    response.add_verdicts()->set_state(v1::Verdict::STATE_FREE);
    return grpc::Status::OK;
  };
  const Client client = ClientOfHere(fake);
  EXPECT_TRUE(client.CheckConfigurations({{0, 0}}).ok());
  const absl::Status status = client.CheckConfigurations({{0, 0}}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("a cell that it does not name, not cell 'press'"));
}

}  // namespace
}  // namespace silhouette::client
