#include "clients/cpp/shared_map_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"

namespace silhouette::client {
namespace {

absl::Status CannotOpen(const std::string& path, int error) {
  switch (error) {
    case ENOENT:
    case ENOTDIR:
      return absl::NotFoundError(
          absl::StrCat("there is no shared map '", path,
                       "': start silhouette-server with --shared-map, or name its file"));
    case EACCES:
    case EPERM:
      return absl::PermissionDeniedError(
          absl::StrCat("this user may not read the shared map '", path,
                       "': whom the file's permissions let read it may; see shared_map in the cell "
                       "file"));
    case ELOOP:
      return absl::InvalidArgumentError(
          absl::StrCat("'", path, "' is a symbolic link: name the shared map itself"));
    default:
      return absl::UnavailableError(
          absl::StrCat("cannot open the shared map '", path, "': ", std::strerror(error)));
  }
}

absl::Status CheckKind(const std::string& path, const struct stat& status,
                       std::optional<uint32_t> owner) {
  if (!S_ISREG(status.st_mode)) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "' is not a file: name the shared map of a silhouette-server"));
  }
  if (owner && status.st_uid != *owner) {
    return absl::PermissionDeniedError(absl::StrCat(
        "the shared map '", path, "' belongs to user ", status.st_uid, " and not to user ", *owner,
        ", who was said to run the server: use it only if you trust that user"));
  }
  if ((status.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
    return absl::PermissionDeniedError(
        absl::StrCat("others than its owner may write to the shared map '", path,
                     "', so what it says cannot be relied on: chmod go-w it"));
  }
  if (status.st_size <= 0 || status.st_size % static_cast<off_t>(sizeof(uint64_t)) != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path, "' is not a shared map of the configuration space"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<SharedMapFile>> SharedMapFile::Open(const std::string& path,
                                                                   std::optional<uint32_t> owner) {
  // Without O_NONBLOCK a pipe of that name would keep us waiting.
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (file < 0) return CannotOpen(path, errno);
  const absl::Cleanup close_file = [file] { close(file); };
  struct stat status {};
  if (fstat(file, &status) != 0) return CannotOpen(path, errno);
  if (absl::Status kind = CheckKind(path, status, owner); !kind.ok()) return kind;
  const auto bytes = static_cast<size_t>(status.st_size);
  void* memory = mmap(nullptr, bytes, PROT_READ, MAP_SHARED, file, 0);
  if (memory == MAP_FAILED) return CannotOpen(path, errno);
  return std::unique_ptr<SharedMapFile>(new SharedMapFile(
      {static_cast<const uint64_t*>(memory), bytes / sizeof(uint64_t)}, status.st_uid));
}

SharedMapFile::~SharedMapFile() {
  munmap(const_cast<uint64_t*>(words_.data()), words_.size_bytes());
}

}  // namespace silhouette::client
