// SPDX-License-Identifier: Apache-2.0
// Running programs as a user does, in a folder of the test's own.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>

#include "tests/folders.h"
#include "tests/test_folder.h"

namespace silhouette {

inline std::string ContentOf(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

// How a command ended, and what it wrote.
struct Ended {
  int exit_code = -1;  // 128 + the signal's number if one ended it
  std::string out;
  std::string err;
};

// A new folder, and programs that run in it.
class Shell {
 public:
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
  const std::filesystem::path folder_ = FreshFolder();
};

// A test of a program in a new folder.
class ProgramTest : public testing::Test {
 protected:
  // `program`: its name, and the arguments that all of its calls begin with.
  explicit ProgramTest(std::string program) : program_(std::move(program)) {}

  Ended Run(const std::string& arguments) const {
    return shell_.Run(ProgramFolder() + "/" + program_ + " " + arguments);
  }
  void Write(const std::string& name, const std::string& text) const {
    WriteFile(folder_ / name, text);
  }
  std::string Read(const std::string& name) const { return ContentOf(folder_ / name); }

 private:
  const std::string program_;
  const Shell shell_;

 protected:
  const std::filesystem::path folder_ = shell_.folder();
};

}  // namespace silhouette
