// SPDX-License-Identifier: Apache-2.0
// A browser without a screen, driven by the W3C WebDriver protocol.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/running_program.h"
#include "tests/server/page/http.h"
#include "tests/test_folder.h"

namespace silhouette {

class Browser {
 public:
  Browser(int width, int height)
      : driver_({"/usr/bin/chromedriver", "--port=0"}, folder_ / "out", folder_ / "out") {
    const std::string start = "successfully on port ";
    size_t at = std::string::npos;
    for (int tries = 0; tries < 1000 && at == std::string::npos; ++tries) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      at = driver_.Output().find(start);
    }
    if (at == std::string::npos) {
      ADD_FAILURE() << "the driver does not start: " << driver_.Output();
      return;
    }
    client_ = std::make_unique<httplib::Client>(
        "127.0.0.1", std::stoi(driver_.Output().substr(at + start.size())));
    client_->set_read_timeout(60);
    const nlohmann::json options = {
        {"binary", "/usr/bin/chromium"},
        {"args",
         {"--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
          "--no-first-run", "--disable-extensions", "--disable-background-networking",
          absl::StrCat("--window-size=", width, ",", height)}}};
    const nlohmann::json made =
        Post("/session", {{"capabilities", {{"alwaysMatch", {{"goog:chromeOptions", options}}}}}});
    session_ = "/session/" + made.value("sessionId", "");
  }
  ~Browser() {
    if (client_ != nullptr) client_->Delete(session_);
  }

  void Open(const std::string& url) { Post(session_ + "/url", {{"url", url}}); }

  // What the body of a function returns.
  nlohmann::json Run(const std::string& script) {
    return Post(session_ + "/execute/sync",
                {{"script", script}, {"args", nlohmann::json::array()}});
  }

  // The text of the first element that a selector finds; empty: there is none.
  std::string Text(const std::string& selector) {
    return Run("const found = document.querySelector(" + nlohmann::json(selector).dump() +
               "); return found ? found.textContent : '';")
        .get<std::string>();
  }

  // Drags the mouse from one place of an element to another: shares of its width and height.
  struct Place {
    double x = 0;
    double y = 0;
  };
  void Drag(const std::string& selector, Place from, Place to) {
    const std::string found = "document.querySelector(" + nlohmann::json(selector).dump() + ")";
    const nlohmann::json box = Run("const found = " + found +
                                   "; found.scrollIntoView({block: 'center'});"
                                   "const box = found.getBoundingClientRect();"
                                   "return [box.left, box.top, box.width, box.height];");
    const auto move = [&](Place to_place) {
      return nlohmann::json{
          {"type", "pointerMove"},
          {"origin", "viewport"},
          {"duration", 50},
          {"x", std::lround(box[0].get<double>() + to_place.x * box[2].get<double>())},
          {"y", std::lround(box[1].get<double>() + to_place.y * box[3].get<double>())}};
    };
    Act({{"type", "pointer"},
         {"id", "mouse"},
         {"parameters", {{"pointerType", "mouse"}}},
         {"actions",
          {move(from),
           {{"type", "pointerDown"}, {"button", 0}},
           move(to),
           {{"type", "pointerUp"}, {"button", 0}}}}});
  }

  // Presses and releases keys, by their codes in WebDriver, while `held` is down if not empty.
  void Press(const std::vector<std::string>& keys, const std::string& held = "") {
    nlohmann::json actions = nlohmann::json::array();
    const auto add = [&](const char* type, const std::string& key) {
      actions.push_back({{"type", type}, {"value", key}});
    };
    if (!held.empty()) add("keyDown", held);
    for (const std::string& key : keys) {
      add("keyDown", key);
      add("keyUp", key);
    }
    if (!held.empty()) add("keyUp", held);
    Act({{"type", "key"}, {"id", "keyboard"}, {"actions", actions}});
  }

 private:
  void Act(const nlohmann::json& source) { Post(session_ + "/actions", {{"actions", {source}}}); }

  nlohmann::json Post(const std::string& path, const nlohmann::json& body) {
    const auto answer = client_->Post(path, body.dump(), "application/json");
    if (!answer) {
      ADD_FAILURE() << "the driver does not answer";
      return {};
    }
    EXPECT_EQ(answer->status, 200) << answer->body;
    return nlohmann::json::parse(answer->body)["value"];
  }

  const std::filesystem::path folder_ = FreshFolder();
  RunningProgram driver_;
  std::unique_ptr<httplib::Client> client_;
  std::string session_;
};

}  // namespace silhouette
