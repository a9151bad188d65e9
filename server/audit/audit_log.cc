// SPDX-License-Identifier: Apache-2.0
#include "server/audit/audit_log.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr absl::Duration kSeries = absl::Minutes(1);
constexpr size_t kMostSeries = 1024;
constexpr std::chrono::seconds kBetweenTries(1);

absl::Status CannotWrite(const std::string& path) {
  return absl::UnavailableError(
      absl::StrCat("cannot write the audit file '", path, "': ", strerror(errno)));
}

}  // namespace

absl::StatusOr<std::unique_ptr<AuditLog>> AuditLog::Open(const std::string& path) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0640);
  if (file < 0) return FailedPrecondition(CannotWrite(path).message());
  absl::Cleanup closing = [file] { close(file); };
  if (flock(file, LOCK_EX | LOCK_NB) != 0) {
    return FailedPrecondition("another process writes the audit file '", path,
                              "'; give each server its own");
  }
  const absl::StatusOr<AuditFile> audit = ReadAudit(path);
  if (!audit.ok()) {
    return FailedPrecondition("cannot continue the audit file: ", audit.status().message(),
                              "; keep it as evidence under another name");
  }
  if (ftruncate(file, static_cast<off_t>(audit->whole)) != 0) return CannotWrite(path);
  std::move(closing).Cancel();
  return std::unique_ptr<AuditLog>(new AuditLog(path, file, *audit));
}

AuditLog::AuditLog(std::string path, int file, const AuditFile& audit)
    : path_(std::move(path)), file_(file), size_(audit.whole), end_(audit.end) {
  spdlog::info("audit file '{}': {} lines, digest of the last one {}", path_, end_.lines,
               end_.digest);
  if (!audit.torn.empty()) {
    const std::string cut = absl::CHexEscape(audit.torn.substr(0, kMostAuditText / 4));
    spdlog::warn("audit file '{}': line {} was not written whole, and is cut off: {}", path_,
                 end_.lines + 1, cut);
    Note({.time = absl::Now(),
          .running = RunningNow(),
          .who = "server",
          .what = "audit.mended",
          .detail = "cut off an incomplete line: " + cut});
  }
  thread_ = std::thread([this] { Work(); });
}

AuditLog::~AuditLog() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
  close(file_);
}

void AuditLog::Note(AuditEntry entry) {
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= kMostWaiting) {
      ++lost_;
      return;
    }
    waiting_.push_back(std::move(entry));
  }
  changed_.notify_all();
}

void AuditLog::NoteFirst(AuditEntry entry) {
  const std::string series = absl::StrCat(entry.who, "\n", entry.what, "\n", entry.detail);
  {
    const std::lock_guard lock(mutex_);
    if (noted_.size() >= kMostSeries) {
      std::erase_if(noted_, [&](const auto& one) { return entry.running - one.second >= kSeries; });
    }
    const auto found = noted_.find(series);
    if (found != noted_.end() &&
        entry.running - std::exchange(found->second, entry.running) < kSeries) {
      return;
    }
    if (found == noted_.end() && noted_.size() < kMostSeries) noted_.emplace(series, entry.running);
  }
  Note(std::move(entry));
}

std::string AuditLog::Write(const AuditEntry& entry) {
  // No part of a line that failed may stand before the next one.
  if (ftruncate(file_, static_cast<off_t>(size_)) != 0) return strerror(errno);
  AuditEnd end = end_;
  const std::string line = AuditLine(entry, end) + "\n";
  const ssize_t written = write(file_, line.data(), line.size());
  if (written < 0) return strerror(errno);
  if (written != static_cast<ssize_t>(line.size())) return strerror(ENOSPC);
  if (fdatasync(file_) != 0) return strerror(errno);
  size_ += line.size();
  end_ = end;
  return "";
}

void AuditLog::Report(const std::string& fault) {
  if (fault == fault_) return;
  if (!fault.empty()) {
    spdlog::error("cannot write the audit file '{}': {}; the server goes on, and tries again",
                  path_, fault);
  } else {
    spdlog::info("the audit file '{}' is written again", path_);
  }
  fault_ = fault;
}

void AuditLog::Work() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ending_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    const AuditEntry entry = waiting_.front();
    lock.unlock();
    const std::string fault = Write(entry);
    Report(fault);
    lock.lock();
    if (!fault.empty()) {
      if (ending_) {
        spdlog::error("{} entries of the audit file '{}' are lost", waiting_.size() + lost_, path_);
        return;
      }
      changed_.wait_for(lock, kBetweenTries, [this] { return ending_; });
      continue;
    }
    waiting_.pop_front();
    if (lost_ > 0 && waiting_.empty()) {
      waiting_.push_back(
          {.time = entry.time,
           .running = entry.running,
           .who = "server",
           .what = "audit.lost",
           .detail = absl::StrCat(std::exchange(lost_, 0), " later entries could not be kept")});
    }
  }
}

}  // namespace silhouette
