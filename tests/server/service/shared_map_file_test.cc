// The file of the shared map: who may read it, what is refused, and what a server leaves that was
// killed.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>

#include "absl/time/clock.h"
#include "clients/shared_map/layout.h"
#include "clients/shared_map/writer.h"
#include "server/scene/clock.h"
#include "server/service/messages.h"
#include "server/service/shared_map_writer.h"
#include "silhouette/shared_space.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using client::SharedSpace;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr uid_t kNobody = 65534;

// The simplest of servers: everything is free in scenes with even ids, occupied in the others.
class Source {
 public:
  explicit Source(const SharedMapSettings& settings) {
    v1::GetDatabaseResponse message;
    static const auto database = NewDatabase();
    ToMessage(*database, Policy{}, &message);
    const std::string description = message.SerializeAsString();
    const shared_map::Layout layout{.tiles = database->grid().tiles(),
                                    .description_bytes = description.size()};
    auto made = SharedMapFile::Create(settings, layout.FileBytes(), nullptr);
    status = made.status();
    if (!made.ok()) return;
    file = *std::move(made);
    writer.emplace(file->words(), layout, description, shared_map::ClockId::Ours());
    status = file->Show();
  }

  void Publish(uint64_t scene, absl::Duration valid = absl::Minutes(10)) {
    std::array<uint64_t, kTileSize / 64> all;
    all.fill(~uint64_t{0});
    const std::array<uint64_t, kTileSize / 64> none{};
    const int64_t now = absl::ToInt64Nanoseconds(SystemClock().running);
    writer->Publish(
        {.scene = scene, .taken = now, .valid_until = now + absl::ToInt64Nanoseconds(valid)}, "",
        [&](uint64_t) -> shared_map::Writer::TileStates {
          if (scene % 2 == 0) return {all, none, none};
          return {none, all, none};
        });
  }

  absl::Status status;
  std::unique_ptr<SharedMapFile> file;
  std::optional<shared_map::Writer> writer;
};

// A process that does `work` and ends with what it returns.
pid_t Child(const std::function<int()>& work) {
  const pid_t pid = fork();
  if (pid == 0) _exit(work());
  return pid;
}

