// SPDX-License-Identifier: Apache-2.0
// A cell that silhouette-server serves, small enough to know every verdict: two joints of 11
// values, two views of 16 x 16 pixels. The robot is a block of 3 x 3 pixels that joint x moves to
// the right and joint y moves down, a pixel per step; both views see the same.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "common/picture/mask_png.h"
#include "db/mask/mask.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {

inline constexpr MaskSize kViewSize{16, 16};
inline constexpr int kSteps = 11;
inline constexpr double kStep = 0.1;

// The robot at grid index (x, y).
inline Mask RobotAt(int x, int y) {
  return Mask::FromPredicate(kViewSize, [&](int column, int row) {
    return column >= x + 1 && column <= x + 3 && row >= y + 1 && row <= y + 3;
  });
}

inline Mask Block(int left, int top, int right, int bottom) {
  return Mask::FromPredicate(kViewSize, [&](int column, int row) {
    return column >= left && column <= right && row >= top && row <= bottom;
  });
}

inline const Mask kNothing(kViewSize);
// From the upper rim down; the robot passes below it in two rows.
inline const Mask kWall = Block(7, 0, 8, 9);

inline void WriteMask(const std::filesystem::path& file, const Mask& mask) {
  std::filesystem::create_directories(file.parent_path());
  const absl::Status status = WriteMaskPng(file.string(), mask);
  if (!status.ok()) throw std::runtime_error(std::string(status.message()));
}

// A child process that runs until this object goes.
class Process {
 public:
  Process(const std::vector<std::string>& command, const std::filesystem::path& output) {
    std::vector<char*> arguments;
    for (const std::string& argument : command) {
      arguments.push_back(const_cast<char*>(argument.c_str()));
    }
    arguments.push_back(nullptr);
    pid_ = fork();
    if (pid_ != 0) return;
    const int file = open(output.c_str(), O_CREAT | O_WRONLY | O_TRUNC, 0600);
    dup2(file, STDOUT_FILENO);
    dup2(file, STDERR_FILENO);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  ~Process() { Stop(); }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  bool Running() { return pid_ > 0 && waitpid(pid_, nullptr, WNOHANG) == 0; }
  void Stop() {
    if (pid_ > 0) End(SIGTERM);
  }
  // Sends the signal and waits for the end; -1: it did not exit by itself.
  int End(int signal) {
    if (pid_ <= 0) return -1;
    int status = 0;
    kill(pid_, signal);
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t pid_ = -1;
};

// Imports the cell, serves it on a free port and runs programs against it.
class SmallServedCell {
 public:
  // `server`: lines for the section `server` of the cell file.
  explicit SmallServedCell(const std::string& server = "") {
    const std::filesystem::path folder = shell_.folder();
    WriteFile(folder / "cell.yaml", kCell + server);
    std::string csv = "x,y,left,right\n";
    for (int x = 0; x < kSteps; ++x) {
      for (int y = 0; y < kSteps; ++y) {
        const std::string file = std::to_string(x) + "_" + std::to_string(y) + ".png";
        WriteMask(folder / "masks" / file, RobotAt(x, y));
        csv += std::to_string(x * kStep) + "," + std::to_string(y * kStep) + "," + file + "," +
               file + "\n";
      }
    }
    WriteFile(folder / "masks" / "configurations.csv", csv);
    const Ended import = shell_.Run(Program("silhouette-db") +
                                    " import masks --cell cell.yaml --database cell.lmdb");
    if (import.exit_code != 0) throw std::runtime_error(import.out + import.err);
    Serve();
  }

  const Shell& shell() const { return shell_; }
  const std::string& address() const { return address_; }

  // silhouette with these arguments, in the cell's folder.
  Ended Run(const std::string& arguments) const {
    return shell_.Run("SILHOUETTE_SERVER=" + address_ + " " + Program("silhouette") + " " +
                      arguments);
  }

  // Publishes what the two views see besides the robot, which stands at (0, 0).
  Ended Publish(const Mask& left, const Mask& right, const std::string& options = "") const {
    WriteMask(shell_.folder() / "left.png", left | RobotAt(0, 0));
    WriteMask(shell_.folder() / "right.png", right | RobotAt(0, 0));
    return Run(
        "scene publish --as mask --view left=left.png --view right=right.png --joint x=0 "
        "--joint y=0 " +
        options);
  }

  void StopServer() { server_.reset(); }

 private:
  static std::string Program(const std::string& name) { return ProgramFolder() + "/" + name; }

  void Serve() {
    const std::filesystem::path output = shell_.folder() / "server.txt";
    server_ = std::make_unique<Process>(
        std::vector<std::string>{Program("silhouette-server"), "--cell",
                                 (shell_.folder() / "cell.yaml").string(), "--database",
                                 (shell_.folder() / "cell.lmdb").string()},
        output);
    const std::string announcement = "listening on ";
    while (address_.empty()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      const bool running = server_->Running();
      const std::string text = ContentOf(output);
      const size_t at = text.find(announcement);
      const size_t end = text.find('\n', at);
      if (at != std::string::npos && end != std::string::npos) {
        address_ = text.substr(at + announcement.size(), end - at - announcement.size());
      } else if (!running) {
        throw std::runtime_error("the server did not start: " + text);
      }
    }
  }

  static constexpr char kCell[] = R"(name: block
robot:
  joints:
    - {name: x, lower: 0, upper: 1}
    - {name: y, lower: 0, upper: 1}
grid:
  steps: {x: 11, y: 11}
views:
  - {name: left, mask_size: [16, 16]}
  - {name: right, mask_size: [16, 16]}
server:
  listen: 127.0.0.1:0
  max_age: 10 min
)";

  Shell shell_;
  std::unique_ptr<Process> server_;
  std::string address_;
};

}  // namespace silhouette
