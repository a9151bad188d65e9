// SPDX-License-Identifier: Apache-2.0
#include "db/store/writer_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "db/store/environment.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

std::string WriterLockLockPath(const std::string& folder) {
  return folder + "/" + schema::kWriterFile;
}

// Who has the lock of a writer: only readers that keep writers out do not name themselves.
constexpr char kUnnamed[] = "another process";

std::string Holder(int file) {
  char text[32] = {};
  const ssize_t length = pread(file, text, sizeof(text) - 1, 0);
  int pid = 0;
  if (length <= 0 || !absl::SimpleAtoi(text, &pid)) return kUnnamed;
  if (pid == getpid()) return "this process already";
  return absl::StrCat("another process (pid ", pid, ")");
}

}  // namespace

absl::StatusOr<WriterLock> WriterLock::Take(const std::string& folder) {
  const std::string what = absl::StrCat("database '", folder, "' cannot be written");
  const int file = open(WriterLockLockPath(folder).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0664);
  if (file < 0) return LmdbError(errno, what);
  if (flock(file, LOCK_EX | LOCK_NB) != 0) {
    const int error = errno;
    const std::string holder = Holder(file);
    close(file);
    if (error != EWOULDBLOCK) return LmdbError(error, what);
    return absl::FailedPreconditionError(absl::StrCat(
        what, ": ", holder, " is writing to it",
        holder == kUnnamed ? ", or a server without permission to write lock.mdb reads it" : "",
        "; end that first"));
  }
  WriterLock lock(file);  // which empties the file when it goes
  const std::string pid = absl::StrCat(getpid(), "\n");
  if (ftruncate(file, 0) != 0 || pwrite(file, pid.data(), pid.size(), 0) < 0) {
    return LmdbError(errno, what);
  }
  return lock;
}

absl::StatusOr<int> WriterLock::KeepWritersOut(const std::string& folder, const std::string& mend) {
  const int file = open(WriterLockLockPath(folder).c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0 && errno == ENOENT) {
    return absl::FailedPreconditionError(absl::StrCat(
        "database '", folder, "' has no '", schema::kWriterFile,
        "', by which readers keep writers out; make an empty file of that name there, or copy the "
        "folder to where this program may write"));
  }
  if (file < 0)
    return LmdbError(errno, absl::StrCat("'", WriterLockLockPath(folder), "' cannot be read"));
  if (flock(file, LOCK_SH | LOCK_NB) != 0) {
    const std::string holder = Holder(file);
    close(file);
    return absl::FailedPreconditionError(
        absl::StrCat("database '", folder, "': ", holder, " is writing to it", mend));
  }
  return file;
}

bool ReadersKeepWritersOut(const std::string& folder) {
  const std::string readers = folder + "/" + schema::kLockFile;
  const bool there = faccessat(AT_FDCWD, readers.c_str(), F_OK, AT_EACCESS) == 0;
  const std::string& needed = there ? readers : folder;
  return faccessat(AT_FDCWD, needed.c_str(), R_OK | W_OK, AT_EACCESS) != 0;
}

WriterLock::WriterLock(WriterLock&& other) noexcept : file_(std::exchange(other.file_, -1)) {}

WriterLock::~WriterLock() {
  if (file_ < 0) return;
  // Readers that keep writers out do not name themselves.
  [[maybe_unused]] const int cut = ftruncate(file_, 0);
  close(file_);
}

}  // namespace silhouette
