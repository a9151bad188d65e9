// SPDX-License-Identifier: Apache-2.0
// A writer that is killed at any instant, and a disk that is full.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <thread>

#include "absl/cleanup/cleanup.h"
#include "db/store/store.h"
#include "tests/db/store/full_disk.h"
#include "tests/db/store/test_database.h"
#include "tests/random.h"

namespace {
bool quota_is_used_up = false;
}  // namespace

// In place of that of the C library.
extern "C" int fallocate(int file, int mode, off_t at, off_t length) {
  if (quota_is_used_up) errno = EDQUOT;
  return quota_is_used_up ? -1 : static_cast<int>(syscall(SYS_fallocate, file, mode, at, length));
}

namespace silhouette {
namespace {

using testing::HasSubstr;

// In a child process: puts the numbers that are still missing, commits every few records and
// acknowledges each committed number through `acknowledge`. Never returns.
[[noreturn]] void WriteUntilKilled(const std::string& path, int acknowledge, uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto opened = Database::Open(path, Access::kWrite);
  if (!opened.ok()) _exit(10);
  Database& database = **opened;
  auto writer = database.Write("killed", absl::Hours(1));
  if (!writer.ok()) _exit(11);
  std::vector<ConfigurationNumber> waiting;
  for (ConfigurationNumber number : AllNumbers(database.grid())) {
    const absl::Status put = writer->Put(TestImage(database, number));
    if (absl::IsAlreadyExists(put)) continue;
    if (!put.ok()) _exit(12);
    waiting.push_back(number);
    if (random() % 8 != 0) continue;
    if (!writer->Commit().ok()) _exit(13);
    const size_t bytes = waiting.size() * sizeof(waiting[0]);
    if (write(acknowledge, waiting.data(), bytes) != static_cast<ssize_t>(bytes)) _exit(14);
    waiting.clear();
  }
  if (!writer->Commit().ok()) _exit(15);
  _exit(0);
}

TEST(RobotImageWriter, KilledAtAnyInstantKeepsWhatItAcknowledgedAndNothingHalf) {
  const std::string path = FreshFolder() / "db";
  ASSERT_TRUE(Database::Create(path, TestCell(64, 64)).ok());
  Random random;
  std::vector<ConfigurationNumber> acknowledged;
  int killed = 0;
  for (bool finished = false; !finished;) {
    int pipe_ends[2];
    ASSERT_EQ(pipe(pipe_ends), 0);
    const pid_t child = fork();
    if (child == 0) WriteUntilKilled(path, pipe_ends[1], random());
    close(pipe_ends[1]);
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 60'000));
    if (killed < 15) kill(child, SIGKILL);
    ConfigurationNumber number = 0;
    while (read(pipe_ends[0], &number, sizeof(number)) == sizeof(number)) {
      acknowledged.push_back(number);
    }
    close(pipe_ends[0]);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    finished = WIFEXITED(status);
    if (finished) {
      ASSERT_EQ(WEXITSTATUS(status), 0);
    }
    killed += finished ? 0 : 1;

    const auto database = Database::Open(path, Access::kRead);
    ASSERT_TRUE(database.ok()) << database.status();
    const auto snapshot = (*database)->Read();
    ASSERT_TRUE(snapshot.ok()) << snapshot.status();
    for (ConfigurationNumber each : acknowledged) ASSERT_TRUE(*snapshot->Contains(each)) << each;
    const auto visit = [&](ConfigurationNumber each, absl::StatusOr<RobotImage> image) {
      EXPECT_TRUE(image.ok()) << image.status();
      EXPECT_EQ(*image, TestImage(**database, each));
      return true;
    };
    ASSERT_TRUE(snapshot->ForEach(visit).ok());
    if (finished) {
      EXPECT_EQ(snapshot->size(), (*database)->grid().size());
    }
  }
  std::cout << killed << " writers killed" << std::endl;
}

// The robot with something on its hand.
RobotImage WithTool(RobotImage image) {
  for (Mask& mask : image.masks) {
    mask = Mask::FromPredicate(
        mask.size(), [&](int x, int y) { return mask.at(x, y) != (x / 3 == 2 && y / 3 == 1); });
  }
  return image;
}

// In a child process: replaces all records of the default variant, on which those of the other
// rest, by versions from `version` on, and acknowledges every version that is wholly committed.
[[noreturn]] void ReplaceUntilKilled(const std::string& path, int acknowledge, uint64_t version,
                                     uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto opened = Database::Open(path, Access::kWrite);
  if (!opened.ok()) _exit(10);
  for (;; ++version) {
    auto writer = (*opened)->Write("killed", absl::Hours(1));
    if (!writer.ok()) _exit(11);
    for (const ConfigurationNumber number : AllNumbers((*opened)->grid())) {
      if (!writer->Put(TestImage(**opened, number, version), true).ok()) _exit(12);
      if (random() % 40 == 0 && !writer->Commit().ok()) _exit(13);
    }
    if (!writer->Commit().ok()) _exit(14);
    if (write(acknowledge, &version, sizeof(version)) != sizeof(version)) _exit(15);
  }
}

TEST(RobotImageWriter, KilledWhileItReplacesWhatOtherVariantsRestOnLeavesAllVariantsWhole) {
  const std::string path = FreshFolder() / "db";
  Random random;
  // The records of the variant are made with version 0 of the default variant's, and never written
  // again.
  std::map<ConfigurationNumber, RobotImage> tools;
  {
    const auto database = Database::Create(path, TestCell());
    ASSERT_TRUE(database.ok()) << database.status();
    const auto variant = (*database)->CreateVariant(kTool, "test");
    for (Database* each : {database->get(), variant->get()}) {
      auto writer = each->Write("test", absl::Hours(1));
      for (const ConfigurationNumber number : AllNumbers(each->grid())) {
        RobotImage image = TestImage(*each, number, 0);
        if (each != database->get()) tools[number] = image = WithTool(image);
        ASSERT_TRUE(writer->Put(image).ok());
      }
      ASSERT_TRUE(writer->Commit().ok());
    }
  }
  uint64_t whole = 0;  // the version that was acknowledged last
  for (int round = 0; round < 15; ++round) {
    int pipe_ends[2];
    ASSERT_EQ(pipe(pipe_ends), 0);
    const pid_t child = fork();
    if (child == 0) ReplaceUntilKilled(path, pipe_ends[1], whole + 1, random());
    close(pipe_ends[1]);
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 60'000));
    kill(child, SIGKILL);
    uint64_t version = 0;
    while (read(pipe_ends[0], &version, sizeof(version)) == sizeof(version)) whole = version;
    close(pipe_ends[0]);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << WEXITSTATUS(status);

    const auto database = Database::Open(path, Access::kRead);
    ASSERT_TRUE(database.ok()) << database.status();
    const auto states = (*database)->ReadVariants();
    ASSERT_TRUE(states.ok()) << states.status();
    for (const ConfigurationNumber number : AllNumbers((*database)->grid())) {
      const auto plain = (*states)[0].snapshot.Find(number);
      ASSERT_TRUE(plain.ok()) << plain.status();
      EXPECT_TRUE(**plain == TestImage(**database, number, whole) ||
                  **plain == TestImage(**database, number, whole + 1))
          << number;
      const auto tool = (*states)[1].snapshot.Find(number);
      ASSERT_TRUE(tool.ok()) << tool.status();
      EXPECT_EQ(**tool, tools[number]);
    }
  }
}

TEST(Database, InterruptedWhileBeingMadeIsNoneAndCanBeMadeAgain) {
  const std::string path = FreshFolder() / "db";
  std::mt19937_64 random(7);
  for (int round = 0; round < 20; ++round) {
    const pid_t child = fork();
    if (child == 0) _exit(Database::Create(path, TestCell()).ok() ? 0 : 1);
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 3'000));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const absl::Status opened = Database::Open(path, Access::kRead).status();
    EXPECT_TRUE(opened.ok() || absl::IsNotFound(opened)) << opened;
    const absl::Status made = Database::Create(path, TestCell()).status();
    EXPECT_EQ(made.ok(), !opened.ok()) << made;
    EXPECT_TRUE(Database::Open(path, Access::kWrite).ok());
    std::filesystem::remove_all(path);
  }
}

TEST(Database, WrittenByAnotherProcessNamesIt) {
  const std::string path = FreshFolder() / "db";
  ASSERT_TRUE(Database::Create(path, TestCell()).ok());
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const auto database = Database::Open(path, Access::kWrite);
    const char ok = database.ok() ? 'y' : 'n';
    if (write(ready[1], &ok, 1) == 1) pause();
    _exit(1);
  }
  char ok = 0;
  ASSERT_EQ(read(ready[0], &ok, 1), 1);
  EXPECT_EQ(ok, 'y');
  const absl::Status status = Database::Open(path, Access::kWrite).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(),
              HasSubstr(absl::StrCat("another process (pid ", child, ") is writing to it")));
  EXPECT_TRUE(Database::Open(path, Access::kRead).ok());
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(Database::Open(path, Access::kWrite).ok());
  close(ready[0]);
  close(ready[1]);
}

