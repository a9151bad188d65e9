// SPDX-License-Identifier: Apache-2.0
// Running programs as a user does, in a folder of the test's own.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

namespace silhouette {

inline std::string ContentOf(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

inline void WriteFile(const std::filesystem::path& file, const std::string& content) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << content;
}

// How a command ended, and what it wrote.
struct Ended {
  int exit_code = -1;  // 128 + the signal's number if one ended it
  std::string out;
  std::string err;
};

// A new folder that goes away with this object.
class Shell {
 public:
  Shell() {
    std::string pattern = testing::TempDir() + "silhouette-XXXXXX";
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder");
    folder_ = pattern;
  }
  ~Shell() { std::filesystem::remove_all(folder_); }
  Shell(const Shell&) = delete;
  Shell& operator=(const Shell&) = delete;

  const std::filesystem::path& folder() const { return folder_; }

  // Runs a command line of sh in the folder.
  Ended Run(const std::string& command) const {
    const std::string line = "cd '" + folder_.string() + "' && (" + command + ") >.out 2>.err";
    const int status = std::system(line.c_str());
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return {
        .exit_code = code, .out = ContentOf(folder_ / ".out"), .err = ContentOf(folder_ / ".err")};
  }

 private:
  std::filesystem::path folder_;
};

}  // namespace silhouette
