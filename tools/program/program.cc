// SPDX-License-Identifier: Apache-2.0
#include "tools/program/program.h"

#include <fcntl.h>
#include <poll.h>
#include <semaphore.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/time.h"
#include "common/times/times.h"
#include "common/yaml/strict_yaml.h"
#include "tools/program/joint_values.h"

namespace silhouette {
namespace {

constexpr char kVersion[] = SILHOUETTE_VERSION;

constexpr char kSizeType[] = "SIZE";  // of what ByteSize takes, a number with a unit

volatile std::sig_atomic_t stop_requested = 0;
// Of HaltOnSignals.
std::atomic<bool> halts = false;  // there is one
std::atomic<int> end_signal = 0;  // what ends the process once it has halted
sem_t halt_asked;

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

void EndBySignal(int signal) {
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void OnStopSignal(int signal) {
  const bool ends = stop_requested != 0 || signal == SIGHUP;
  stop_requested = 1;
  if (!ends) return;
  // A terminal that is closed may send SIGHUP twice.
  const bool halting = end_signal != 0;
  if (!halts || (halting && signal != SIGHUP)) return EndBySignal(signal);
  end_signal = signal;
  sem_post(&halt_asked);
}

// What is wrong with a word that stands where a subcommand is expected; empty if none does.
std::string MistypedSubcommand(const CLI::App& program) {
  const CLI::App* command = &program;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  std::vector<std::string> known;
  const auto has_name = [](const CLI::App* sub) { return !sub->get_name().empty(); };
  for (const CLI::App* sub : command->get_subcommands(has_name)) known.push_back(sub->get_name());
  const std::vector<std::string> words = program.remaining(/*recurse=*/true);
  if (known.empty() || words.empty() || words.front().starts_with('-')) return "";
  const std::string nearest = known.size() > 1 ? NearestWord(words.front(), known) : known.front();
  return "there is no subcommand '" + words.front() + "'; " +
         (nearest.empty() ? "known are " + ListOfWords(known) : "did you mean '" + nearest + "'?");
}

// An option that there is not; empty if all words that are left over are something else. Its value
// is then often taken for another option's, which is not to be blamed.
std::string UnknownOption(const CLI::App& program) {
  for (const std::string& word : program.remaining(/*recurse=*/true)) {
    if (word.starts_with("--")) return word.substr(0, word.find('='));
  }
  return "";
}

// What is wrong, by the library's error.
std::string CommandLineMistake(const CLI::App& program, const CLI::Error& error) {
  if (std::string mistyped = MistypedSubcommand(program); !mistyped.empty()) return mistyped;
  const std::string unknown = UnknownOption(program);
  if (unknown.empty() || error.get_name() == "ExtrasError") {
    return error.what() + std::string("; see --help");
  }
  return "there is no option '" + unknown + "'; see --help";
}

// A mistake in the text of a number: the library takes 0x10, 010 (as 8) and nan.
std::string NumberMistake(std::string& text, const std::string& type) {
  if (type.starts_with("FLOAT")) {
    double number = 0;
    return IsDecimal(text, number) ? "" : "'" + text + "' is not a number";
  }
  const bool negative = text.starts_with('-');
  const std::string digits = text.substr(negative ? 1 : 0);
  if (digits.empty() || !std::ranges::all_of(digits, absl::ascii_isdigit)) {
    return "'" + text + "' is not a whole number";
  }
  if (negative && type.starts_with("UINT")) return "'" + text + "' is less than 0";
  const size_t first = std::min(digits.find_first_not_of('0'), digits.size() - 1);
  text = (negative ? "-" : "") + digits.substr(first);
  return "";
}

// Before what else is said of them, numbers of all options must be numbers.
void RequireNumbers(CLI::App& command) {
  for (CLI::Option* option : command.get_options()) {
    const std::string type = option->get_type_name();
    if (type.find(kSizeType) != std::string::npos) continue;
    if (!type.starts_with("FLOAT") && !type.starts_with("INT") && !type.starts_with("UINT")) {
      continue;
    }
    option->transform(CLI::Validator(
        [type](std::string& text) { return NumberMistake(text, type); }, /*description=*/""));
  }
  const std::function<bool(CLI::App*)> all;
  for (CLI::App* sub : command.get_subcommands(all)) RequireNumbers(*sub);
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// Opens standard input, output and error where they are closed, so that no file of the program
// takes their place: what is printed would be written into it. Writing them fails, as before.
void OpenClosedStreams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) == -1 && errno == EBADF && open("/dev/null", O_RDONLY) != stream) {
      std::_Exit(kWorldFailed);
    }
  }
}

