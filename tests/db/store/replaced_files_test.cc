// SPDX-License-Identifier: Apache-2.0
// Files of a database that are replaced while this process has it open. Two LMDB environments of a
// process on one lock file would clear each other's readers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "db/store/store.h"
#include "tests/db/store/test_database.h"

namespace silhouette {
namespace {

// A database with two records that is open, and a closed one with one record.
class ReplacedFiles : public testing::Test {
 protected:
  void SetUp() override {
    open_ = MakeDatabase(TestCell(), path_);
    PutAll(*open_, {TestImage(*open_, 1), TestImage(*open_, 2)});
    const auto other = MakeDatabase(TestCell(), other_);
    PutAll(*other, {TestImage(*other, 1)});
  }

  // Expects that it cannot be opened because of `file`, and that what is open can still be read.
  void ExpectRefusedFor(const std::string& file) const {
    for (const Access access : {Access::kRead, Access::kWrite}) {
      const absl::Status status = Database::Open(path_, access).status();
      EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
      EXPECT_EQ(status.message(), "'" + path_ + "/" + file +
                                      "' is no longer the file that this program has open; replace "
                                      "the whole folder instead of a file in it, or start the "
                                      "program again");
    }
    EXPECT_EQ(ContentOf(*open_).size(), 2);
  }

  static uint64_t RecordsIn(const std::string& path) {
    const auto database = Database::Open(path, Access::kRead);
    EXPECT_TRUE(database.ok()) << database.status();
    return database.ok() ? ContentOf(**database).size() : 0;
  }

  const std::filesystem::path folder_ = FreshFolder();
  const std::string path_ = folder_ / "db";
  const std::string other_ = folder_ / "other";
  std::unique_ptr<Database> open_;
};

TEST_F(ReplacedFiles, DataFileIsRefusedAsLongAsTheEarlierOneIsOpen) {
  std::filesystem::rename(other_ + "/data.mdb", path_ + "/data.mdb");
  ExpectRefusedFor("data.mdb");
  open_.reset();
  EXPECT_EQ(RecordsIn(path_), 1);
}

TEST_F(ReplacedFiles, DataFileIsRefusedAsLongAsASnapshotOfTheEarlierOneIsHeld) {
  auto snapshot = std::make_unique<Snapshot>(*open_->Read());
  open_.reset();
  std::filesystem::rename(other_ + "/data.mdb", path_ + "/data.mdb");
  EXPECT_TRUE(absl::IsFailedPrecondition(Database::Open(path_, Access::kRead).status()));
  EXPECT_EQ(snapshot->size(), 2);
  snapshot.reset();
  EXPECT_EQ(RecordsIn(path_), 1);
}

TEST_F(ReplacedFiles, LockFileIsRefusedAsLongAsTheEarlierOneIsOpen) {
  std::filesystem::remove(path_ + "/lock.mdb");
  ExpectRefusedFor("lock.mdb");
  std::filesystem::rename(other_ + "/lock.mdb", path_ + "/lock.mdb");
  ExpectRefusedFor("lock.mdb");
  open_.reset();
  EXPECT_EQ(RecordsIn(path_), 2);
}

TEST_F(ReplacedFiles, DataFileOfAnotherOpenDatabaseIsRefused) {
  const auto other = Database::Open(other_, Access::kRead);
  ASSERT_TRUE(other.ok()) << other.status();
  std::filesystem::rename(other_ + "/data.mdb", path_ + "/data.mdb");
  EXPECT_TRUE(absl::IsFailedPrecondition(Database::Open(path_, Access::kRead).status()));
  EXPECT_EQ(ContentOf(*open_).size(), 2);
  EXPECT_EQ(ContentOf(**other).size(), 1);
}

TEST_F(ReplacedFiles, WholeFolderIsOpenedBesideTheEarlierOne) {
  std::filesystem::rename(path_, folder_ / "away");
  std::filesystem::rename(other_, path_);
  const auto database = Database::Open(path_, Access::kRead);
  ASSERT_TRUE(database.ok()) << database.status();
  EXPECT_EQ(ContentOf(*open_).size(), 2);
  EXPECT_EQ(ContentOf(**database).size(), 1);
  EXPECT_EQ(RecordsIn(folder_ / "away"), 2);
}

TEST_F(ReplacedFiles, FolderWithoutALockFileTakesThePlaceOfOneThatIsOpen) {
  std::filesystem::remove(other_ + "/lock.mdb");
  std::filesystem::rename(path_, folder_ / "away");
  std::filesystem::rename(other_, path_);
  EXPECT_EQ(RecordsIn(path_), 1);
  EXPECT_EQ(ContentOf(*open_).size(), 2);
}

TEST_F(ReplacedFiles, ForkedChildOpensWhatItsParentHasOpen) {
  const pid_t child = fork();
  if (child == 0) _exit(RecordsIn(path_) == 2 ? 0 : 1);
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  EXPECT_EQ(ContentOf(*open_).size(), 2);
}

}  // namespace
}  // namespace silhouette
