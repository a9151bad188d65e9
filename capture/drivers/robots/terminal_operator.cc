#include "capture/drivers/robots/terminal_operator.h"

#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <iostream>
#include <string>

namespace silhouette {
namespace {

absl::StatusOr<std::string> Ask(const std::string& question) {
  std::cerr << question << std::flush;
  std::string line;
  while (true) {
    pollfd place{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    // Unlike a read, it is not taken up again after a signal.
    if (poll(&place, 1, -1) < 0) {
      if (errno == EINTR) return absl::CancelledError("stopped by the operator");
      return absl::FailedPreconditionError("nobody can be asked: stdin cannot be read");
    }
    char letter = 0;
    if (read(STDIN_FILENO, &letter, 1) != 1) {
      return absl::FailedPreconditionError(
          "a robot that is moved by hand needs somebody to ask; run the program at a terminal");
    }
    if (letter == '\n') return line;
    line += letter;
  }
}

}  // namespace

Operator OperatorAtTerminal() {
  return {.tell = [](const std::string& line) { std::cerr << line << std::endl; }, .ask = Ask};
}

}  // namespace silhouette
