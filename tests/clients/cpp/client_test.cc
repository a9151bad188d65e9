// SPDX-License-Identifier: Apache-2.0
// What the client library promises, above all: nothing but an explicit FREE is free.
#include "silhouette/client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "silhouette/messages.h"
#include "tests/clients/cpp/fake_server.h"

namespace silhouette::client {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

const std::vector<Configuration> kOne = {{0.1, 0.2}};

v1::Basis GoodBasis() {
  v1::Basis basis;
  basis.set_database_generation(7);
  basis.set_scene_id(3);
  basis.mutable_scene_time()->set_seconds(1000);
  basis.mutable_scene_time()->set_nanos(500'000'000);
  basis.mutable_scene_age()->set_nanos(20'000'000);
  basis.mutable_valid_for()->set_seconds(60);
  return basis;
}

// The reply's verdicts have these states, numbers of the enum.
auto VerdictsOf(std::vector<int> states) {
  return [states](grpc::ServerContext&, const v1::CheckConfigurationsRequest&,
                  v1::CheckConfigurationsResponse& response) {
    *response.mutable_basis() = GoodBasis();
    for (int state : states) {
      response.add_verdicts()->set_state(static_cast<v1::Verdict::State>(state));
    }
    return grpc::Status::OK;
  };
}

TEST(CheckConfigurations, TellsTheRegionsThatTouchedThem) {
  FakeServer server;
  server.check_configurations = [](grpc::ServerContext&, const v1::CheckConfigurationsRequest&,
                                   v1::CheckConfigurationsResponse& response) {
    *response.mutable_basis() = GoodBasis();
    response.mutable_basis()->add_regions("part");
    response.mutable_basis()->add_regions("tray");
    response.add_verdicts()->add_regions("part");
    return grpc::Status::OK;
  };
  const auto checks = ClientOfHere(server).CheckConfigurations(kOne);
  ASSERT_TRUE(checks.ok()) << checks.status();
  EXPECT_THAT(checks->basis.regions, ElementsAre("part", "tray"));
  EXPECT_THAT(checks->verdicts[0].regions, ElementsAre("part"));
}

TEST(Verdict, NobodyGaveIsUnknown) {
  EXPECT_EQ(Verdict().state, State::kUnknown);
  EXPECT_FALSE(Verdict().free());
  EXPECT_FALSE(ConfigurationChecks().AllFree());
  EXPECT_FALSE(PathCheck().verdict.free());
}

// The reply has these bits for the numbers.
auto BitsOf(v1::Basis basis, std::string free, std::string occupied, int reason = 0) {
  return [=](grpc::ServerContext&, const v1::CheckConfigurationsRequest& request,
             v1::CheckConfigurationsResponse& response) {
    EXPECT_THAT(request.numbers(), ElementsAre(5, 6, 4096, 4'000'000'000));
    *response.mutable_basis() = basis;
    response.set_free(free);
    response.set_occupied(occupied);
    response.set_unknown_reason(static_cast<v1::Verdict::Reason>(reason));
    return grpc::Status::OK;
  };
}

TEST(CheckNumbers, OnlyWhatIsFreeAndNotAlsoOccupiedIsFree) {
  const std::vector<uint32_t> numbers = {5, 6, 4096, 4'000'000'000};
  FakeServer server;
  server.check_configurations = BitsOf(GoodBasis(), "\x75", "\x06");
  auto checks = ClientOfHere(server).CheckNumbers(numbers);
  ASSERT_TRUE(checks.ok()) << checks.status();
  EXPECT_EQ(checks->basis.scene_id, 3u);
  std::vector<State> states;
  for (size_t i = 0; i < 6; ++i) states.push_back(checks->StateOf(i));
  EXPECT_THAT(states, ElementsAre(State::kFree, State::kOccupied, State::kUnknown, State::kUnknown,
                                  State::kUnknown, State::kUnknown));
  server.check_configurations = BitsOf(GoodBasis(), "\x0f", std::string(1, '\0'), 2);
  checks = ClientOfHere(server).CheckNumbers(numbers);
  ASSERT_TRUE(checks.ok()) << checks.status();
  EXPECT_EQ(checks->unknown_reason, Reason::kSceneStale);
  EXPECT_EQ(checks->StateOf(0), State::kUnknown);
  server.check_configurations = BitsOf({}, "\x0f", std::string(1, '\0'));
  checks = ClientOfHere(server).CheckNumbers(numbers);
  ASSERT_TRUE(checks.ok()) << checks.status();
  EXPECT_EQ(checks->StateOf(0), State::kUnknown) << "there is no scene";
}

TEST(CheckNumbers, ReplyWithTooFewOrTooManyVerdictsIsRefused) {
  const std::vector<uint32_t> numbers = {5, 6, 4096, 4'000'000'000};
  FakeServer server;
  for (const auto& [free, occupied] : {std::pair("", ""), {"\x0f\x0f", "\x01"}, {"\x0f", ""}}) {
    server.check_configurations = BitsOf(GoodBasis(), free, occupied);
    EXPECT_EQ(ClientOfHere(server).CheckNumbers(numbers).status().code(),
              absl::StatusCode::kInternal);
  }
  EXPECT_EQ(ClientOfHere(server).CheckNumbers({}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(CheckConfigurations, OnlyExplicitFreeIsFree) {
  FakeServer server;
  // 17: what a newer server may say.
  server.check_configurations = VerdictsOf({1, 2, 3, 0, 17, -1});
  const auto checks =
      ClientOfHere(server).CheckConfigurations(std::vector<Configuration>(6, kOne[0]));
  ASSERT_TRUE(checks.ok()) << checks.status();
  std::vector<State> states;
  for (const Verdict& verdict : checks->verdicts) states.push_back(verdict.state);
  EXPECT_THAT(states, ElementsAre(State::kFree, State::kOccupied, State::kUnknown, State::kUnknown,
                                  State::kUnknown, State::kUnknown));
  EXPECT_FALSE(checks->AllFree());
}

TEST(CheckConfigurations, FreeWithoutASceneIsUnknown) {
  FakeServer server;
  server.check_configurations = [](auto&, auto&, v1::CheckConfigurationsResponse& response) {
    response.add_verdicts()->set_state(v1::Verdict::STATE_FREE);
    return grpc::Status::OK;
  };
  const auto checks = ClientOfHere(server).CheckConfigurations(kOne);
  ASSERT_TRUE(checks.ok()) << checks.status();
  EXPECT_FALSE(checks->verdicts[0].free());
  EXPECT_EQ(checks->verdicts[0].reason, Reason::kNoScene);
  EXPECT_EQ(checks->basis.Age(), absl::InfiniteDuration());
}

TEST(CheckConfigurations, WrongNumberOfVerdictsIsAnError) {
  FakeServer server;
  for (const std::vector<int>& states : {std::vector<int>{}, {1, 1}}) {
    server.check_configurations = VerdictsOf(states);
    const auto checks = ClientOfHere(server).CheckConfigurations(kOne);
    EXPECT_EQ(checks.status().code(), absl::StatusCode::kInternal);
    EXPECT_THAT(std::string(checks.status().message()),
                AllOf(HasSubstr(server.address), HasSubstr("verdicts for 1 configurations")));
  }
}

TEST(CheckConfigurations, CarriesReasonEvidenceAndBasis) {
  FakeServer server;
  server.check_configurations = [](auto&, auto&, v1::CheckConfigurationsResponse& response) {
    *response.mutable_basis() = GoodBasis();
    v1::Verdict* verdict = response.add_verdicts();
    verdict->set_state(v1::Verdict::STATE_UNKNOWN);
    verdict->set_reason(v1::Verdict::REASON_SCENE_STALE);
    verdict->set_hidden_possible(true);
    v1::ViewEvidence* view = verdict->add_views();
    view->set_view("top");
    view->set_obstacle_pixels(1);
    view->set_unknown_pixels(2);
    view->set_error_pixels(3);
    view->set_missing(true);
    return grpc::Status::OK;
  };
  const auto checks = ClientOfHere(server).CheckConfigurations(kOne);
  ASSERT_TRUE(checks.ok()) << checks.status();
  const Verdict& verdict = checks->verdicts[0];
  EXPECT_EQ(verdict.reason, Reason::kSceneStale);
  EXPECT_TRUE(verdict.hidden_possible);
  ASSERT_EQ(verdict.views.size(), 1u);
  EXPECT_EQ(verdict.views[0].view, "top");
  EXPECT_EQ(verdict.views[0].obstacle_pixels, 1u);
  EXPECT_EQ(verdict.views[0].unknown_pixels, 2u);
  EXPECT_EQ(verdict.views[0].error_pixels, 3u);
  EXPECT_TRUE(verdict.views[0].missing);
  EXPECT_EQ(checks->basis.database_generation, 7u);
  EXPECT_EQ(checks->basis.scene_id, 3u);
  EXPECT_EQ(checks->basis.scene_time, absl::FromUnixMillis(1000'500));
  EXPECT_GE(checks->basis.Age(), absl::Milliseconds(20));
}

TEST(CheckConfigurations, ReasonOfANewerServerIsUnspecified) {
  FakeServer server;
  server.check_configurations = [](auto&, auto&, v1::CheckConfigurationsResponse& response) {
    *response.mutable_basis() = GoodBasis();
    response.add_verdicts()->set_state(v1::Verdict::STATE_UNKNOWN);
    response.mutable_verdicts(0)->set_reason(static_cast<v1::Verdict::Reason>(99));
    return grpc::Status::OK;
  };
  const auto checks = ClientOfHere(server).CheckConfigurations(kOne);
  ASSERT_TRUE(checks.ok());
  EXPECT_EQ(checks->verdicts[0].reason, Reason::kUnspecified);
  EXPECT_EQ(checks->verdicts[0].state, State::kUnknown);
}

TEST(CheckConfigurations, SendsConfigurationsAndPolicy) {
  FakeServer server;
  v1::CheckConfigurationsRequest seen;
  server.check_configurations = [&](auto& context, const v1::CheckConfigurationsRequest& request,
                                    v1::CheckConfigurationsResponse& response) {
    seen = request;
    return VerdictsOf({1})(context, request, response);
  };
  const Client client = ClientOfHere(server);
  ASSERT_TRUE(client
                  .CheckConfigurations({{0.1, 0.2}},
                                       {.preset = "paper",
                                        .min_views = 3,
                                        .max_occluded_views = 2,
                                        .off_grid = OffGrid::kNearest},
                                       Evidence::kOmit)
                  .ok());
  EXPECT_THAT(seen.configurations(0).positions(), ElementsAre(0.1, 0.2));
  EXPECT_EQ(seen.policy().preset(), "paper");
  EXPECT_EQ(seen.policy().min_views(), 3);
  EXPECT_EQ(seen.policy().max_occluded_views(), 2);
  EXPECT_EQ(seen.policy().off_grid(), v1::OFF_GRID_NEAREST);
  EXPECT_TRUE(seen.omit_evidence());
  ASSERT_TRUE(client.CheckConfigurations(kOne).ok());
  EXPECT_FALSE(seen.policy().has_min_views());
  EXPECT_EQ(seen.policy().off_grid(), v1::OFF_GRID_UNSPECIFIED);
}

// The reply's verdicts: free with this clearance, occupied, unknown with one that it cannot have.
auto ClearancesOf(double free) {
  return [free](grpc::ServerContext&, const v1::CheckConfigurationsRequest& request,
                v1::CheckConfigurationsResponse& response) {
    *response.mutable_basis() = GoodBasis();
    for (auto [state, clearance] : {std::pair(v1::Verdict::STATE_FREE, free),
                                    {v1::Verdict::STATE_OCCUPIED, 0.0},
                                    {v1::Verdict::STATE_UNKNOWN, 7.0}}) {
      v1::Verdict& verdict = *response.add_verdicts();
      verdict.set_state(state);
      if (!request.include_clearance()) continue;
      verdict.set_clearance(clearance);
      verdict.add_views()->set_distance(clearance);
    }
    return grpc::Status::OK;
  };
}

// A verdict of another variant than was asked for must not be taken for one of it.
TEST(Variants, OfAServerThatDoesNotKnowThemAreAnErrorAndNoVerdict) {
  FakeServer server;
  server.check_configurations = VerdictsOf({v1::Verdict::STATE_FREE});
  server.check_path = [](grpc::ServerContext&, const v1::CheckPathRequest&,
                         v1::CheckPathResponse& response) {
    *response.mutable_basis() = GoodBasis();
    response.mutable_verdict()->set_state(v1::Verdict::STATE_FREE);
    return grpc::Status::OK;
  };
  server.publish_scene = [](grpc::ServerContext&, const v1::PublishSceneRequest&,
                            v1::PublishSceneResponse&) { return grpc::Status::OK; };
  const Client client = ClientOfHere(server).WithVariant("tool");
  v1::PublishSceneRequest scene;
  scene.set_variant("tool");
  for (const absl::Status& status :
       {client.CheckConfigurations(kOne).status(), client.CheckPath(kOne).status(),
        client.PublishScene(scene).status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kUnimplemented) << status;
    EXPECT_THAT(status.message(), HasSubstr("knows no variants"));
  }
  EXPECT_TRUE(ClientOfHere(server).CheckConfigurations(kOne)->verdicts[0].free());
}

TEST(Variants, GoWithEveryQuestionAndComeBackWithTheAnswer) {
  FakeServer server;
  server.check_configurations = [](grpc::ServerContext&,
                                   const v1::CheckConfigurationsRequest& request,
                                   v1::CheckConfigurationsResponse& response) {
    EXPECT_EQ(request.variant(), "tool");
    *response.mutable_basis() = GoodBasis();
    response.mutable_basis()->set_variant(request.variant());
    response.mutable_basis()->set_scene_variant("default");
    response.add_verdicts()->set_state(v1::Verdict::STATE_FREE);
    return grpc::Status::OK;
  };
  const auto checks = ClientOfHere(server)
                          .WithVariant("tool")
                          .WithTimeout(absl::Seconds(19))
                          .CheckConfigurations(kOne);
  ASSERT_TRUE(checks.ok()) << checks.status();
  EXPECT_EQ(checks->basis.variant, "tool");
  EXPECT_EQ(checks->basis.scene_variant, "default");
  EXPECT_TRUE(checks->verdicts[0].free());
}

TEST(Clearance, IsToldOfWhatIsFreeOrOccupiedIfAskedFor) {
  FakeServer server;
  server.check_configurations = ClearancesOf(2.5);
  const Client client = ClientOfHere(server);
  const std::vector<Configuration> three(3, kOne[0]);
  const auto checks =
      client.CheckConfigurations(three, {}, Evidence::kPerView, Clearance::kMeasure);
  ASSERT_TRUE(checks.ok()) << checks.status();
  EXPECT_EQ(checks->verdicts[0].clearance, 2.5);
  EXPECT_EQ(checks->verdicts[0].views[0].distance, 2.5);
  EXPECT_EQ(checks->verdicts[1].clearance, 0);
  EXPECT_EQ(checks->verdicts[2].clearance, std::nullopt);
  EXPECT_EQ(checks->verdicts[2].views[0].distance, std::nullopt);
  EXPECT_EQ(client.CheckConfigurations(three)->verdicts[0].clearance, std::nullopt);
}

TEST(Clearance, ThatCannotBeIsAnError) {
  FakeServer server;
  const std::vector<Configuration> three(3, kOne[0]);
  for (const double clearance : {-1.0, std::nan("")}) {
    server.check_configurations = ClearancesOf(clearance);
    EXPECT_EQ(ClientOfHere(server)
                  .CheckConfigurations(three, {}, Evidence::kPerView, Clearance::kMeasure)
                  .status()
                  .code(),
              absl::StatusCode::kInternal);
  }
}

TEST(Clearance, OfAServerThatDoesNotKnowThemIsAnErrorAndNoVerdict) {
  FakeServer server;
  server.check_configurations = VerdictsOf({1});
  const absl::Status status =
      ClientOfHere(server)
          .CheckConfigurations(kOne, {}, Evidence::kPerView, Clearance::kMeasure)
          .status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(status.message()), HasSubstr("reports no clearances"));
  server.check_configurations = VerdictsOf({3});
  EXPECT_TRUE(ClientOfHere(server)
                  .CheckConfigurations(kOne, {}, Evidence::kPerView, Clearance::kMeasure)
                  .ok())
      << "an unknown verdict has none";
}

TEST(Clearance, OfAFreePathTellsWhereItIsSmallest) {
  FakeServer server;
  v1::CheckPathResponse answer;
  *answer.mutable_basis() = GoodBasis();
  answer.mutable_verdict()->set_state(v1::Verdict::STATE_FREE);
  answer.mutable_verdict()->set_clearance(1.5);
  answer.mutable_narrowest()->set_segment(1);
  answer.mutable_narrowest()->set_fraction(0.75);
  answer.mutable_narrowest()->mutable_configuration()->add_positions(0.5);
  server.check_path = [&](auto&, const v1::CheckPathRequest& request,
                          v1::CheckPathResponse& response) {
    EXPECT_TRUE(request.include_clearance());
    response = answer;
    return grpc::Status::OK;
  };
  const std::vector<Configuration> path = {{0}, {1}, {2}};
  const auto check = ClientOfHere(server).CheckPath(path, {}, Clearance::kMeasure);
  ASSERT_TRUE(check.ok()) << check.status();
  EXPECT_EQ(check->verdict.clearance, 1.5);
  ASSERT_TRUE(check->narrowest);
  EXPECT_EQ(check->narrowest->segment, 1);
  EXPECT_EQ(check->narrowest->fraction, 0.75);
  EXPECT_THAT(check->narrowest->configuration, ElementsAre(0.5));
  answer.clear_narrowest();
  EXPECT_EQ(ClientOfHere(server).CheckPath(path, {}, Clearance::kMeasure).status().code(),
            absl::StatusCode::kInternal);
}

TEST(CheckPath, TellsTheFirstPlaceThatIsNotFree) {
  FakeServer server;
  server.check_path = [](auto&, const v1::CheckPathRequest& request,
                         v1::CheckPathResponse& response) {
    *response.mutable_basis() = GoodBasis();
    response.mutable_verdict()->set_state(v1::Verdict::STATE_OCCUPIED);
    response.set_segment(request.waypoints_size() - 2);
    response.set_fraction(0.25);
    response.mutable_configuration()->add_positions(0.5);
    response.set_checked(12);
    return grpc::Status::OK;
  };
  const Client client = ClientOfHere(server);
  const auto check = client.CheckPath(std::vector<Configuration>{{0}, {1}, {2}});
  ASSERT_TRUE(check.ok()) << check.status();
  EXPECT_EQ(check->verdict.state, State::kOccupied);
  EXPECT_EQ(check->segment, 1);
  EXPECT_EQ(check->fraction, 0.25);
  EXPECT_THAT(check->configuration, ElementsAre(0.5));
  EXPECT_EQ(check->checked, 12);
  EXPECT_EQ(client.CheckPath({}).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(CheckPath, AnswerWithoutAVerdictIsUnknown) {
  FakeServer server;
  server.check_path = [](auto&, auto&, v1::CheckPathResponse& response) {
    *response.mutable_basis() = GoodBasis();
    return grpc::Status::OK;
  };
  const auto check = ClientOfHere(server).CheckPath(kOne);
  ASSERT_TRUE(check.ok());
  EXPECT_EQ(check->verdict.state, State::kUnknown);
}

TEST(Errors, NameTheServerAndTheMend) {
  std::string address;
  { address = FakeServer().address; }
  const auto gone = Client::Connect(address).value().CheckConfigurations(kOne);
  EXPECT_EQ(gone.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(std::string(gone.status().message()),
            "no server answers at " + address + "; start silhouette-server or use another address");
  FakeServer empty;
  const auto unknown_call = ClientOfHere(empty).GetDatabase();
  EXPECT_EQ(unknown_call.status().code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(unknown_call.status().message()), HasSubstr(empty.address));
}

TEST(Errors, RefusalsOfTheServerAreItsOwnWords) {
  FakeServer server;
  server.check_configurations = [](auto&, auto&, auto&) {
    return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "configuration 0 has 2 values");
  };
  const absl::Status status = ClientOfHere(server).CheckConfigurations(kOne).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr(server.address), HasSubstr("configuration 0 has 2 values")));
}

TEST(Errors, ServerThatDoesNotAnswerInTimeIsNamed) {
  FakeServer server;
  server.check_configurations = [](grpc::ServerContext& context, auto&, auto&) {
    while (!context.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return grpc::Status::CANCELLED;
  };
  const Client client = ClientOfHere(server);
  const absl::Status status =
      client.WithTimeout(absl::Milliseconds(30)).CheckConfigurations(kOne).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr(server.address), HasSubstr("within 30 ms; ")));
}

TEST(Errors, TimeThatIsNotPositiveIsRefusedByEveryCall) {
  FakeServer server;
  const std::vector<uint32_t> numbers = {5};
  for (const absl::Duration timeout :
       {absl::ZeroDuration(), absl::Seconds(-1), -absl::InfiniteDuration()}) {
    EXPECT_EQ(Client::Connect(server.address, timeout).status().code(),
              absl::StatusCode::kInvalidArgument);
    const Client client = ClientOfHere(server).WithTimeout(timeout);
    const std::vector<std::pair<std::string, absl::Status>> calls = {
        {"CheckConfigurations", client.CheckConfigurations(kOne).status()},
        {"CheckNumbers", client.CheckNumbers(numbers).status()},
        {"CheckPath", client.CheckPath(kOne).status()},
        {"WatchPath", client.WatchPath(kOne)->Next().status()},
        {"StreamChecks", client.StreamChecks().Send(1, kOne)},
        {"GetConfigurationSpace", client.GetConfigurationSpace().status()},
        {"Explain", client.Explain(kOne[0]).status()},
        {"PublishScene", client.PublishScene({}).status()},
        {"GetScene", client.GetScene().status()},
        {"WatchScenes", client.WatchScenes().Next(absl::Seconds(20)).status()},
        {"GetAcquisition", client.GetAcquisition().status()},
        {"BeginVariantChange", client.BeginVariantChange().status()},
        {"ChangeVariant", client.ChangeVariant("tool").status()},
        {"AllowRegion", client.AllowRegion({}).status()},
        {"RevokeRegion", client.RevokeRegion("part").status()},
        {"ListAllowedRegions", client.ListAllowedRegions().status()},
        {"GetDatabase", client.GetDatabase().status()}};
    for (const auto& [call, status] : calls) {
      EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << call << ": " << status;
    }
  }
}

TEST(Connect, RefusesWhatIsNoAddress) {
  for (const char* address :
       {"", "robot", "robot:", ":50051", "robot:0", "robot:99999", "unix:", "robot:port"}) {
    const absl::Status status = Client::Connect(address).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << address;
    EXPECT_THAT(std::string(status.message()), HasSubstr("host:port"));
  }
  EXPECT_TRUE(Client::Connect("unix:/run/silhouette").ok());
  EXPECT_TRUE(Client::Connect("[::1]:50051").ok());
  EXPECT_FALSE(Client::Connect("::1:50051").ok()) << "which could be an address without a port";
}

TEST(Database, IsReadWhole) {
  FakeServer server;
  server.get_database = [](auto&, auto&, v1::GetDatabaseResponse& response) {
    response.set_cell_name("demo");
    v1::GridJoint& joint = *response.mutable_grid()->add_joints();
    joint.set_name("a");
    joint.set_upper(1);
    joint.set_steps(11);
    response.mutable_grid()->add_tile_edges(4096);
    response.add_views()->set_mask_width(64);
    response.mutable_default_policy()->set_preset("paper");
    return grpc::Status::OK;
  };
  const auto database = ClientOfHere(server).GetDatabase();
  ASSERT_TRUE(database.ok()) << database.status();
  EXPECT_EQ(database->cell_name(), "demo");
  EXPECT_EQ(FromMessage(database->grid())->size(), 11u);
  EXPECT_EQ(database->views(0).mask_width(), 64);
  EXPECT_EQ(FromMessage(database->default_policy()).preset, "paper");
}

TEST(Explain, BringsThePictures) {
  FakeServer server;
  server.explain = [](auto&, auto&, v1::ExplainResponse& response) {
    *response.mutable_basis() = GoodBasis();
    response.mutable_verdict()->set_state(v1::Verdict::STATE_OCCUPIED);
    v1::ViewExplanation& view = *response.add_views();
    view.set_view("top");
    view.set_collision_png("png");
    return grpc::Status::OK;
  };
  const auto explanation = ClientOfHere(server).Explain(kOne[0]);
  ASSERT_TRUE(explanation.ok());
  EXPECT_EQ(explanation->verdict.state, State::kOccupied);
  ASSERT_EQ(explanation->views.size(), 1u);
  EXPECT_EQ(explanation->views[0].collision_png, "png");
}

TEST(Explain, WithARobotMaskThatCannotBeIsAnError) {
  FakeServer server;
  server.explain = [](auto&, auto&, v1::ExplainResponse& response) {
    *response.mutable_basis() = GoodBasis();
    v1::Mask& robot = *response.add_views()->mutable_robot();
    robot.set_width(8);
    robot.set_height(8);
    return grpc::Status::OK;
  };
  const absl::Status status = ClientOfHere(server).Explain(kOne[0]).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("mask"));
}

TEST(Reasons, BetweenGridPointsDoesNotClaimThatSomethingIsFree) {
  EXPECT_THAT(Describe(Reason::kBetweenGridPoints), Not(HasSubstr("free")));
}

TEST(Reasons, EachHasItsOwnWords) {
  std::vector<Reason> reasons;
  for (int reason = 0; reason <= v1::Verdict::Reason_MAX; ++reason) {
    reasons.push_back(static_cast<Reason>(reason));
  }
  // Those of the library itself.
  for (Reason reason :
       {Reason::kNotInMap, Reason::kBetweenGridPoints, Reason::kNoUpdate, Reason::kConnectionLost,
        Reason::kUpdateTooOld, Reason::kUpdateExpired, Reason::kUpdateMalformed,
        Reason::kAgeUnknown, Reason::kNotCheckedHere, Reason::kRefused, Reason::kAnswerLate}) {
    reasons.push_back(reason);
  }
  std::set<std::string> names;
  std::set<std::string> descriptions;
  for (Reason reason : reasons) {
    names.insert(NameOf(reason));
    descriptions.insert(Describe(reason));
  }
  EXPECT_EQ(names.size(), reasons.size());
  EXPECT_EQ(descriptions.size(), names.size());
}

}  // namespace
}  // namespace silhouette::client
