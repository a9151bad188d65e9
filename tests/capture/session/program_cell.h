// SPDX-License-Identifier: Apache-2.0
// A small simulated cell in a folder of its own, and silhouette-capture as its user runs it.
// Without noise, so that the same configuration always gives the same masks.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/time/clock.h"
#include "db/store/store.h"
#include "tests/db/store/test_cell.h"
#include "tests/folders.h"

namespace silhouette {

inline std::string ReadText(const std::string& path) {
  std::ifstream in(path);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline void WriteText(const std::string& path, const std::string& text) {
  std::ofstream(path) << text;
}

// This process goes on as the program with these arguments.
[[noreturn]] inline void Become(const std::string& program,
                                const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {ProgramFolder() + "/" + program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  execv(argv[0], argv.data());
  _exit(127);
}

struct Outcome {
  int exit_code = -1;  // -1: ended by a signal
  std::string out;
  std::string err;
};

class ProgramCell {
 public:
  ProgramCell() {
    WriteText(folder_ / "simulation.yaml",
              "cameras:\n"
              "  top: {image_size: [160, 120], position: [0, 0, 5.4], look_at: [0, 0, 1],\n"
              "        up: [0, 1, 0], field_of_view: 58 deg}\n"
              "  front: {image_size: [160, 120], position: [5.2, 0, 1.3], look_at: [0, 0, 1],\n"
              "          field_of_view: 50 deg}\n"
              "room: {lower: [-6, -6, 0], upper: [6, 6, 6]}\n"
              "noise: 0\n");
    WriteCell({});
  }

  // Writes cell.yaml, with words in it replaced.
  void WriteCell(const std::vector<std::pair<std::string, std::string>>& changes) {
    std::string text = absl::StrCat(
        "name: small\n"
        "simulation: simulation.yaml\n"
        "robot:\n"
        "  driver: sim\n"
        "  urdf: ",
        SourceFolder(),
        "/capture/sim/robots/rx130.urdf\n"
        "  joints:\n"
        "    - {name: joint_1, lower: -150 deg, upper: 150 deg}\n"
        "    - {name: joint_3, lower: -120 deg, upper: 110 deg}\n"
        "  fixed: {joint_2: 40 deg, joint_4: 0, joint_5: 20 deg, joint_6: 0}\n"
        "grid:\n"
        "  steps: {joint_1: 9, joint_3: 5}\n"
        "views:\n"
        "  - {name: top, source: sim, noise: none, image_size: [160, 120], mask_size: [32, 32]}\n"
        "  - {name: front, source: sim, noise: none, image_size: [160, 120], mask_size: [40, 30]}\n"
        "capture:\n"
        "  settle: 5 ms\n"
        "  reference_images: 3\n"
        "  keep_free: 0 B\n"
        "  commit_interval: 20 ms\n");
    for (const auto& [from, to] : changes) {
      ASSERT_NE(text.find(from), std::string::npos) << from;
      text = absl::StrReplaceAll(text, {{from, to}});
    }
    WriteText(cell(), text);
  }

  std::string operator/(const std::string& name) const { return folder_ / name; }
  std::string cell() const { return folder_ / "cell.yaml"; }
  std::string database() const { return folder_ / "cell.lmdb"; }

  // Starts silhouette-capture without an operator; its output goes into files. As another user
  // where `user` is not 0.
  pid_t Start(const std::vector<std::string>& arguments, uid_t user = 0) const {
    const std::string out = folder_ / "out.txt";
    const std::string err = folder_ / "err.txt";
    const pid_t child = fork();
    if (child == 0) {
      dup2(open("/dev/null", O_RDONLY), STDIN_FILENO);
      dup2(open(out.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0666), STDOUT_FILENO);
      dup2(open(err.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0666), STDERR_FILENO);
      if (user != 0 && (setgid(user) != 0 || setuid(user) != 0)) _exit(126);
      Become("silhouette-capture", arguments);
    }
    return child;
  }

  Outcome Wait(pid_t child) const {
    int status = 0;
    waitpid(child, &status, 0);
    return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
            .out = ReadText(folder_ / "out.txt"),
            .err = ReadText(folder_ / "err.txt")};
  }

  Outcome Run(const std::vector<std::string>& arguments) const { return Wait(Start(arguments)); }

  // A subcommand with --cell and --database.
  std::vector<std::string> Arguments(const std::string& subcommand,
                                     const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {subcommand, "--cell", cell(), "--database", database()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }

  void TakeReferences() const {
    const Outcome outcome = Run(Arguments("reference"));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }

  void CaptureAll() const {
    TakeReferences();
    const Outcome outcome = Run(Arguments("run"));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }

  // Number of records that are stored by now; 0 without a database.
  uint64_t Records() const {
    const auto database = Database::Open(this->database(), Database::Access::kRead);
    return database.ok() ? (*database)->Read()->size() : 0;
  }

  // Number of configurations whose camera images are stored, too.
  uint64_t RawImages() const {
    const auto database = Database::Open(this->database(), Database::Access::kRead);
    if (!database.ok()) return 0;
    const auto numbers = (*database)->Read()->RawImageNumbers();
    EXPECT_TRUE(numbers.ok()) << numbers.status();
    return numbers.ok() ? numbers->size() : 0;
  }

  // All records of a variant without their times.
  std::map<ConfigurationNumber, RobotImage> Content(const std::string& variant = "default") const {
    const auto database = Database::Open(this->database(), Database::Access::kRead);
    EXPECT_TRUE(database.ok()) << database.status();
    if (!database.ok()) return {};
    const auto of_variant = (*database)->OpenVariant(variant);
    EXPECT_TRUE(of_variant.ok()) << of_variant.status();
    return ContentWithoutTimes(**of_variant);
  }

 private:
  const std::filesystem::path folder_ = FreshFolder();
};

}  // namespace silhouette
