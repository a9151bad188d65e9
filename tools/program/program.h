// SPDX-License-Identifier: Apache-2.0
// The manners that all programs share: exit codes, error messages, --version, Ctrl-C.
#pragma once

#include <functional>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

namespace silhouette {

enum ExitCode : int {
  kDone = 0,
  kNo = 1,           // the answer is no, or the check failed
  kUserMistake = 2,  // a wrong argument, file or setting
  kWorldFailed = 3,  // device, disk, network
  kStopped = 130,    // Ctrl-C before all was answered; of commands that Ctrl-C just ends, too
};

// kUserMistake for InvalidArgument, NotFound, AlreadyExists, FailedPrecondition, OutOfRange and
// PermissionDenied; kDone for OK; kWorldFailed for everything else.
ExitCode ExitCodeOf(const absl::Status& status);

// Prints "<program>: <message>" on stderr and returns ExitCodeOf(status).
ExitCode Report(const std::string& program, const absl::Status& status);

// From then on a page of a mapped file that cannot be read (SIGBUS: the file was cut, or its disk
// fails) ends the process with one sentence on stderr and kWorldFailed. RunProgram calls it.
void EndOnLostPages(const std::string& program);

// Opens standard streams that are closed, adds --version, parses, and returns what `run` returns. A
// wrong command line, also a number that is not decimal and finite, is one sentence on stderr and
// kUserMistake; --help and --version go to stdout with kDone. An exception that leaves `run` is one
// sentence too: std::invalid_argument kUserMistake, any other kWorldFailed.
int RunProgram(CLI::App& app, int argc, char** argv, const std::function<int()>& run);

// What a chosen subcommand does. RunProgram reports an error status and returns its exit code, or
// kStopped if a stop was requested.
using Work = std::function<absl::StatusOr<ExitCode>()>;
int RunProgram(CLI::App& app, int argc, char** argv, const Work& work);

// Takes numbers above zero: option->check(PositiveNumber()).
CLI::Validator PositiveNumber();
// The same, and zero.
CLI::Validator NumberFromZero();
// Takes "8GB", "512MiB" and so on, and makes bytes of it: option->transform(ByteSize()).
CLI::Validator ByteSize();
// Lets an option that holds seconds take times as ParseTime does, from `least` to `most` seconds.
// Where zero means something else than no time, the option's description says so.
CLI::Option* TakeTimes(CLI::Option* option, double least, double most);

// Adds --picture FILE to `command`, a PNG file.
CLI::Option* AddPictureOption(CLI::App& command, std::string& picture, const std::string& what);

// Adds --format text|json to `command`.
void AddFormatOption(CLI::App& command, std::string& format);

// From then on SIGINT and SIGTERM set a flag instead of ending the process; a second one ends it.
void CatchStopSignals();
// Whether such a signal came.
bool StopRequested();

// While it lives, what ends the process first calls `halt`, in a thread of its own: the second stop
// signal, and SIGHUP (the terminal was closed) unless it is ignored. Meanwhile another stop signal
// ends the process at once. One at a time, after CatchStopSignals().
class HaltOnSignals {
 public:
  explicit HaltOnSignals(std::function<void()> halt);
  ~HaltOnSignals();
  HaltOnSignals(const HaltOnSignals&) = delete;
  HaltOnSignals& operator=(const HaltOnSignals&) = delete;

 private:
  std::thread thread_;
};

}  // namespace silhouette
