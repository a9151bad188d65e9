// SPDX-License-Identifier: Apache-2.0
// Writes the audit file (audit_chain.h) from a thread of its own, so that no caller waits for the
// disk.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/audit/audit_chain.h"

namespace silhouette {

// Thread-safe.
class AuditLog {
 public:
  // Entries that may wait for the disk; more are lost, and their number is written when it works
  // again.
  static constexpr size_t kMostWaiting = 1024;

  // Continues the file, or begins it, for this process alone. The rest of a line that a crash has
  // torn is cut off; a new line says so. FailedPrecondition: another process writes it, it is none,
  // or its chain is broken. Unavailable: it cannot be written.
  static absl::StatusOr<std::unique_ptr<AuditLog>> Open(const std::string& path);

  // Writes what waits, if the disk takes it.
  ~AuditLog();
  AuditLog(const AuditLog&) = delete;
  AuditLog& operator=(const AuditLog&) = delete;

  // Never waits for the disk. An entry that cannot be written is tried again each second; the log
  // says when that begins and ends.
  void Note(AuditEntry entry);

  // The same for what may come often: the first of a series, which ends with a minute without it.
  void NoteFirst(AuditEntry entry);

 private:
  AuditLog(std::string path, int file, const AuditFile& audit);

  void Work();
  // Writes one entry; why it failed, empty: it is on the disk.
  std::string Write(const AuditEntry& entry);
  void Report(const std::string& fault);

  const std::string path_;
  const int file_;
  uint64_t size_;      // bytes on the disk; of Work()
  AuditEnd end_;       // of Work()
  std::string fault_;  // of Work(); empty: the last entry is written

  std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::deque<AuditEntry> waiting_;
  uint64_t lost_ = 0;
  std::map<std::string, absl::Duration> noted_;  // the last time of each, running clock
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace silhouette
