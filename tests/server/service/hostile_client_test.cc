// SPDX-License-Identifier: Apache-2.0
// Clients that send what they must not, too much of it, or hold what they have.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <future>
#include <latch>
#include <thread>

#include "server/service/calls.h"
#include "tests/server/service/raw_call.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

bool IsOfPool(const std::string& pool) {
  std::array<char, 16> name{};
  pthread_getname_np(pthread_self(), name.data(), name.size());
  return name.data() == pool;
}

// A clock at which the threads of a pool wait until it is released.
class ClockThatHolds {
 public:
  explicit ClockThatHolds(std::string pool) : pool_(std::move(pool)) {}
  Clock Around(Clock inner) {
    return [this, inner] {
      if (IsOfPool(pool_)) {
        if (!release_.try_wait()) held_.count_down();
        release_.wait();
      }
      return inner();
    };
  }
  void WaitUntilTwoAreHeld() { held_.wait(); }
  void Release() { release_.count_down(); }

 private:
  const std::string pool_;
  std::latch held_{2};
  std::latch release_{1};
};

TEST(HostileClientThreads, ScenesAreTakenWhileChecksHoldAllTheirWorkersAndFillTheirQueue) {
  ClockThatHolds holding("checks");
  ServingSettings settings;
  settings.limits.waiting = 4;
  TestServer server(NewDatabase(), settings, [&](Clock inner) { return holding.Around(inner); });
  std::vector<std::future<grpc::Status>> paths;
  v1::CheckPathRequest request;
  for (int i = 0; i < 2; ++i) Set(At(0, 0), request.add_waypoints());
  for (int i = 0; i < 2; ++i) {
    paths.push_back(std::async(std::launch::async, [&] {
      v1::CheckPathResponse response;
      return server.Call(request, &response);
    }));
  }
  holding.WaitUntilTwoAreHeld();
  // Four more wait; the others find the queue full.
  std::atomic<int> refused = 0;
  for (int i = 0; i < 6; ++i) {
    paths.push_back(std::async(std::launch::async, [&] {
      v1::CheckPathResponse response;
      const grpc::Status status = server.Call(request, &response);
      if (status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED) ++refused;
      return status;
    }));
  }
  while (refused < 2) std::this_thread::yield();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
  v1::PublishSceneResponse response;
  const grpc::Status published =
      v1::SceneService::NewStub(server.channel)
          ->PublishScene(&context, server.Stamped(RequestOf(EmptyCellScene())), &response);
  EXPECT_TRUE(published.ok()) << published.error_message();
  EXPECT_EQ(response.scene().id(), 1u);
  holding.Release();
  for (std::future<grpc::Status>& path : paths) path.get();
}