int CodeOf(pid_t pid) {
  int status = 0;
  waitpid(pid, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

class SharedMapFileTest : public ::testing::Test {
 protected:
  absl::Status OpenStatus(std::optional<uint32_t> owner = std::nullopt) {
    return SharedSpace::Open(file_, absl::InfiniteDuration(), owner).status();
  }
  // The mode of the file.
  mode_t Mode() {
    struct stat status {};
    EXPECT_EQ(stat(file_.c_str(), &status), 0);
    return status.st_mode & 07777;
  }
  void Poke(size_t word, uint64_t value) {
    std::fstream file(file_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(8 * word));
    file.write(reinterpret_cast<const char*>(&value), sizeof(value));
  }

  const std::filesystem::path folder_ = FreshFolder();
  const std::string file_ = folder_ / "map";
};

TEST_F(SharedMapFileTest, SaysWhoMayReadIt) {
  const mode_t before = umask(0077);
  for (const mode_t mode : {0600, 0640, 0644}) {
    const Source source({.file = file_, .mode = mode});
    EXPECT_TRUE(source.status.ok()) << source.status;
    EXPECT_EQ(Mode(), mode);
    EXPECT_TRUE(OpenStatus().ok()) << OpenStatus();
  }
  umask(before);
  for (const mode_t mode : {0664, 0646, 0755, 0440, 0240, 04640}) {
    const Source source({.file = file_, .mode = mode});
    EXPECT_EQ(source.status.code(), absl::StatusCode::kInvalidArgument) << mode;
    EXPECT_FALSE(std::filesystem::exists(file_));
  }
}

TEST_F(SharedMapFileTest, IsReadByOtherUsersOnlyIfItsPermissionsLetThem) {
  if (getuid() != 0) GTEST_SKIP() << "takes another user: only root can become one";
  const auto read_as_nobody = [&] {
    return CodeOf(Child([&] {
      if (setgid(kNobody) != 0 || setuid(kNobody) != 0) return 99;
      const auto space = SharedSpace::Open(file_);
      if (space.status().code() == absl::StatusCode::kPermissionDenied) return 1;
      return space.ok() && space->IsFree(0) ? 0 : 2;
    }));
  };
  std::filesystem::permissions(folder_.string(), std::filesystem::perms(0755));
  std::optional<Source> source(SharedMapSettings{.file = file_, .mode = 0644});
  source->Publish(2);
  EXPECT_EQ(read_as_nobody(), 0);
  source.emplace(SharedMapSettings{.file = file_, .mode = 0640});
  EXPECT_EQ(read_as_nobody(), 1);
  ASSERT_EQ(chown(file_.c_str(), 0, kNobody), 0);
  source->Publish(2);
  EXPECT_EQ(read_as_nobody(), 0) << "the file's group may read it";
}

TEST_F(SharedMapFileTest, IsRefusedIfOthersMayWriteToItOrOwnIt) {
  const Source source({.file = file_});
  for (const mode_t mode : {0660, 0602, 0666}) {
    ASSERT_EQ(chmod(file_.c_str(), mode), 0);
    EXPECT_EQ(OpenStatus().code(), absl::StatusCode::kPermissionDenied);
    EXPECT_THAT(std::string(OpenStatus().message()), HasSubstr("chmod go-w"));
  }
  ASSERT_EQ(chmod(file_.c_str(), 0640), 0);
  EXPECT_TRUE(OpenStatus(getuid()).ok());
  EXPECT_EQ(OpenStatus(getuid() + 1).code(), absl::StatusCode::kPermissionDenied);
  EXPECT_THAT(std::string(OpenStatus(getuid() + 1).message()), HasSubstr("belongs to user"));
}

TEST_F(SharedMapFileTest, ReopenedBelongsToTheSameUser) {
  if (getuid() != 0) GTEST_SKIP() << "takes another user: only root can make their files";
  const Source source({.file = file_});
  const auto space = SharedSpace::Open(file_);
  ASSERT_TRUE(space.ok()) << space.status();
  EXPECT_TRUE(space->Reopen().ok());
  ASSERT_EQ(chown(file_.c_str(), kNobody, kNobody), 0);
  EXPECT_EQ(space->Reopen().status().code(), absl::StatusCode::kPermissionDenied);
}

TEST_F(SharedMapFileTest, WhatIsNoSharedMapIsRefusedInOneSentence) {
  const auto refused = [&](absl::StatusCode code, const std::string& why) {
    const absl::Status status = OpenStatus();
    EXPECT_EQ(status.code(), code) << status;
    EXPECT_THAT(std::string(status.message()),
                AllOf(HasSubstr(why), HasSubstr(file_), Not(HasSubstr("\n"))));
  };
  constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;
  refused(absl::StatusCode::kNotFound, "there is no shared map");
  std::filesystem::create_directory(file_);
  refused(kInvalid, "is not a file");
  std::filesystem::remove(file_);
  ASSERT_EQ(mkfifo(file_.c_str(), 0600), 0);
  refused(kInvalid, "is not a file");
  std::filesystem::remove(file_);
  std::filesystem::create_symlink("elsewhere", file_);
  refused(kInvalid, "is a symbolic link");
  std::filesystem::remove(file_);
  for (const std::string& content : {std::string(), std::string("a"), std::string(100'000, 'a')}) {
    std::ofstream(file_) << content;
    chmod(file_.c_str(), 0600);
    refused(kInvalid, "is not a shared map");
  }
}

TEST_F(SharedMapFileTest, DamagedIsRefused) {
  const auto broken = [&](const std::function<void()>& damage) {
    const Source source({.file = file_});
    EXPECT_TRUE(source.status.ok()) << source.status;
    EXPECT_TRUE(OpenStatus().ok()) << OpenStatus();
    damage();
    return OpenStatus();
  };
  const auto poked = [&](size_t word, uint64_t value) {
    return broken([&] { Poke(word, value); });
  };
  for (const size_t word : {2, 3, 4, 5, 6, 7}) {
    for (const uint64_t value : {uint64_t{0}, uint64_t{5}, ~uint64_t{0}, uint64_t{1} << 63}) {
      EXPECT_EQ(poked(word, value).code(), absl::StatusCode::kInvalidArgument) << word;
    }
  }
  EXPECT_THAT(std::string(poked(1, 3).message()), HasSubstr("is a shared map of format 3"));
  EXPECT_THAT(std::string(poked(512, ~uint64_t{0}).message()), HasSubstr("what it is of"));
  for (const size_t word : {8, 9, 10}) {
    const absl::Status status = poked(word, 12345);
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_THAT(std::string(status.message()), HasSubstr("nothing tells how old"));
  }
  const absl::Status nowhere = broken([&] {
    for (const size_t word : {8, 9, 10}) Poke(word, 0);
  });
  EXPECT_EQ(nowhere.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(nowhere.message()), HasSubstr("boot_id cannot be read"));
  const auto cut = [&](off_t size) {
    return broken([&] { ASSERT_EQ(truncate(file_.c_str(), size), 0); });
  };
  for (const off_t size : {0, 4, 100, 4096, 8192, 20'000}) {
    EXPECT_EQ(cut(size).code(), absl::StatusCode::kInvalidArgument) << size;
  }
}

TEST_F(SharedMapFileTest, TakesThePlaceOfNothingElse) {
  std::ofstream(file_) << "a letter of some importance";
  EXPECT_EQ(Source({.file = file_}).status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(std::filesystem::file_size(file_), 27u);
  std::filesystem::remove(file_);
  EXPECT_EQ(Source({.file = folder_ / "nowhere/map"}).status.code(),
            absl::StatusCode::kUnavailable);

  Source first({.file = file_});
  first.Publish(2);
  const auto space = SharedSpace::Open(file_);
  const Source second({.file = file_});
  EXPECT_EQ(second.status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(second.status.message()), HasSubstr("another server"));
  EXPECT_TRUE(space->IsFree(0));
  EXPECT_TRUE(OpenStatus().ok());
}

TEST_F(SharedMapFileTest, ThatIsNotItsOwnAnyMoreStays) {
  std::optional<Source> source(SharedMapSettings{.file = file_});
  std::filesystem::remove(file_);
  std::ofstream(file_) << "somebody else's";
  source.reset();
  EXPECT_TRUE(std::filesystem::exists(file_));
}

TEST_F(SharedMapFileTest, OfAServerThatWasKilledIsUnknownInTime) {
  // Half of the file is overwritten again and again when it is killed.
  const pid_t server = Child([&] {
    Source source({.file = file_});
    for (uint64_t scene = 1;; ++scene) source.Publish(scene, absl::Milliseconds(300));
    return 0;
  });
  absl::StatusOr<SharedSpace> space = SharedSpace::Open(file_);
  while (!space.ok() || space->unknown_reason() == client::Reason::kNoScene) {
    space = SharedSpace::Open(file_);
  }
  kill(server, SIGKILL);
  EXPECT_EQ(CodeOf(server), 1000 + SIGKILL);
  const absl::Time killed = absl::Now();
  while (space->StateAt(0) != client::State::kUnknown) {
    ASSERT_LT(absl::Now() - killed, absl::Seconds(10));
  }
  EXPECT_EQ(space->unknown_reason(), client::Reason::kSceneStale);
  EXPECT_GE(space->Age(), absl::Milliseconds(300));
  // The next one takes the place of what is left.
  Source source({.file = file_});
  ASSERT_TRUE(source.status.ok()) << source.status;
  source.Publish(2);
  EXPECT_EQ(space->unknown_reason(), client::Reason::kSceneStale);
  EXPECT_TRUE(space->Reopen()->IsFree(0));
}

TEST_F(SharedMapFileTest, NoProcessSeesAMixtureWhileAnotherOneWrites) {
  const pid_t server = Child([&] {
    Source source({.file = file_});
    for (uint64_t scene = 1;; ++scene) {
      source.Publish(scene);
      if (scene % 16 == 0) absl::SleepFor(absl::Microseconds(300));
    }
    return 0;
  });
  absl::StatusOr<SharedSpace> space = SharedSpace::Open(file_);
  while (!space.ok() || space->unknown_reason() == client::Reason::kNoScene) {
    space = SharedSpace::Open(file_);
  }
  const ConfigurationGrid& grid = space->grid();
  std::vector<uint32_t> numbers;
  for (uint32_t number = 0; number < grid.number_limit(); ++number) {
    if (grid.Contains(number)) numbers.push_back(number);
  }
  for (int i = 0; i < 3000; ++i) {
    const client::NumberChecks checks = space->CheckNumbers(numbers);
    ASSERT_EQ(checks.unknown_reason, client::Reason::kUnspecified);
    const client::State expected =
        checks.basis.scene_id % 2 == 0 ? client::State::kFree : client::State::kOccupied;
    for (size_t k = 0; k < numbers.size(); ++k) ASSERT_EQ(checks.StateOf(k), expected);
    const client::ConfigurationSpace copy = space->Copy();
    const client::StateCounts counts = copy.Count();
    ASSERT_EQ(copy.basis().scene_id % 2 == 0 ? counts.free : counts.occupied, grid.size());
    client::Basis basis;
    const client::Verdict verdict = space->Check({1, 0}, &basis);
    ASSERT_EQ(verdict.free(), basis.scene_id % 2 == 0);
  }
  kill(server, SIGKILL);
  CodeOf(server);
}

TEST_F(SharedMapFileTest, ServersClockIsThatOfItsReaders) {
  struct timespec monotonic {};
  const int64_t before = absl::ToInt64Nanoseconds(SystemClock().running);
  ASSERT_EQ(clock_gettime(CLOCK_MONOTONIC, &monotonic), 0);
  const int64_t after = absl::ToInt64Nanoseconds(SystemClock().running);
  const int64_t nanoseconds = absl::ToInt64Nanoseconds(absl::DurationFromTimespec(monotonic));
  EXPECT_LE(before, nanoseconds);
  EXPECT_LE(nanoseconds, after);
}

}  // namespace
}  // namespace silhouette
