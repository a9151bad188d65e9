// SPDX-License-Identifier: Apache-2.0
// A library for LD_PRELOAD that lets a call of the program go wrong. Environment:
//
//   FAULT         CALL:N:WHAT, the N-th call (from 1) of its kind:
//     CALL        read, write, sync, map, truncate, rename, open, accept, send, clock
//     WHAT        an errno by its number; short (half of it is done); kill; cut (the power: what
//     was not
//                 synced is gone, then kill); delay (a second); step (from then on the wall clock
//                 is an hour ahead) or back (behind)
//   FAULT_UNDER   only files whose path begins so count for the first seven
//   FAULT_DONE    a file that is made when the call has gone wrong
//   FAULT_COUNTS  a file that gets the number of calls of each kind, at the end
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <vector>

namespace {

enum Call { kRead, kWrite, kSync, kMap, kTruncate, kRename, kOpen, kAccept, kSend, kClock, kCalls };
constexpr std::array<const char*, kCalls> kNames = {"read",   "write", "sync",   "map",  "truncate",
                                                    "rename", "open",  "accept", "send", "clock"};

struct Plan {
  int call = kCalls;
  long n = 0;
  std::string what;
  std::string under;
};

std::string Variable(const char* name) {
  const char* const value = getenv(name);
  return value == nullptr ? "" : value;
}

const Plan& ThePlan() {
  static const Plan* const plan = [] {
    auto* const read = new Plan;
    const std::string text = Variable("FAULT");
    const size_t first = text.find(':');
    const size_t second = text.find(':', first + 1);
    for (int call = 0; call < kCalls && second != std::string::npos; ++call) {
      if (text.substr(0, first) == kNames[static_cast<size_t>(call)]) read->call = call;
    }
    if (second != std::string::npos) {
      read->n = atol(text.c_str() + first + 1);
      read->what = text.substr(second + 1);
    }
    read->under = Variable("FAULT_UNDER");
    return read;
  }();
  return *plan;
}

std::array<std::atomic<long>, kCalls> counts{};

struct AtEnd {
  ~AtEnd() {
    const std::string path = Variable("FAULT_COUNTS");
    if (path.empty()) return;
    FILE* const file = fopen(path.c_str(), "w");
    for (size_t call = 0; call < kCalls; ++call) {
      fprintf(file, "%s %ld\n", kNames[call], counts[call].load());
    }
    fclose(file);
  }
} at_end;

template <typename Function>
Function* Real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

std::string PathOf(int file) {
  char path[PATH_MAX];
  const std::string link = "/proc/self/fd/" + std::to_string(file);
  const ssize_t length = readlink(link.c_str(), path, sizeof(path));
  return length < 0 ? "" : std::string(path, static_cast<size_t>(length));
}

std::string Absolute(const char* path) {
  if (path[0] == '/') return path;
  char folder[PATH_MAX];
  return getcwd(folder, sizeof(folder)) == nullptr ? "" : std::string(folder) + "/" + path;
}

bool Watched(const std::string& path) {
  return !ThePlan().under.empty() && path.starts_with(ThePlan().under);
}

// What a power cut takes back: the latest changes that were not synced.
struct Change {
  std::string path;
  off_t at = 0;
  std::string before;    // the bytes from there on
  off_t size = 0;        // of the file
  std::string moved_to;  // a file that was renamed
};
std::mutex changes_mutex;
std::vector<Change>& Changes() {
  static auto& changes = *new std::vector<Change>;
  return changes;
}

void NoteChange(int file, off_t at, size_t length) {
  if (ThePlan().what != "cut") return;
  const std::string path = PathOf(file);
  if (!Watched(path) || (fcntl(file, F_GETFL) & O_DSYNC) != 0) return;
  struct stat state {};
  fstat(file, &state);
  Change change{path, at, std::string(length, '\0'), state.st_size, ""};
  const int reader = static_cast<int>(syscall(SYS_openat, AT_FDCWD, path.c_str(), O_RDONLY));
  const long got = syscall(SYS_pread64, reader, change.before.data(), length, at);
  syscall(SYS_close, reader);
  change.before.resize(got < 0 ? 0 : static_cast<size_t>(got));
  const std::lock_guard lock(changes_mutex);
  Changes().push_back(std::move(change));
}

// A file or a folder is synced.
void NoteSync(int file) {
  if (ThePlan().what != "cut") return;
  const std::string path = PathOf(file);
  const std::lock_guard lock(changes_mutex);
  std::erase_if(Changes(), [&](const Change& change) {
    const std::string& place = change.moved_to.empty() ? change.path : change.moved_to;
    return place == path || (!change.moved_to.empty() && place.substr(0, place.rfind('/')) == path);
  });
}

void CutPower() {
  const std::lock_guard lock(changes_mutex);
  for (auto change = Changes().rbegin(); change != Changes().rend(); ++change) {
    if (!change->moved_to.empty()) {
      syscall(SYS_rename, change->moved_to.c_str(), change->path.c_str());
      continue;
    }
    const int file =
        static_cast<int>(syscall(SYS_openat, AT_FDCWD, change->path.c_str(), O_WRONLY));
    if (file < 0) continue;
    syscall(SYS_pwrite64, file, change->before.data(), change->before.size(), change->at);
    syscall(SYS_ftruncate, file, change->size);
    syscall(SYS_close, file);
  }
}

void NoteDone() {
  const std::string path = Variable("FAULT_DONE");
  if (path.empty()) return;
  syscall(SYS_close, syscall(SYS_openat, AT_FDCWD, path.c_str(), O_CREAT | O_WRONLY, 0600));
}

// Counts a call. The errno that it fails with; 0: it does its work; -1: half of it.
int Fault(Call call) {
  const Plan& plan = ThePlan();
  const long n = counts[call].fetch_add(1) + 1;
  if (call != plan.call || n != plan.n) return 0;
  NoteDone();
  if (plan.what == "cut") CutPower();
  if (plan.what == "cut" || plan.what == "kill") raise(SIGKILL);
  if (plan.what == "delay") usleep(1'000'000);
  if (plan.what == "short") return -1;
  return atoi(plan.what.c_str());
}

// For a file.
int Fault(Call call, int file) { return Watched(PathOf(file)) ? Fault(call) : 0; }

// Half of a length, but something.
size_t Half(size_t length) { return length < 2 ? length : length / 2; }

template <typename Result, typename Work>
Result Unless(int fault, Result failed, const Work& work) {
  if (fault > 0) {
    errno = fault;
    return failed;
  }
  return work();
}

ssize_t Transfer(Call call, int file, off_t at, size_t length, const auto& work) {
  const int fault = Fault(call, file);
  if (fault == -1) length = Half(length);
  if (call == kWrite && fault <= 0) NoteChange(file, at, length);
  return Unless<ssize_t>(fault, -1, [&] { return work(length); });
}

off_t PlaceOf(int file) { return static_cast<off_t>(syscall(SYS_lseek, file, 0, SEEK_CUR)); }

size_t LengthOf(const iovec* pieces, int count) {
  size_t length = 0;
  for (int i = 0; i < count; ++i) length += pieces[i].iov_len;
  return length;
}

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

ssize_t read(int file, void* bytes, size_t length) {
  return Transfer(kRead, file, 0, length,
                  [&](size_t most) { return syscall(SYS_read, file, bytes, most); });
}
ssize_t pread(int file, void* bytes, size_t length, off_t at) {
  return Transfer(kRead, file, at, length,
                  [&](size_t most) { return syscall(SYS_pread64, file, bytes, most, at); });
}
ssize_t pread64(int file, void* bytes, size_t length, off_t at) {
  return pread(file, bytes, length, at);
}
ssize_t write(int file, const void* bytes, size_t length) {
  return Transfer(kWrite, file, PlaceOf(file), length,
                  [&](size_t most) { return syscall(SYS_write, file, bytes, most); });
}
ssize_t pwrite(int file, const void* bytes, size_t length, off_t at) {
  return Transfer(kWrite, file, at, length,
                  [&](size_t most) { return syscall(SYS_pwrite64, file, bytes, most, at); });
}
ssize_t pwrite64(int file, const void* bytes, size_t length, off_t at) {
  return pwrite(file, bytes, length, at);
}
// Half of it: the first piece, or half of the only one.
ssize_t writev(int file, const iovec* pieces, int count) {
  const size_t whole = LengthOf(pieces, count);
  return Transfer(kWrite, file, PlaceOf(file), whole, [&](size_t most) {
    return most == whole ? syscall(SYS_writev, file, pieces, count)
                         : syscall(SYS_write, file, pieces->iov_base, Half(pieces->iov_len));
  });
}
ssize_t pwritev(int file, const iovec* pieces, int count, off_t at) {
  const size_t whole = LengthOf(pieces, count);
  return Transfer(kWrite, file, at, whole, [&](size_t most) {
    return most == whole ? syscall(SYS_pwritev, file, pieces, count, at, 0)
                         : syscall(SYS_pwrite64, file, pieces->iov_base, Half(pieces->iov_len), at);
  });
}

int fsync(int file) {
  return Unless(Fault(kSync, file), -1, [&] {
    NoteSync(file);
    return static_cast<int>(syscall(SYS_fsync, file));
  });
}
int fdatasync(int file) {
  return Unless(Fault(kSync, file), -1, [&] {
    NoteSync(file);
    return static_cast<int>(syscall(SYS_fdatasync, file));
  });
}
void* mmap(void* place, size_t length, int protection, int flags, int file, off_t at) {
  return Unless<void*>(file < 0 ? 0 : Fault(kMap, file), MAP_FAILED, [&] {
    return reinterpret_cast<void*>(syscall(SYS_mmap, place, length, protection, flags, file, at));
  });
}
void* mmap64(void* place, size_t length, int protection, int flags, int file, off_t at) {
  return mmap(place, length, protection, flags, file, at);
}
int ftruncate(int file, off_t length) {
  return Unless(Fault(kTruncate, file), -1, [&] {
    NoteChange(file, length, 0);
    return static_cast<int>(syscall(SYS_ftruncate, file, length));
  });
}
int ftruncate64(int file, off_t length) { return ftruncate(file, length); }
int fallocate(int file, int mode, off_t at, off_t length) {
  return Unless(Fault(kTruncate, file), -1,
                [&] { return static_cast<int>(syscall(SYS_fallocate, file, mode, at, length)); });
}
int fallocate64(int file, int mode, off_t at, off_t length) {
  return fallocate(file, mode, at, length);
}
int rename(const char* from, const char* to) {
  const std::string old_path = Absolute(from);
  const std::string new_path = Absolute(to);
  const bool watched = Watched(old_path);
  return Unless(watched ? Fault(kRename) : 0, -1, [&] {
    if (ThePlan().what == "cut" && watched) {
      const std::lock_guard lock(changes_mutex);
      for (Change& change : Changes()) {
        if (change.path == old_path) change.path = new_path;
      }
      Changes().push_back({old_path, 0, "", 0, new_path});
    }
    return static_cast<int>(syscall(SYS_rename, from, to));
  });
}
int open(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  return Unless(Watched(Absolute(path)) ? Fault(kOpen) : 0, -1,
                [&] { return static_cast<int>(syscall(SYS_openat, AT_FDCWD, path, flags, mode)); });
}
int open64(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  return open(path, flags, mode);
}

int accept4(int socket, sockaddr* address, socklen_t* length, int flags) {
  return Unless(Fault(kAccept), -1, [&] {
    return static_cast<int>(syscall(SYS_accept4, socket, address, length, flags));
  });
}
int accept(int socket, sockaddr* address, socklen_t* length) {
  return accept4(socket, address, length, 0);
}
ssize_t sendmsg(int socket, const msghdr* message, int flags) {
  return Unless<ssize_t>(Fault(kSend), -1,
                         [&] { return syscall(SYS_sendmsg, socket, message, flags); });
}

int clock_gettime(clockid_t clock, timespec* time) {
  static const auto real = Real<int(clockid_t, timespec*)>("clock_gettime");
  const int code = real(clock, time);
  if (clock != CLOCK_REALTIME) return code;
  const Plan& plan = ThePlan();
  const long n = counts[kClock].fetch_add(1) + 1;
  if (plan.call != kClock || n < plan.n) return code;
  if (n == plan.n) NoteDone();
  time->tv_sec += plan.what == "back" ? -3600 : 3600;
  return code;
}
}
#pragma GCC visibility pop
