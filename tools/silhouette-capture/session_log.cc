#include "tools/silhouette-capture/session_log.h"

#include <spdlog/logger.h>
#include <spdlog/sinks/basic_file_sink.h>

#include <exception>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "tools/program/progress.h"

namespace silhouette {
namespace {

constexpr absl::Duration kBetweenProgress = absl::Minutes(5);

}  // namespace

absl::StatusOr<SessionLog> SessionLog::Open(const std::string& file) {
  SessionLog log;
  try {
    auto sink = std::make_shared<spdlog::sinks::basic_file_sink_st>(file, /*truncate=*/false);
    log.logger_ = std::make_shared<spdlog::logger>("session", std::move(sink));
  } catch (const std::exception& error) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the log '", file, "' cannot be written; name another with --log: ", error.what()));
  }
  log.logger_->set_pattern("%Y-%m-%d %H:%M:%S  %v");
  log.logger_->flush_on(spdlog::level::info);
  // A full disk is told by the capture itself.
  log.logger_->set_error_handler([](const std::string&) {});
  log.file_ = file;
  return log;
}

void SessionLog::Write(const std::string& line) {
  if (logger_) logger_->info("{}", line);
}

void SessionLog::WriteProgress(uint64_t done, uint64_t total, absl::Time begin) {
  const absl::Time now = absl::Now();
  if (next_progress_ == absl::InfinitePast()) next_progress_ = now + kBetweenProgress;
  if (now < next_progress_ || done == 0 || done >= total) return;
  next_progress_ = now + kBetweenProgress;
  const double share = static_cast<double>(done) / static_cast<double>(total);
  const absl::Duration left = (now - begin) * ((1 - share) / share);
  Write(absl::StrFormat("%d of %d configurations (%.0f %%), %s left, done about %s", done, total,
                        100 * share, Spoken(left), ClockTime(now + left, now)));
}

std::string DefaultLogFile(const std::string& database) {
  std::string file = database;
  while (file.size() > 1 && file.back() == '/') file.pop_back();
  return file + ".log";
}

}  // namespace silhouette
