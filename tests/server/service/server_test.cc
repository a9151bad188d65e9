// SPDX-License-Identifier: Apache-2.0
// The server as a whole: many clients at once, the end with calls in flight, where it listens.
#include "server/service/server.h"

#include <gmock/gmock.h>
#include <grpc/grpc.h>
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <future>
#include <latch>
#include <mutex>
#include <set>
#include <thread>

#include "tests/server/service/raw_call.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(ServerThreads, ConcurrentPublishAndCheckAgreeInEveryReply) {
  const auto database = NewDatabase();
  TestServer server(database);
  server.Publish(SceneWithBlock(3));  // scene 1; odd scenes have the block, even ones not
  std::atomic<bool> stop = false;
  std::atomic<int> replies = 0;
  const auto expect = [&](const v1::Basis& basis, v1::Verdict::State state) {
    EXPECT_EQ(state,
              basis.scene_id() % 2 == 1 ? v1::Verdict::STATE_OCCUPIED : v1::Verdict::STATE_FREE)
        << "scene " << basis.scene_id();
    ++replies;
  };
  const std::jthread checks([&] {
    while (!stop) {
      const auto response = server.Check({At(3, 0), At(3, 0)});
      for (const auto& verdict : response.verdicts()) expect(response.basis(), verdict.state());
    }
  });
  const std::jthread paths([&] {
    while (!stop) {
      const auto response = server.Path({At(3, 0), At(3, 0)});
      expect(response.basis(), response.verdict().state());
    }
  });
  const std::jthread spaces([&] {
    const uint64_t place = database->grid().NumberOf({3, 0});
    while (!stop) {
      const auto messages = server.Space();
      const auto& tile = messages[0].tiles(0);
      const bool occupied = (static_cast<uint8_t>(tile.occupied()[place / 8]) >> (place % 8)) & 1;
      expect(messages[0].basis(), occupied ? v1::Verdict::STATE_OCCUPIED : v1::Verdict::STATE_FREE);
    }
  });
  const std::jthread explanations([&] {
    while (!stop) {
      const auto response = server.Explain(At(3, 0));
      expect(response.basis(), response.verdict().state());
    }
  });
  uint64_t id = 1;
  while (id < 30 || replies < 60) {
    ++id;
    EXPECT_EQ(server.Publish(id % 2 == 1 ? SceneWithBlock(3) : EmptyCellScene()).id(), id);
  }
  stop = true;
}

TEST(ServerThreads, ReloadUnderLoadNeverMixesGenerations) {
  const auto first = NewDatabase();
  const auto second = NewDatabase({.missing = {{1, 1}}});
  TestServer server(first);
  std::atomic<bool> stop = false;
  std::thread publisher([&] {
    while (!stop) {
      // Aborted is what a scene gets that was made with the database of before.
      const grpc::Status status = server.PublishStatus(server.Stamped(RequestOf(EmptyCellScene())));
      EXPECT_TRUE(status.ok() || status.error_code() == grpc::StatusCode::ABORTED);
    }
  });
  std::thread checker([&] {
    while (!stop) {
      const auto response = server.Check({At(1, 1)});
      const bool free = response.verdicts(0).state() == v1::Verdict::STATE_FREE;
      EXPECT_TRUE(!free || response.basis().database_generation() == first->generation());
    }
  });
  for (int i = 0; i < 20; ++i) {
    server.server->ReplaceDatabase(i % 2 == 0 ? second : first);
    server.Check({At(0, 0)});
  }
  stop = true;
  publisher.join();
  checker.join();
}

// A clock that, once armed, holds every call that asks until it is released. The server's own
// threads, which watch for changes and work maps out, are not held: they asked before any call.
class HoldingClock {
 public:
  Clock Around(Clock inner) {
    return [this, inner] {
      if (IsHeld()) {
        if (!held_once_.exchange(true)) held_.count_down();
        release_.wait();
      }
      return inner();
    };
  }
  // Before the first call.
  void WaitForTheServersOwnThreads() {
    std::unique_lock lock(mutex_);
    asked_.wait(lock, [this] { return own_.size() == 2; });
    known_ = true;
  }
  void Arm() { armed_ = true; }
  void WaitUntilSomebodyIsHeld() { held_.wait(); }
  void Release() {
    armed_ = false;
    release_.count_down();
  }