// Before the libraries are initialised: some open files then. Sanitizers are not ready so early.
[[gnu::used, gnu::section(".preinit_array")]] void (*before_libraries)() = OpenClosedStreams;
#endif

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
  std::signal(SIGXFSZ, SIG_IGN);  // a file above `ulimit -f` is an error of the write
  app.set_version_flag("--version", app.get_name() + " " + kVersion);
  app.failure_message([](const CLI::App* failed, const CLI::Error& error) {
    return failed->get_name() + ": " + CommandLineMistake(*failed, error) + "\n";
  });
  RequireNumbers(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? WithOutput(app.get_name(), kDone) : kUserMistake;
  }
  try {
    return WithOutput(app.get_name(), run());
  } catch (const std::invalid_argument& error) {
    std::cerr << app.get_name() << ": " << error.what() << std::endl;
    return kUserMistake;
  } catch (const std::filesystem::filesystem_error& error) {
    const bool too_long = error.code() == std::errc::filename_too_long;
    std::cerr << app.get_name() << ": "
              << (too_long ? absl::StrCat("'", error.path1().string(),
                                          "': a name is too long; shorten it to 255 characters")
                           : error.what())
              << std::endl;
    return too_long ? kUserMistake : kWorldFailed;
  } catch (const std::bad_alloc&) {
    std::cerr << app.get_name() << ": there is not enough memory" << std::endl;
    return kWorldFailed;
  } catch (const std::exception& error) {
    std::cerr << app.get_name() << ": " << error.what() << std::endl;
    return kWorldFailed;
  }
}

int RunProgram(CLI::App& app, int argc, char** argv, const Work& work) {
  return RunProgram(app, argc, argv, [&]() -> int {
    const absl::StatusOr<ExitCode> result = work();
    if (result.ok()) return *result;
    const ExitCode code = Report(app.get_name(), result.status());
    return StopRequested() ? kStopped : code;
  });
}

CLI::Validator PositiveNumber() {
  return CLI::Validator(
      [](const std::string& text) {
        double number = 0;
        if (IsDecimal(text, number) && number > 0) return std::string();
        return "'" + text + "' is not a number above zero";
      },
      "POSITIVE");
}

CLI::Validator NumberFromZero() {
  return CLI::Validator(
      [](const std::string& text) {
        return text.starts_with('-') ? "'" + text + "' is less than 0" : std::string();
      },
      "NONNEGATIVE");
}

CLI::Validator ByteSize() {
  return CLI::Validator(
      [](std::string& text) {
        const std::string mistake = "'" + text + "' is no size with its unit; 8GB is";
        const bool has_number = !text.empty() && absl::ascii_isdigit(text.front());
        if (!has_number || !absl::ascii_isalpha(text.back())) return mistake;
        try {
          return CLI::AsSizeValue(/*kb_is_1000=*/true)(text).empty() ? "" : mistake;
        } catch (const CLI::ValidationError&) {
          return mistake;
        }
      },
      kSizeType);
}

CLI::Option* TakeTimes(CLI::Option* option, double least, double most) {
  const auto to_seconds = [least, most](std::string& text) {
    const std::optional<absl::Duration> time = ParseTime(text);
    if (!time) return absl::StrCat("'", text, "' is not a time; write ", kTimeExamples);
    const double seconds = absl::ToDoubleSeconds(*time);
    if (!(seconds >= least && seconds <= most)) {
      return absl::StrCat("'", text, "' is not from ", SpokenTime(absl::Seconds(least)), " to ",
                          SpokenTime(absl::Seconds(most)));
    }
    text = absl::StrFormat("%.17g", seconds);
    return std::string();
  };
  return option->transform(CLI::Validator(to_seconds, /*description=*/""))->type_name("TIME");
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
  struct sigaction hang_up {};
  sigaction(SIGHUP, nullptr, &hang_up);
  if (hang_up.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
}

bool StopRequested() { return stop_requested != 0; }

HaltOnSignals::HaltOnSignals(std::function<void()> halt) {
  sem_init(&halt_asked, /*pshared=*/0, 0);
  thread_ = std::thread([halt = std::move(halt)] {
    while (sem_wait(&halt_asked) != 0) {  // a signal interrupts it
    }
    if (end_signal == 0) return;
    halt();
    EndBySignal(end_signal);
  });
  halts = true;
}

HaltOnSignals::~HaltOnSignals() {
  halts = false;
  sem_post(&halt_asked);
  thread_.join();
}

}  // namespace silhouette
