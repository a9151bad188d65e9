// SPDX-License-Identifier: Apache-2.0
// silhouette-sim serve, as its user runs it.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/capture/session/program_cell.h"

namespace silhouette {

// silhouette-sim serve, for as long as it lives.
class Served {
 public:
  Served(const std::string& cell, const std::vector<std::string>& more) {
    std::vector<std::string> words = {"serve", "--cell", cell, "--format", "json"};
    words.insert(words.end(), more.begin(), more.end());
    int ends[2];
    EXPECT_EQ(pipe(ends), 0);
    child_ = fork();
    if (child_ == 0) {
      dup2(ends[1], STDOUT_FILENO);
      close(ends[0]);
      Become("silhouette-sim", words);
    }
    close(ends[1]);
    // It says where its devices are as soon as they can be reached.
    std::string line;
    for (char c = 0; read(ends[0], &c, 1) == 1 && c != '\n';) line += c;
    close(ends[0]);
    told_ = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
    EXPECT_FALSE(told_.is_discarded()) << line;
  }
  ~Served() { End(); }

  const nlohmann::json& told() const { return told_; }

  void End() {
    if (child_ == 0) return;
    kill(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
    child_ = 0;
  }

 private:
  pid_t child_ = 0;
  nlohmann::json told_;
};

}  // namespace silhouette