 private:
  bool IsHeld() {
    const std::lock_guard lock(mutex_);
    if (!known_) own_.insert(std::this_thread::get_id());
    asked_.notify_all();
    return armed_ && !own_.contains(std::this_thread::get_id());
  }

  std::mutex mutex_;
  std::condition_variable asked_;
  std::set<std::thread::id> own_;
  bool known_ = false;
  std::atomic<bool> armed_ = false;
  std::atomic<bool> held_once_ = false;
  std::latch held_{1};
  std::latch release_{1};
};

TEST(ServerThreads, StopFinishesTheCallThatIsInFlight) {
  HoldingClock holding;
  TestServer server(NewDatabase(), {}, [&](Clock inner) { return holding.Around(inner); });
  holding.WaitForTheServersOwnThreads();
  server.Publish(EmptyCellScene());
  holding.Arm();
  auto answer = std::async(std::launch::async, [&] { return server.Path({At(0, 0), At(1, 0)}); });
  holding.WaitUntilSomebodyIsHeld();
  auto stopped = std::async(std::launch::async, [&] { server.server->Stop(absl::Seconds(60)); });
  // New calls are turned away as soon as the server has heard of its end.
  v1::CheckConfigurationsResponse response;
  const auto begun = std::chrono::steady_clock::now();
  grpc::Status status;
  do {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(200));
    status = v1::DatabaseService::NewStub(
                 grpc::CreateChannel(server.server->address(), grpc::InsecureChannelCredentials()))
                 ->GetDatabase(&context, {}, std::make_unique<v1::GetDatabaseResponse>().get());
  } while (status.ok() && std::chrono::steady_clock::now() - begun < std::chrono::seconds(30));
  EXPECT_FALSE(status.ok());
  holding.Release();
  EXPECT_EQ(answer.get().verdict().state(), v1::Verdict::STATE_FREE);
  stopped.get();
}

TEST(ServerThreads, StopCancelsWhatTakesLongerThanItsGrace) {
  HoldingClock holding;
  TestServer server(NewDatabase(), {}, [&](Clock inner) { return holding.Around(inner); });
  holding.WaitForTheServersOwnThreads();
  server.Publish(EmptyCellScene());
  holding.Arm();
  auto answer = std::async(std::launch::async, [&] {
    v1::CheckPathRequest request;
    for (int i = 0; i < 2; ++i) Set(At(0, 0), request.add_waypoints());
    v1::CheckPathResponse response;
    return server.Call(request, &response);
  });
  holding.WaitUntilSomebodyIsHeld();
  auto stopped =
      std::async(std::launch::async, [&] { server.server->Stop(absl::Milliseconds(50)); });
  EXPECT_FALSE(answer.get().ok());
  holding.Release();
  stopped.get();
}