// A reader's map is as large as the database was; the writer is another process and lets it grow.
TEST(Snapshot, FollowsADatabaseThatAnotherProcessLetsGrow) {
  const std::string path = FreshFolder() / "db";
  storage::v1::CellDescription cell = TestCell(64, 64);
  cell.mutable_views(0)->set_mask_width(1024);
  cell.mutable_views(0)->set_mask_height(1024);
  ASSERT_TRUE(Database::Create(path, cell).ok());
  const pid_t child = fork();
  if (child == 0) {
    const auto database = Database::Open(path, Access::kWrite);
    auto writer = (*database)->Write("grow", absl::Hours(1));
    std::mt19937_64 random(1);
    RobotImage image;
    for (MaskSize size : (*database)->mask_sizes()) {
      image.masks.push_back(Mask::FromPredicate(size, [&](int, int) { return random() % 2 == 0; }));
    }
    for (image.number = 0; image.number < 700; ++image.number) {
      if (!writer->Put(image).ok()) _exit(1);
    }
    _exit(writer->Commit().ok() ? 0 : 2);
  }
  const auto database = Database::Open(path, Access::kRead);
  ASSERT_TRUE(database.ok());
  int status = -1;
  do {
    const auto snapshot = (*database)->Read();
    ASSERT_TRUE(snapshot.ok()) << snapshot.status();
    if (snapshot->size() > 0) {
      const auto last = snapshot->Find(snapshot->size() - 1);
      ASSERT_TRUE(last.ok()) << last.status();
      ASSERT_TRUE(last->has_value());
    }
  } while (waitpid(child, &status, WNOHANG) == 0);
  EXPECT_EQ(status, 0);
  EXPECT_EQ((*database)->Read()->size(), 700);
}

