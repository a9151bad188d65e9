// SPDX-License-Identifier: Apache-2.0
// Folders without permission to write. Root may write everywhere, so the reader is a child process
// that gives its rights away, and a read-only mount.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <functional>
#include <iostream>

#include "db/store/store.h"
#include "db/store/writer_lock.h"
#include "tests/db/store/test_database.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

constexpr uid_t kNobody = 65534;

// Runs `body` in a child process without root's rights; it prints what it finds wrong.
bool HoldsForAnOrdinaryUser(const std::function<bool()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    if (geteuid() == 0 && (setgid(kNobody) != 0 || setuid(kNobody) != 0)) _exit(2);
    _exit(body() ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

bool Check(bool holds, const std::string& what) {
  if (!holds) std::cout << what << std::endl;
  return holds;
}

void MakeReadableDatabase(const std::string& path) {
  const auto database = MakeDatabase(TestCell(), path);
  PutAll(*database, {TestImage(*database, 1)});
}

bool CanBeRead(const std::string& path) {
  const auto database = Database::Open(path, Access::kRead);
  if (!database.ok()) return Check(false, database.status().ToString());
  const auto snapshot = (*database)->Read();
  if (!snapshot.ok()) return Check(false, snapshot.status().ToString());
  const auto image = snapshot->Find(1);
  return Check(image.ok() && **image == TestImage(**database, 1), "another image");
}

bool CannotBeWritten(const std::string& path) {
  const absl::Status status = Database::Open(path, Access::kWrite).status();
  return Check(absl::IsFailedPrecondition(status), status.ToString());
}

void TakePermission(const std::string& path) {
  for (const auto& entry : std::filesystem::directory_iterator(path)) {
    ASSERT_EQ(chmod(entry.path().c_str(), 0444), 0);
  }
  ASSERT_EQ(chmod(path.c_str(), 0555), 0);
}

TEST(Database, WithoutPermissionToWriteCanBeRead) {
  const std::filesystem::path folder = FreshFolder();
  MakeReadableDatabase(folder / "db");
  EXPECT_FALSE(ReadersKeepWritersOut(folder / "db"));
  TakePermission(folder / "db");
  EXPECT_TRUE(HoldsForAnOrdinaryUser(
      [&] { return CanBeRead(folder / "db") && CannotBeWritten(folder / "db"); }));
  EXPECT_TRUE(HoldsForAnOrdinaryUser([&] { return ReadersKeepWritersOut(folder / "db"); }));
  EXPECT_TRUE(HoldsForAnOrdinaryUser([&] {
    const absl::Status status = Database::Create(folder / "db/new", TestCell()).status();
    return Check(absl::IsFailedPrecondition(status), status.ToString());
  }));
  chmod((folder / "db").c_str(), 0755);
}

TEST(Database, WithoutPermissionToRegisterIsNotReadWhileItIsWritten) {
  if (geteuid() != 0) GTEST_SKIP() << "needs a second user, thus root";
  const std::filesystem::path folder = FreshFolder();
  MakeReadableDatabase(folder / "db");
  TakePermission(folder / "db");
  const auto writer = Database::Open(folder / "db", Access::kWrite);
  ASSERT_TRUE(writer.ok()) << writer.status();
  const pid_t writing = getpid();
  EXPECT_TRUE(HoldsForAnOrdinaryUser([&] {
    const absl::Status status = Database::Open(folder / "db", Access::kRead).status();
    const std::string expected = absl::StrCat("another process (pid ", writing, ") is writing");
    return Check(absl::IsFailedPrecondition(status) &&
                     std::string(status.message()).find(expected) != std::string::npos,
                 status.ToString());
  }));
}

TEST(Database, WithoutPermissionToRegisterIsNotReadIfNothingKeepsWritersOut) {
  const std::filesystem::path folder = FreshFolder();
  MakeReadableDatabase(folder / "db");
  std::filesystem::remove(folder / "db/writer.lock");
  TakePermission(folder / "db");
  EXPECT_TRUE(HoldsForAnOrdinaryUser([&] {
    const absl::Status status = Database::Open(folder / "db", Access::kRead).status();
    return Check(
        absl::IsFailedPrecondition(status) &&
            std::string(status.message()).find("has no 'writer.lock'") != std::string::npos,
        status.ToString());
  }));
  chmod((folder / "db").c_str(), 0755);
  std::ofstream(folder / "db/writer.lock").close();
  TakePermission(folder / "db");
  EXPECT_TRUE(HoldsForAnOrdinaryUser([&] { return CanBeRead(folder / "db"); }));
  chmod((folder / "db").c_str(), 0755);
}

TEST(Database, ReaderThatKeepsWritersOutIsNotCalledByTheNumberOfTheLastWriter) {
  const std::filesystem::path folder = FreshFolder();
  MakeReadableDatabase(folder / "db");
  const auto reader = WriterLock::KeepWritersOut(folder / "db", "");
  ASSERT_TRUE(reader.ok()) << reader.status();
  EXPECT_THAT(
      Database::Open(folder / "db", Access::kWrite).status().message(),
      HasSubstr(": another process is writing to it, or a server without permission to write "
                "lock.mdb reads it; end that first"));
  close(*reader);
}

TEST(Database, WithoutPermissionToReadSaysSo) {
  const std::filesystem::path folder = FreshFolder();
  MakeReadableDatabase(folder / "db");
  ASSERT_EQ(chmod((folder / "db/data.mdb").c_str(), 0), 0);
  EXPECT_TRUE(HoldsForAnOrdinaryUser([&] {
    const absl::Status status = Database::Open(folder / "db", Access::kRead).status();
    return Check(absl::IsFailedPrecondition(status) &&
                     std::string(status.message()).find("no permission") != std::string::npos,
                 status.ToString());
  }));
}

TEST(Database, ThatAProcessOfTheSameNumberInAnotherContainerHasOpenSaysSo) {
  const std::filesystem::path folder = FreshFolder();
  MakeReadableDatabase(folder / "db");
  // As LMDB registers that process.
  const int file = open((folder / "db/lock.mdb").c_str(), O_RDWR | O_CLOEXEC);
  struct flock other {};
  other.l_type = F_WRLCK;
  other.l_whence = SEEK_SET;
  other.l_start = getpid();
  other.l_len = 1;
  ASSERT_EQ(fcntl(file, F_OFD_SETLK, &other), 0) << strerror(errno);
  const absl::Status status = Database::Open(folder / "db", Access::kRead).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("in another container has it open"));
  EXPECT_THAT(status.message(), HasSubstr("--pid=host"));
  close(file);
  EXPECT_TRUE(CanBeRead(folder / "db"));
}

// The folder `db` in `folder` as a read-only file system shows it; ends with the test.
class ReadOnlyDatabase : public testing::Test {
 protected:
  void SetUp() override {
    MakeReadableDatabase(folder_ / "db");
    std::filesystem::create_directories(mounted_);
    if (mount(folder_.c_str(), mounted_.c_str(), nullptr, MS_BIND, nullptr) != 0) {
      GTEST_SKIP() << "a folder cannot be mounted here: " << strerror(errno);
    }
    is_mounted_ = true;
    ASSERT_EQ(mount(nullptr, mounted_.c_str(), nullptr, MS_BIND | MS_REMOUNT | MS_RDONLY, nullptr),
              0);
  }
  void TearDown() override {
    if (is_mounted_) {
      EXPECT_EQ(umount2(mounted_.c_str(), MNT_DETACH), 0);
    }
  }

  const std::filesystem::path folder_ = FreshFolder();
  const std::string mounted_ = folder_ / "mounted";

 private:
  bool is_mounted_ = false;
};

TEST_F(ReadOnlyDatabase, CanBeRead) {
  EXPECT_TRUE(CanBeRead(mounted_ + "/db"));
  EXPECT_TRUE(CannotBeWritten(mounted_ + "/db"));
  const absl::Status status = Database::Create(mounted_ + "/new", TestCell()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
  EXPECT_THAT(status.message(), HasSubstr("cannot be made"));
}

TEST_F(ReadOnlyDatabase, WithoutALockFileCanBeReadAndKeepsWritersOut) {
  std::filesystem::remove(folder_ / "db/lock.mdb");
  const auto reader = Database::Open(mounted_ + "/db", Access::kRead);
  ASSERT_TRUE(reader.ok()) << reader.status();
  EXPECT_EQ((*reader)->Read()->size(), 1);
  EXPECT_TRUE(absl::IsFailedPrecondition(WriterLock::Take(folder_ / "db").status()));
}

// No lock file is shared there, and each of the two keeps writers out.
TEST_F(ReadOnlyDatabase, ThatIsReplacedIsReadBesideTheEarlierOne) {
  MakeDatabase(TestCell(), folder_ / "other").reset();
  const auto earlier = Database::Open(mounted_ + "/db", Access::kRead);
  ASSERT_TRUE(earlier.ok()) << earlier.status();
  std::filesystem::rename(folder_ / "other/data.mdb", folder_ / "db/data.mdb");
  const auto other = Database::Open(mounted_ + "/db", Access::kRead);
  ASSERT_TRUE(other.ok()) << other.status();
  EXPECT_EQ((*earlier)->Read()->size(), 1);
  EXPECT_EQ((*other)->Read()->size(), 0);
}

}  // namespace
}  // namespace silhouette
