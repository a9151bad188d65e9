// SPDX-License-Identifier: Apache-2.0
// A page of a test server, and who looks at it.
#pragma once

#include <google/protobuf/message.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>

#include "server/page/page.h"
#include "tests/server/page/http.h"
#include "tests/server/service/test_server.h"

namespace silhouette {

inline std::unique_ptr<CellPage> StartPage(TestServer& test,
                                           std::optional<Role> role = std::nullopt) {
  auto page = CellPage::Start("127.0.0.1:0", /*insecure=*/false, test.server->serving(), role);
  EXPECT_TRUE(page.ok()) << page.status();
  return *std::move(page);
}

inline nlohmann::json JsonText(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string text;
  EXPECT_TRUE(google::protobuf::util::MessageToJsonString(message, &text, options).ok());
  return nlohmann::json::parse(text);
}

// Reads the events of a page until Stop(), or until `enough` returns true for one.
class Looker {
 public:
  // Then it gives up.
  static constexpr int kMostEvents = 100;
  using Enough = std::function<bool(const nlohmann::json&)>;

  Looker(const CellPage& page, const std::string& query, Enough enough)
      : thread_([this, address = page.address(), query, enough = std::move(enough)] {
          httplib::Client client("http://" + address);
          std::string text;
          const auto answer = client.Get(
              "/events" + query, httplib::Headers(),
              [&](const httplib::Response& response) {
                status = response.status;
                return response.status == 200;
              },
              [&](const char* bytes, size_t count) {
                text.append(bytes, count);
                for (size_t end = text.find("\n\n"); end != text.npos; end = text.find("\n\n")) {
                  event = nlohmann::json::parse(text.substr(6, end - 6));
                  ++events;
                  text.erase(0, end + 2);
                  if (enough(event) || events >= kMostEvents) return false;
                }
                return !stop_;
              });
        }) {}
  ~Looker() { Stop(); }

  void Wait() { thread_.join(); }
  void Stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }

  nlohmann::json event;  // the last, once it has ended
  std::atomic<int> events = 0;
  std::atomic<int> status = 0;

 private:
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

// The first snapshot that is enough.
inline nlohmann::json SeenOn(
    const CellPage& page, const std::string& query = "",
    const Looker::Enough& enough = [](const nlohmann::json&) { return true; }) {
  Looker looker(page, query, [&](const nlohmann::json& event) { return enough(event["now"]); });
  looker.Wait();
  EXPECT_EQ(looker.status, 200);
  return looker.event["now"];
}

// Waits for at most so long.
inline bool Soon(const std::function<bool()>& holds,
                 std::chrono::milliseconds longest = std::chrono::seconds(10)) {
  const auto end = std::chrono::steady_clock::now() + longest;
  while (!holds()) {
    if (std::chrono::steady_clock::now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

}  // namespace silhouette
