// SPDX-License-Identifier: Apache-2.0
#include "tools/program/program.h"

#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/yaml/strict_yaml.h"

namespace silhouette {
namespace {

constexpr char kVersion[] = SILHOUETTE_VERSION;

volatile std::sig_atomic_t stop_requested = 0;

// What OnLostPage writes: made before, because a handler may not allocate.
std::string lost_page_sentence;

void OnLostPage(int signal, siginfo_t* info, void*) {
  if (info->si_code != BUS_ADRERR) {  // a fault of the program: end as without a handler
    std::signal(signal, SIG_DFL);
    return;
  }
  const ssize_t written =
      write(STDERR_FILENO, lost_page_sentence.data(), lost_page_sentence.size());
  (void)written;
  _exit(kWorldFailed);
}

void OnStopSignal(int signal) {
  if (stop_requested != 0) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
  stop_requested = 1;
}

// What is wrong with a word that stands where a subcommand is expected; empty if none does.
std::string MistypedSubcommand(const CLI::App& program) {
  const CLI::App* command = &program;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  std::vector<std::string> known;
  for (const CLI::App* sub : command->get_subcommands([](const CLI::App*) { return true; })) {
    known.push_back(sub->get_name());
  }
  const std::vector<std::string> words = command->remaining();
  if (known.empty() || words.empty() || words.front().starts_with('-')) return "";
  const std::string nearest = NearestWord(words.front(), known);
  return "there is no subcommand '" + words.front() + "'; " +
         (nearest.empty() ? "known are " + ListOfWords(known) : "did you mean '" + nearest + "'?");
}

// Whether standard output is a pipe that nothing reads any more, as after `head`.
bool ReaderIsGone() {
  pollfd out{.fd = STDOUT_FILENO, .events = POLLOUT, .revents = 0};
  return poll(&out, 1, 0) > 0 && (out.revents & POLLERR) != 0;
}

// `code`, or that what was to be printed is lost.
int WithOutput(const std::string& program, int code) {
  if ((std::cout.flush() && std::fflush(stdout) == 0) || ReaderIsGone()) return code;
  std::cerr << program << ": the output could not be written; is the disk full?" << std::endl;
  return kWorldFailed;
}

}  // namespace

ExitCode ExitCodeOf(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return kDone;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kOutOfRange:
    case absl::StatusCode::kPermissionDenied:
      return kUserMistake;
    default:
      return kWorldFailed;
  }
}

ExitCode Report(const std::string& program, const absl::Status& status) {
  if (!status.ok()) std::cerr << program << ": " << status.message() << std::endl;
  return ExitCodeOf(status);
}

void EndOnLostPages(const std::string& program) {
  lost_page_sentence =
      program +
      ": a mapped file was cut while it was in use, or its disk fails (a database's "
      "data.mdb or lock.mdb); restore the database from a copy and start again\n";
  struct sigaction action {};
  action.sa_sigaction = OnLostPage;
  action.sa_flags = SA_SIGINFO;
  sigemptyset(&action.sa_mask);
  sigaction(SIGBUS, &action, nullptr);
}

int RunProgram(CLI::App& app, int argc, char** argv, const std::function<int()>& run) {
  EndOnLostPages(app.get_name());
  app.set_version_flag("--version", app.get_name() + " " + kVersion);
  app.failure_message([](const CLI::App* failed, const CLI::Error& error) {
    const std::string mistyped = MistypedSubcommand(*failed);
    return failed->get_name() + ": " +
           (mistyped.empty() ? error.what() + std::string("; see --help") : mistyped) + "\n";
  });
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kUserMistake;
  }
  try {
    return WithOutput(app.get_name(), run());
  } catch (const std::invalid_argument& error) {
    std::cerr << app.get_name() << ": " << error.what() << std::endl;
    return kUserMistake;
  } catch (const std::exception& error) {
    std::cerr << app.get_name() << ": " << error.what() << std::endl;
    return kWorldFailed;
  }
}

int RunProgram(CLI::App& app, int argc, char** argv, const Work& work) {
  return RunProgram(app, argc, argv, [&]() -> int {
    const absl::StatusOr<ExitCode> result = work();
    return result.ok() ? *result : Report(app.get_name(), result.status());
  });
}

CLI::Validator PositiveNumber() {
  return CLI::Validator(
      [](const std::string& text) {
        double number = 0;
        if (CLI::detail::lexical_cast(text, number) && number > 0) return std::string();
        return "'" + text + "' is not a number above zero";
      },
      "POSITIVE");
}

CLI::Option* AddPictureOption(CLI::App& command, std::string& picture, const std::string& what) {
  return command.add_option("--picture", picture, what)->check([](const std::string& path) {
    const std::string ending = std::filesystem::path(path).extension().string();
    return ending == ".png" || ending == ".PNG"
               ? std::string()
               : "'" + path + "' is not the name of a PNG file, as in picture.png";
  });
}

void AddFormatOption(CLI::App& command, std::string& format) {
  command.add_option("--format", format, "Output for people or for scripts")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
}

void CatchStopSignals() {
  struct sigaction action {};
  action.sa_handler = OnStopSignal;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool StopRequested() { return stop_requested != 0; }

}  // namespace silhouette
