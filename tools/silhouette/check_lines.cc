#include "tools/silhouette/check_lines.h"

#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <iostream>
#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "silhouette/client.h"
#include "tools/silhouette/formats/configuration_text.h"
#include "tools/silhouette/formats/output.h"

namespace silhouette {
namespace {

// Lines of standard input; a read that waits ends with Ctrl-C.
class InputLines {
 public:
  // Nothing at the end.
  std::optional<std::string> Next() {
    while (true) {
      const size_t end = buffer_.find('\n');
      if (end != std::string::npos) {
        std::string line = buffer_.substr(0, end);
        buffer_.erase(0, end + 1);
        return line;
      }
      if (!Fill()) break;
    }
    if (buffer_.empty() || StopRequested()) return std::nullopt;
    return std::exchange(buffer_, "");
  }

 private:
  bool Fill() {
    while (!StopRequested()) {
      pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
      if (poll(&input, 1, /*milliseconds=*/50) <= 0) continue;
      char bytes[4096];
      const ssize_t count = read(STDIN_FILENO, bytes, sizeof bytes);
      if (count <= 0) return false;
      buffer_.append(bytes, static_cast<size_t>(count));
      return true;
    }
    return false;
  }

  std::string buffer_;
};

// What was asked and is not answered yet, by the number of its line.
class Asked {
 public:
  void Add(uint64_t line, const Configuration& q) {
    const std::lock_guard lock(mutex_);
    lines_.emplace(line, q);
  }
  Configuration Take(uint64_t line) {
    const std::lock_guard lock(mutex_);
    return lines_.extract(line).mapped();
  }

 private:
  std::mutex mutex_;
  std::map<uint64_t, Configuration> lines_;
};

// How the answers turned out.
struct CheckLinesOutcome {
  bool all_free = true;
  absl::Status status;  // why they ended, if before the last one
};

void PrintAnswers(client::CheckStream& stream, Asked& asked, bool json, client::Clearance clearance,
                  CheckLinesOutcome& outcome) {
  while (true) {
    const absl::StatusOr<client::StreamedAnswer> answer = stream.Receive();
    outcome.status = answer.ok() ? answer->checks.status() : answer.status();
    if (absl::IsOutOfRange(answer.status())) outcome.status = absl::OkStatus();
    if (!answer.ok()) return;
    if (!outcome.status.ok()) {
      stream.Cancel();
      return;
    }
    const Configuration q = asked.Take(answer->id);
    const client::Verdict& verdict = answer->checks->verdicts[0];
    outcome.all_free = outcome.all_free && verdict.free();
    if (json) {
      Json line{{"line", answer->id}, {"configuration", q}};
      line.update(JsonOf(answer->checks->basis));
      line.update(JsonOf(verdict, clearance));
      std::cout << line.dump() << std::endl;
    } else {
      std::cout << Spoken(q) << ": " << Spoken(verdict) << std::endl;
    }
  }
}

// Asks for all lines; what ended that early, if something did. An error of the stream is not told:
// its answers tell it.
absl::Status CheckLinesAsk(client::CheckStream& stream, Asked& asked, AngleUnit unit,
                           const client::Policy& policy, client::Clearance clearance) {
  InputLines input;
  uint64_t number = 0;
  while (const std::optional<std::string> line = input.Next()) {
    ++number;
    try {
      const std::optional<Configuration> q = ParseLine(*line, unit);
      if (!q) continue;
      asked.Add(number, *q);
      absl::Status sent;
      do {
        sent = stream.Send(number, {*q}, policy, client::Evidence::kPerView, clearance);
        // The answers are being printed.
        if (absl::IsResourceExhausted(sent)) {
          std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
      } while (absl::IsResourceExhausted(sent));
      if (!sent.ok()) break;
    } catch (const std::invalid_argument& error) {
      return absl::InvalidArgumentError(absl::StrCat("-:", number, ": ", error.what()));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ExitCode> CheckLines(const Session& session, AngleUnit unit,
                                    const client::Policy& policy, client::Clearance clearance) {
  const absl::StatusOr<Client> client = session.Connect();
  if (!client.ok()) return client.status();
  CatchStopSignals();
  client::CheckStream stream = client->StreamChecks();
  Asked asked;
  CheckLinesOutcome outcome;
  std::jthread printer([&] { PrintAnswers(stream, asked, session.json(), clearance, outcome); });
  const absl::Status mistake = CheckLinesAsk(stream, asked, unit, policy, clearance);
  stream.EndQuestions();
  printer.join();
  if (!outcome.status.ok()) return outcome.status;
  if (!mistake.ok()) return mistake;
  return outcome.all_free ? kDone : kNo;
}

}  // namespace silhouette