TEST(Server, ListensOnAFreePortAndTellsWhich) {
  const auto database = NewDatabase();
  const auto server = Server::Start("127.0.0.1:0", database, {});
  ASSERT_TRUE(server.ok()) << server.status();
  EXPECT_THAT((*server)->address(), StartsWith("127.0.0.1:"));
  EXPECT_NE((*server)->address(), "127.0.0.1:0");
  const auto stub = v1::DatabaseService::NewStub(
      grpc::CreateChannel((*server)->address(), grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  v1::GetDatabaseResponse response;
  EXPECT_TRUE(stub->GetDatabase(&context, {}, &response).ok());
}

// Else its end may take ten seconds, which is longer than a program has.
TEST(Server, EndOfTheLastDoesNotShutDownGrpc) {
  { const TestServer server(NewDatabase()); }
  EXPECT_TRUE(grpc_is_initialized());
}

TEST(Server, AddressInUseIsRefused) {
  const auto database = NewDatabase();
  const auto first = Server::Start("127.0.0.1:0", database, {});
  ASSERT_TRUE(first.ok()) << first.status();
  const auto second = Server::Start((*first)->address(), database, {});
  EXPECT_TRUE(absl::IsFailedPrecondition(second.status())) << second.status();
  EXPECT_THAT(second.status().message(), HasSubstr("is in use"));
  const std::filesystem::path folder = FreshFolder();
  const std::string path = "unix:" + (folder / "socket").string();
  const auto third = Server::Start(path, database, {});
  ASSERT_TRUE(third.ok()) << third.status();
  const auto fourth = Server::Start(path, database, {});
  EXPECT_THAT(fourth.status().message(), HasSubstr("another server listens there"));
}

TEST(ListenAddress, WhatIsNoneIsRefused) {
  for (const std::string address : {"", "127.0.0.1", ":50051", "127.0.0.1:", "127.0.0.1:port",
                                    "127.0.0.1:70000", "127.0.0.1:-1", "unix:"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(CheckListenAddress(address))) << address;
  }
  EXPECT_TRUE(absl::IsFailedPrecondition(CheckListenAddress("192.0.2.7:50051")));
  EXPECT_THAT(CheckListenAddress("unix:/no/such/folder/s").message(), HasSubstr("/no/such/folder"));
  const std::filesystem::path folder = FreshFolder();
  std::ofstream(folder / "file") << "not a socket";
  EXPECT_THAT(CheckListenAddress("unix:" + (folder / "file").string()).message(),
              HasSubstr("is no socket"));
  EXPECT_TRUE(CheckListenAddress("127.0.0.1:0").ok());
}

TEST(Server, AnswersHealthChecksForEveryService) {
  TestServer server(NewDatabase());
  for (const std::string name : {"", "silhouette.v1.CollisionService", "silhouette.v1.SceneService",
                                 "silhouette.v1.DatabaseService"}) {
    EXPECT_EQ(HealthOf(server.channel, name), "\x08\x01") << "SERVING";
  }
}

TEST(Server, ReflectsItsServices) {
  TestServer server(NewDatabase());
  const std::string services =
      RawCall(server.channel, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
              std::string("\x3a\x01*"));
  for (const char* name : {"silhouette.v1.CollisionService", "silhouette.v1.SceneService",
                           "silhouette.v1.DatabaseService", "grpc.health.v1.Health"}) {
    EXPECT_THAT(services, HasSubstr(name));
  }
  // The file that has a symbol, by its name.
  const std::string file =
      RawCall(server.channel, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
              "\x22\x15grpc.health.v1.Health");
  EXPECT_THAT(file, HasSubstr("HealthCheckResponse"));
}

TEST(ServerStreams, SilentOneLastsWhileItsClientAsksForSignsOfLife) {
  TestServer server(NewDatabase());
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 200);  // gRPC makes a second of it
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  const auto collision = v1::CollisionService::NewStub(grpc::CreateCustomChannel(
      server.server->address(), grpc::InsecureChannelCredentials(), arguments));
  grpc::ClientContext context;
  const auto stream = collision->StreamChecks(&context);
  v1::StreamChecksRequest question;
  Set(At(0, 0), question.mutable_configurations()->add_configurations());
  v1::StreamChecksResponse answer;
  ASSERT_TRUE(stream->Write(question));
  ASSERT_TRUE(stream->Read(&answer));
  std::thread asks_later([&] {
    std::this_thread::sleep_for(std::chrono::seconds(6));
    stream->Write(question);
    stream->WritesDone();
  });
  EXPECT_TRUE(stream->Read(&answer));
  asks_later.join();
  const grpc::Status end = stream->Finish();
  EXPECT_TRUE(end.ok()) << end.error_message();
}

}  // namespace
}  // namespace silhouette
