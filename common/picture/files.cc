// SPDX-License-Identifier: Apache-2.0
#include "common/picture/files.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

absl::Status FileError(int code, const std::string& path, const std::string& what) {
  const std::string message = absl::StrCat("'", path, "' cannot be ", what, ": ", strerror(code));
  switch (code) {
    case ENOENT:
    case ENOTDIR:
      return absl::NotFoundError(message);
    case EACCES:
    case EPERM:
    case EROFS:
    case EISDIR:
      return absl::FailedPreconditionError(message);
    case ENAMETOOLONG:
      return absl::InvalidArgumentError(message + "; shorten it to 255 characters");
    case ENOSPC:
    case EDQUOT:
      return absl::ResourceExhaustedError(message);
    default:
      return absl::InternalError(message);
  }
}

}  // namespace

absl::StatusOr<std::string> ReadWholeFile(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return FileError(EISDIR, path, "read");
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) return FileError(errno, path, "read");
  std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (file.bad()) return FileError(EIO, path, "read");
  return bytes;
}

absl::Status RefusePipe(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_other(path, ignored)) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("'", path, "' is a pipe or device; name a file"));
}

namespace {

// Errors name `path`, to which the file belongs.
absl::Status WriteInPlace(const std::string& file_path, std::string_view bytes,
                          const std::string& path) {
  errno = 0;
  std::ofstream file(file_path, std::ios::binary | std::ios::trunc);
  if (!file) return FileError(errno, path, "written");
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.flush();
  if (!file) return FileError(errno, path, "written");
  return absl::OkStatus();
}

// Waits until a file, or a folder's list of files, is on the disk. An error of errno.
int Sync(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return errno;
  const int error = fsync(file) == 0 ? 0 : errno;
  close(file);
  return error;
}

}  // namespace

absl::Status WriteWholeFile(const std::string& path, std::string_view bytes, Outlasts outlasts) {
  std::error_code error;
  const auto there = std::filesystem::status(path, error);
  const bool is_new = there.type() == std::filesystem::file_type::not_found;
  const bool replaces = std::filesystem::is_regular_file(there) && access(path.c_str(), W_OK) == 0;
  const bool points_to_nothing = is_new && std::filesystem::is_symlink(path, error);
  if (points_to_nothing || (!is_new && !replaces)) return WriteInPlace(path, bytes, path);
  // What was there stays if the disk is full, and the file is whole at every moment; where a link
  // points, if the path is one.
  std::filesystem::path target = std::filesystem::weakly_canonical(path, error);
  if (error) target = path;
  const std::string beside = target.string() + ".new";
  if (const absl::Status status = WriteInPlace(beside, bytes, path); !status.ok()) {
    std::filesystem::remove(beside, error);
    const bool nothing_beside = absl::IsFailedPrecondition(status) || absl::IsNotFound(status);
    return nothing_beside ? WriteInPlace(path, bytes, path) : status;
  }
  if (replaces) std::filesystem::permissions(beside, there.permissions(), error);
  if (outlasts == Outlasts::kPowerFailure) {
    if (const int code = Sync(beside); code != 0) {
      std::filesystem::remove(beside, error);
      return FileError(code, path, "written");
    }
  }
  std::filesystem::rename(beside, target, error);
  if (error) return FileError(error.value(), path, "written");
  // Some file systems cannot do this with folders.
  if (outlasts == Outlasts::kPowerFailure) Sync(absolute(target).parent_path().string());
  return absl::OkStatus();
}

absl::Status MakeFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!error) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("the folder '", path, "' cannot be made: ", error.message()));
}

}  // namespace silhouette
