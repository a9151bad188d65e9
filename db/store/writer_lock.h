// SPDX-License-Identifier: Apache-2.0
// The right to write into a database's folder.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace silhouette {

// Held by one Database of one process at a time; given back when the process ends, however it ends.
class WriterLock {
 public:
  // FailedPrecondition if another holds the right, naming its process, or for lack of permission.
  // ResourceExhausted if the disk is full.
  static absl::StatusOr<WriterLock> Take(const std::string& folder);

  // For a reader: keeps every writer out while the returned file is open. FailedPrecondition if a
  // process is writing, `mend` ends that message; or if there is no schema::kWriterFile.
  static absl::StatusOr<int> KeepWritersOut(const std::string& folder, const std::string& mend);

  WriterLock(WriterLock&& other) noexcept;
  WriterLock& operator=(WriterLock&&) = delete;
  ~WriterLock();

 private:
  explicit WriterLock(int file) : file_(file) {}
  int file_;
};

// Whether this process, as it may not write into the file that readers register themselves in
// (schema::kLockFile), keeps writers out of the database in `folder` for as long as it has it open,
// or a Snapshot of it.
bool ReadersKeepWritersOut(const std::string& folder);

}  // namespace silhouette