// Ends a child that does `work` when a file of it would become larger than `bytes`.
void RunAndStopAt(rlim_t bytes, const std::function<void()>& work) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit limit{.rlim_cur = bytes, .rlim_max = bytes};
    setrlimit(RLIMIT_FSIZE, &limit);
    work();
    _exit(0);
  }
  waitpid(child, nullptr, 0);
}

TEST(Database, MadeAgainAfterItsMakingWasInterruptedAtAnyPage) {
  const std::string path = FreshFolder() / "db";
  for (rlim_t pages = 0; pages < 12; ++pages) {
    RunAndStopAt(4096 * pages, [&] { Database::Create(path, TestCell()).IgnoreError(); });
    const absl::Status status = Database::Create(path, TestCell()).status();
    EXPECT_TRUE(status.ok() || absl::IsAlreadyExists(status)) << pages << ": " << status;
    EXPECT_TRUE(Database::Open(path, Access::kRead).ok());
    std::filesystem::remove_all(path);
  }
}

TEST(Database, CompactedAgainAfterThatWasInterruptedAtAnyPage) {
  const auto database = MakeFilledDatabase(1, TestCell());
  const std::string from = database->path();
  const uint64_t size = std::filesystem::file_size(from + "/data.mdb");
  const std::string path = FreshFolder() / "copy";
  for (rlim_t bytes = 0; bytes <= size; bytes += 4096) {
    RunAndStopAt(bytes, [&] {
      const auto opened = Database::Open(from, Access::kRead);
      if (opened.ok()) (*opened)->Compact(path).IgnoreError();
    });
    const absl::Status status = database->Compact(path);
    EXPECT_TRUE(status.ok() || absl::IsAlreadyExists(status)) << bytes << ": " << status;
    const auto copy = Database::Open(path, Access::kRead);
    ASSERT_TRUE(copy.ok()) << copy.status();
    EXPECT_EQ(ContentOf(**copy), ContentOf(*database));
    std::filesystem::remove_all(path);
  }
}

