// SPDX-License-Identifier: Apache-2.0
// Programs that run while a test does.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace silhouette {

// Killed when the test forgets it.
class RunningProgram {
 public:
  // `command`: the program's path and its arguments. What it writes goes into the files `out` and
  // `err`, which may be one.
  RunningProgram(const std::vector<std::string>& command, std::filesystem::path out,
                 std::filesystem::path err)
      : out_(std::move(out)), err_(std::move(err)) {
    std::filesystem::remove(out_);
    std::vector<char*> words;
    for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
    words.push_back(nullptr);
    pid_ = fork();
    if (pid_ != 0) return;
    dup2(open(out_.c_str(), O_CREAT | O_WRONLY | O_TRUNC, 0600), STDOUT_FILENO);
    dup2(out_ == err_ ? STDOUT_FILENO : open(err_.c_str(), O_CREAT | O_WRONLY | O_TRUNC, 0600),
         STDERR_FILENO);
    execv(words[0], words.data());
    _exit(127);
  }
  ~RunningProgram() {
    if (pid_ > 0) End(SIGKILL);
  }
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  pid_t pid() const { return pid_; }
  // Nothing if it has ended: -1 would be all processes.
  void Signal(int signal) {
    if (pid_ > 0) kill(pid_, signal);
  }
  // Waits for its end; its exit code, or -1 after a signal, or if that was waited for before.
  int ExitCode() {
    if (pid_ <= 0) return -1;
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  int End(int signal) {
    Signal(signal);
    return ExitCode();
  }

  std::string Output() const { return TextOf(out_); }
  std::string Errors() const { return TextOf(err_); }

  // Of silhouette-server: the address that its output names; empty if it ends without one.
  std::string Address() {
    const std::string start = "listening on ";
    while (true) {
      const std::string text = Output();
      const size_t at = text.find(start);
      const size_t end = text.find('\n', at);
      if (at != std::string::npos && end != std::string::npos) {
        return text.substr(at + start.size(), end - at - start.size());
      }
      if (waitpid(pid_, nullptr, WNOHANG) == pid_) {
        ADD_FAILURE() << "it ended: " << Errors();
        pid_ = -1;
        return "";
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }

 private:
  static std::string TextOf(const std::filesystem::path& file) {
    std::ostringstream text;
    text << std::ifstream(file, std::ios::binary).rdbuf();
    return text.str();
  }

  const std::filesystem::path out_;
  const std::filesystem::path err_;
  pid_t pid_ = -1;
};

}  // namespace silhouette