TEST(HostileClientThreads, LifeIsShownHoweverManyScenesWaitButNotWhileTheirThreadsHang) {
  ClockThatHolds holding("scenes");
  ServingSettings settings;
  settings.limits.waiting = 2;
  TestServer server(NewDatabase(), settings, [&](Clock inner) { return holding.Around(inner); });
  const v1::PublishSceneRequest request = server.Stamped(RequestOf(EmptyCellScene()));
  std::atomic<int> refused = 0;
  std::vector<std::future<void>> clients;
  const auto publish = [&] {
    clients.push_back(std::async(std::launch::async, [&] {
      if (!server.PublishStatus(request).ok()) ++refused;
    }));
  };
  for (int i = 0; i < 2; ++i) publish();
  holding.WaitUntilTwoAreHeld();
  // Two more wait; the others find the queue full.
  for (int i = 0; i < 4; ++i) publish();
  while (refused < 2) std::this_thread::yield();
  auto life = std::make_shared<std::promise<void>>();
  std::future<void> shown = life->get_future();
  server.server->RunWhereScenesAreTaken([life] { life->set_value(); });
  life.reset();
  EXPECT_EQ(shown.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  holding.Release();
  EXPECT_NO_THROW(shown.get()) << "the task was refused";
  for (std::future<void>& client : clients) client.get();
}

TEST(HostileClient, ManySearchesAreNotMadeInTheThreadsThatScenesComeThrough) {
  std::atomic<int> by_workers = 0;
  TestServer server(NewDatabase({.calibration = TestCalibration()}), {}, [&](Clock inner) {
    return [&, inner] {
      if (IsOfPool("checks")) ++by_workers;
      return inner();
    };
  });
  server.Publish(EmptyCellScene());
  const std::vector<Configuration> many(5, At(1, 0));
  server.Check(many, PolicyNamed("uncalibrated"));
  EXPECT_EQ(by_workers, 0) << "look-ups are";
  server.Check(many, PolicyNamed("calibrated"));
  EXPECT_GT(by_workers, 0);
}

TEST(HostileClient, LongTextIsRefusedWithoutBeingRepeated) {
  TestServer server(NewDatabase());
  const std::string text(kLongestText + 1, 'x');
  v1::RevokeRegionRequest revoke;
  revoke.set_name(text);
  v1::RevokeRegionResponse revoked;
  const grpc::Status named = server.Call(&v1::SceneService::Stub::RevokeRegion, revoke, &revoked);
  EXPECT_EQ(named.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(named.error_message(), AllOf(HasSubstr("name: "), HasSubstr("257 bytes"),
                                           HasSubstr("at most 256"), Not(HasSubstr("xxx"))));
  revoke.set_name(text.substr(1));
  EXPECT_TRUE(server.Call(&v1::SceneService::Stub::RevokeRegion, revoke, &revoked).ok());

  v1::PublishSceneRequest scene = RequestOf(EmptyCellScene());
  scene.mutable_views(2)->set_view(text);
  EXPECT_THAT(server.PublishStatus(scene).error_message(), HasSubstr("views[2].view: "));
  v1::CheckConfigurationsRequest check;
  check.mutable_policy()->set_preset(text);
  v1::CheckConfigurationsResponse checked;
  EXPECT_THAT(server.Call(check, &checked).error_message(), HasSubstr("policy.preset: "));
}

TEST(HostileClient, RequestOfMoreBytesThanItsCallTakesIsRefused) {
  TestServer server(NewDatabase());
  v1::RevokeRegionRequest request;
  request.set_name(std::string(kMostBytes<v1::RevokeRegionRequest>, 'x'));
  v1::RevokeRegionResponse response;
  const grpc::Status status =
      server.Call(&v1::SceneService::Stub::RevokeRegion, request, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("at most 1048576"));
}

TEST(HostileClient, WhatCannotBeParsedIsAnInvalidArgumentInEveryCall) {
  TestServer server(NewDatabase());
  for (const char* call :
       {"CollisionService/CheckConfigurations", "CollisionService/CheckPath",
        "CollisionService/GetConfigurationSpace", "CollisionService/WatchConfigurationSpace",
        "CollisionService/WatchPath", "CollisionService/StreamChecks", "CollisionService/Explain",
        "SceneService/PublishScene", "SceneService/GetScene", "SceneService/ChangeVariant",
        "SceneService/AllowRegion", "SceneService/RevokeRegion", "SceneService/ListAllowedRegions",
        "DatabaseService/GetDatabase"}) {
    std::string response;
    const grpc::Status status =
        RawStatus(server.channel, std::string("/silhouette.v1.") + call, "\xff\xff\xff", &response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << call;
    EXPECT_THAT(status.error_message(), HasSubstr("cannot be parsed")) << call;
    EXPECT_EQ(response, "") << call;
  }
}

TEST(HostileClient, ErrorNamesItsFieldForPrograms) {
  TestServer server(NewDatabase());
  v1::PublishSceneRequest request = server.Stamped(RequestOf(EmptyCellScene()));
  request.mutable_views(1)->mutable_scene_mask()->set_bits("too short");
  const grpc::Status status = server.PublishStatus(request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("views[1] 'right'.scene_mask: "));
  EXPECT_THAT(status.error_details(),
              AllOf(HasSubstr("type.googleapis.com/google.rpc.BadRequest"),
                    HasSubstr(std::string("\x0a\x13views[1].scene_mask\x12"))));
}

TEST(HostileClientThreads, StreamsOfAClientAreLimited) {
  ServingSettings settings;
  settings.limits.streams_per_client = 1;
  TestServer server(NewDatabase(), settings);
  const auto watch = [&](grpc::ClientContext& context) {
    return server.collision->WatchConfigurationSpace(&context, {});
  };
  grpc::ClientContext first_context;
  const auto first = watch(first_context);
  v1::WatchConfigurationSpaceResponse message;
  ASSERT_TRUE(first->Read(&message));
  grpc::ClientContext second_context;
  const grpc::Status refused = watch(second_context)->Finish();
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(refused.error_message(), HasSubstr("'streams_per_client' (1)"));
  first_context.TryCancel();
  for (bool again = false; !again;) {
    grpc::ClientContext context;
    again = watch(context)->Read(&message);
    context.TryCancel();
  }
}

TEST(HostileClient, CallsPerSecondOfAClientAreLimited) {
  ServingSettings settings;
  settings.limits.calls_per_second = 0.001;
  TestServer server(NewDatabase(), settings);
  server.GetDatabase();
  v1::GetDatabaseResponse response;
  const grpc::Status status =
      server.Call(&v1::DatabaseService::Stub::GetDatabase, v1::GetDatabaseRequest(), &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("'calls_per_second'"));
}

// A connection that is open at `address`, on which nothing is sent.
Descriptor SilentConnection(const std::string& address) {
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  address.copy(name.sun_path, sizeof(name.sun_path) - 1, 5);
  Descriptor connection(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  EXPECT_EQ(connect(connection.number(), reinterpret_cast<sockaddr*>(&name), sizeof(name)), 0)
      << strerror(errno);
  return connection;
}

// Whether the server closes it, before it says anything.
bool IsRefused(const Descriptor& connection) {
  char byte = 0;
  return read(connection.number(), &byte, 1) <= 0;  // gRPC begins with its settings
}

TEST(HostileClientThreads, ConnectionsOfAClientAreLimitedAndCountNoLongerThanTheyLast) {
  ServingSettings settings;
  settings.limits.connections_per_client = 3;
  TestServer server(NewDatabase(), settings);
  const std::string& address = server.server->address();
  std::vector<Descriptor> held;
  for (int i = 0; i < 3; ++i) {
    held.push_back(SilentConnection(address));
    EXPECT_FALSE(IsRefused(held.back()));
  }
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(IsRefused(SilentConnection(address)));
  held.clear();
  while (IsRefused(SilentConnection(address))) std::this_thread::yield();
  server.GetDatabase();
}

TEST(HostileClientThreads, ServerEndsWhateverItsClientsHold) {
  TestServer server(NewDatabase());
  grpc::ClientContext context;
  const auto watch = server.collision->WatchConfigurationSpace(&context, {});
  v1::WatchConfigurationSpaceResponse message;
  ASSERT_TRUE(watch->Read(&message));  // and reads no more
  grpc::ClientContext stream_context;
  const auto stream = server.collision->StreamChecks(&stream_context);
  const Descriptor silent = SilentConnection(server.server->address());
  const Descriptor half = SilentConnection(server.server->address());
  ASSERT_EQ(write(half.number(), "PRI * HTTP", 10), 10);
  EXPECT_FALSE(IsRefused(half));
  auto stopped =
      std::async(std::launch::async, [&] { server.server->Stop(absl::Milliseconds(200)); });
  EXPECT_EQ(stopped.wait_for(std::chrono::seconds(10)), std::future_status::ready);
  EXPECT_EQ(watch->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(HostileClientThreads, ListenerTakesConnectionsAgainAfterDescriptorsRanOut) {
  const std::filesystem::path folder = FreshFolder();
  Clients clients({});
  absl::StatusOr<std::unique_ptr<Listener>> listener =
      Listener::Open("unix:" + (folder / "s").string(), clients);
  ASSERT_TRUE(listener.ok()) << listener.status();
  std::atomic<int> taken = 0;
  (*listener)->Start([&](int, int connection) {
    ++taken;
    shutdown(connection, SHUT_RDWR);
    close(connection);
  });
  const std::string& address = (*listener)->address();
  EXPECT_TRUE(IsRefused(SilentConnection(address)));
  EXPECT_EQ(taken, 1);
  rlimit before{};
  getrlimit(RLIMIT_NOFILE, &before);
  const rlimit few{.rlim_cur = 512, .rlim_max = before.rlim_max};
  setrlimit(RLIMIT_NOFILE, &few);
  Descriptor waiting(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  {
    std::vector<Descriptor> all;
    do {
      all.emplace_back(dup(STDERR_FILENO));
    } while (all.back().open());
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    address.copy(name.sun_path, sizeof(name.sun_path) - 1, 5);
    ASSERT_EQ(connect(waiting.number(), reinterpret_cast<sockaddr*>(&name), sizeof(name)), 0);
    EXPECT_TRUE(IsRefused(waiting));
    EXPECT_EQ(taken, 1);
  }
  setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_TRUE(IsRefused(SilentConnection(address)));
  EXPECT_EQ(taken, 2);
}

TEST(Clients, AreToldApartByTheirAddressWhateverTheirPort) {
  EXPECT_EQ(ClientOf("ipv4:10.1.2.3:4711"), "10.1.2.3");
  EXPECT_EQ(ClientOf("ipv4:10.1.2.3:4712"), "10.1.2.3");
  EXPECT_EQ(ClientOf("ipv6:%5B::1%5D:4711"), "::1");
  EXPECT_EQ(ClientOf("ipv6:%5Bfe80::7%25eth0%5D:4711"), "fe80::7");
  EXPECT_EQ(ClientOf("unix:"), "unix");
  EXPECT_EQ(ClientOf("unix:/run/s"), "unix");
}

TEST(Clients, HostWithManyAddressesIsOne) {
  EXPECT_EQ(ClientOf("ipv6:%5B2001:db8:1:2::1%5D:4711"), "2001:db8:1:2::/64");
  EXPECT_EQ(ClientOf("ipv6:%5B2001:db8:1:2:3:4:5:6%5D:4711"), "2001:db8:1:2::/64");
  EXPECT_EQ(ClientAt("2001:db8:1:3::1"), "2001:db8:1:3::/64");
  EXPECT_EQ(ClientAt("::ffff:192.0.2.1"), "192.0.2.1");
  EXPECT_EQ(ClientAt("fe80::1"), "fe80::1");
}

TEST(Clients, AreBoundedInNumber) {
  Clients clients({});
  const absl::StatusOr<Clients::Place> place = clients.Connection("first");
  for (size_t i = 0; i < 2 * Clients::kMost; ++i) {
    EXPECT_TRUE(clients.Call(std::to_string(i)).ok());
  }
  EXPECT_LE(clients.Counts().size(), Clients::kMost);
  std::vector<Clients::Place> places;
  for (size_t i = 0; i < 2 * Clients::kMost; ++i) {
    absl::StatusOr<Clients::Place> held = clients.Connection("c" + std::to_string(i));
    if (held.ok()) places.push_back(*std::move(held));
  }
  EXPECT_LE(clients.Counts().size(), Clients::kMost + 1);
  int first = 0;
  int others = 0;
  for (const ClientCounts& counts : clients.Counts()) {
    if (counts.client == "first") first = counts.connections;
    if (counts.client == Clients::kOthers) others = counts.connections;
  }
  EXPECT_EQ(first, 1) << "who is connected is not forgotten";
  EXPECT_EQ(others, 200) << "they share the limit of one client";
}

}  // namespace
}  // namespace silhouette