TEST(Database, IsCopiedByOneProcessAtATimeToAFolder) {
  const auto database = MakeFilledDatabase(1, TestCell());
  const std::string from = database->path();
  const std::string path = FreshFolder() / "copy";
  const pid_t child = fork();
  if (child == 0) {  // stops in the middle of its copy
    signal(SIGXFSZ, [](int) { kill(getpid(), SIGSTOP); });
    const rlimit limit{.rlim_cur = 4096, .rlim_max = 4096};
    const auto opened = Database::Open(from, Access::kRead);
    setrlimit(RLIMIT_FSIZE, &limit);
    if (opened.ok()) (*opened)->Compact(path).IgnoreError();
    _exit(0);
  }
  int state = 0;
  ASSERT_EQ(waitpid(child, &state, WUNTRACED), child);
  ASSERT_TRUE(WIFSTOPPED(state));
  const absl::Status second = database->Compact(path);
  EXPECT_EQ(second.code(), absl::StatusCode::kFailedPrecondition) << second;
  EXPECT_THAT(second.message(),
              HasSubstr(absl::StrCat("another process (pid ", child, ") is writing to it")));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(database->Compact(path).ok());
  EXPECT_EQ(ContentOf(**Database::Open(path, Access::kRead)), ContentOf(*database));
}

TEST_F(FullDisk, KeepsTheBatchAndWhatWasCommitted) {
  const auto database = Database::Create(disk_ + "/db", TestCell(64, 64));
  ASSERT_TRUE(database.ok()) << database.status();
  auto writer = (*database)->Write("full", absl::Hours(1));
  ASSERT_TRUE(writer.ok());
  const std::vector<ConfigurationNumber> numbers = AllNumbers((*database)->grid());
  size_t put = 0;
  absl::Status status;
  for (; put < numbers.size() && status.ok(); ++put) {
    ASSERT_TRUE(writer->Put(TestImage(**database, numbers[put])).ok());
    if (put % 100 == 0 || put > 300) status = writer->Commit();
    if (put == 300) Fill();
  }
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
  EXPECT_THAT(status.message(), HasSubstr("the disk is full; make room and try again"));
  const uint64_t committed = writer->committed();
  EXPECT_GE(committed, 300);
  EXPECT_LT(committed, put);
  EXPECT_EQ(writer->Commit().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ((*database)->Read()->size(), committed);

  Empty();
  ASSERT_TRUE(writer->Commit().ok());
  EXPECT_EQ(writer->committed(), put);
  const auto snapshot = (*database)->Read();
  for (size_t i = 0; i < put; ++i) {
    EXPECT_EQ(**snapshot->Find(numbers[i]), TestImage(**database, numbers[i]));
  }
}

TEST_F(FullDisk, CanBeReadButNoDatabaseCanBeMadeThere) {
  ASSERT_TRUE(Database::Create(disk_ + "/db", TestCell()).ok());
  Fill();
  EXPECT_TRUE(Database::Open(disk_ + "/db", Access::kRead).ok());
  EXPECT_EQ(Database::Create(disk_ + "/new", TestCell()).status().code(),
            absl::StatusCode::kResourceExhausted);
  std::filesystem::remove(disk_ + "/db/lock.mdb");
  std::ofstream(disk_ + "/rest") << std::string(65536, 'x');
  const absl::Status status = Database::Open(disk_ + "/db", Access::kRead).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
}

TEST(Database, WhoseLockFileIsOverQuotaIsRefused) {
  const std::string path = FreshFolder() / "db";
  MakeDatabase(TestCell(), path).reset();
  std::filesystem::remove(path + "/lock.mdb");
  quota_is_used_up = true;
  const absl::Status status = Database::Open(path, Access::kRead).status();
  quota_is_used_up = false;
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
  EXPECT_THAT(status.message(), HasSubstr("the disk is full; make room and try again"));
  EXPECT_TRUE(Database::Open(path, Access::kRead).ok());
}

TEST_F(FullDisk, LeavesNoHalfCopy) {
  const auto database = MakeFilledDatabase(1, TestCell());
  Fill();
  const absl::Status status = database->Compact(disk_ + "/copy");
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
  EXPECT_FALSE(std::filesystem::exists(disk_ + "/copy/data.mdb"));
}

}  // namespace
}  // namespace silhouette
