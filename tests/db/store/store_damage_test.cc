// SPDX-License-Identifier: Apache-2.0
// Truncated, damaged and foreign files.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lmdb.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iostream>
#include <thread>

#include "db/store/environment.h"
#include "db/store/robot_image_format.h"
#include "db/store/schema.h"
#include "db/store/store.h"
#include "tests/db/store/test_database.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

// A database with a record for every configuration, in several changes.
void MakeFullDatabase(const std::string& path) {
  const auto database = MakeDatabase(TestCell(), path);
  auto writer = database->Write("test", absl::Hours(1));
  for (ConfigurationNumber number : AllNumbers(database->grid())) {
    ASSERT_TRUE(writer->Put(TestImage(*database, number)).ok());
    if (number % 50 == 0) {
      ASSERT_TRUE(writer->Commit().ok());
    }
  }
  ASSERT_TRUE(writer->Commit().ok());
}

// An environment of LMDB's with one sub-database and one entry in it.
void MakeLmdb(const std::string& path, const char* name, const std::string& key,
              const std::string& value) {
  std::filesystem::create_directories(path);
  MDB_env* environment = nullptr;
  MDB_txn* transaction = nullptr;
  MDB_dbi database = 0;
  ASSERT_EQ(mdb_env_create(&environment), 0);
  ASSERT_EQ(mdb_env_set_maxdbs(environment, 4), 0);
  ASSERT_EQ(mdb_env_open(environment, path.c_str(), 0, 0664), 0);
  ASSERT_EQ(mdb_txn_begin(environment, nullptr, 0, &transaction), 0);
  ASSERT_EQ(mdb_dbi_open(transaction, name, MDB_CREATE, &database), 0);
  MDB_val key_val = ToVal(key);
  MDB_val value_val = ToVal(value);
  ASSERT_EQ(mdb_put(transaction, database, &key_val, &value_val, 0), 0);
  ASSERT_EQ(mdb_txn_commit(transaction), 0);
  mdb_env_close(environment);
}

TEST(Database, TruncatedAnywhereIsRefusedOrWhole) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  const std::string bytes = ReadFile(folder / "db/data.mdb");
  Random random;
  std::vector<size_t> lengths = {0, 1, 15, 63, 64, 4095, 4096, 4200, 8191, 8192, bytes.size() - 1};
  for (int i = 0; i < 100; ++i) lengths.push_back(random() % bytes.size());
  int refused = 0;
  for (size_t length : lengths) {
    SCOPED_TRACE(length);
    std::filesystem::create_directories(folder / "cut");
    WriteFile(folder / "cut/data.mdb", bytes.substr(0, length));
    const auto database = Database::Open(folder / "cut", Access::kRead);
    if (!database.ok()) {
      ++refused;
      EXPECT_THAT(database.status().message(), HasSubstr((folder / "cut").string()));
      EXPECT_TRUE(absl::IsDataLoss(database.status()) || length < 64) << database.status();
    } else {
      const auto visit = [&](ConfigurationNumber number, absl::StatusOr<RobotImage> image) {
        EXPECT_EQ(*image, TestImage(**database, number));
        return true;
      };
      EXPECT_TRUE((*database)->Read()->ForEach(visit).ok());
      EXPECT_EQ((*database)->Read()->size(), (*database)->grid().size());
    }
    std::filesystem::remove_all(folder / "cut");
  }
  // Some cuts lose only pages that the newest state does not use.
  EXPECT_GT(refused, static_cast<int>(lengths.size()) / 2);
}

TEST(Database, WithADamagedRecordLosesOnlyThatRecord) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  std::string bytes = ReadFile(folder / "db/data.mdb");
  // A record with masks, found by its bytes, in the pages of earlier states too.
  ConfigurationNumber victim = 0;
  std::vector<size_t> places;
  {
    const auto database = Database::Open(folder / "db", Access::kRead);
    RobotImage image;
    do {
      image = TestImage(**database, ++victim);
    } while (image.excluded);
    const std::string value = EncodeRobotImage(image);
    for (size_t at = bytes.find(value); at != std::string::npos; at = bytes.find(value, at + 1)) {
      places.push_back(at);
    }
  }
  ASSERT_FALSE(places.empty());
  const auto flip = [&](size_t offset) {
    for (size_t at : places) bytes[at + offset] = static_cast<char>(bytes[at + offset] ^ 4);
  };
  for (size_t offset : {0, 8, 20, 70}) {
    flip(offset);
    WriteFile(folder / "db/data.mdb", bytes);
    const auto database = Database::Open(folder / "db", Access::kRead);
    ASSERT_TRUE(database.ok()) << database.status();
    const auto snapshot = (*database)->Read();
    EXPECT_EQ(snapshot->Find(victim).status().code(), absl::StatusCode::kDataLoss);
    EXPECT_TRUE(*snapshot->Contains(victim));
    int damaged = 0;
    const auto visit = [&](ConfigurationNumber number, absl::StatusOr<RobotImage> image) {
      if (!image.ok()) {
        EXPECT_EQ(number, victim);
        EXPECT_EQ(image.status().code(), absl::StatusCode::kDataLoss);
        ++damaged;
      } else {
        EXPECT_EQ(*image, TestImage(**database, number));
      }
      return true;
    };
    EXPECT_TRUE(snapshot->ForEach(visit).ok());
    EXPECT_EQ(damaged, 1);
    flip(offset);
  }
}

// Whatever happens to the file: what is read is right, or it is an error, and the process lives.
TEST(Database, WithFlippedBitsAnywhereNeverGivesWrongRecords) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  const std::string sound = ReadFile(folder / "db/data.mdb");
  Random random;
  int refused = 0;
  int lost = 0;
  std::filesystem::create_directories(folder / "spoilt");
  for (int round = 0; round < 250; ++round) {
    WriteFile(folder / "spoilt/data.mdb", WithFlippedBits(sound, random));
    const auto database = Database::Open(folder / "spoilt", Access::kRead);
    if (!database.ok()) {
      ++refused;
      continue;
    }
    const auto snapshot = (*database)->Read();
    if (!snapshot.ok()) continue;
    const auto visit = [&](ConfigurationNumber number, absl::StatusOr<RobotImage> image) {
      if (image.ok()) {
        EXPECT_EQ(*image, TestImage(**database, number));
      } else {
        ++lost;
      }
      return true;
    };
    (void)snapshot->ForEach(visit);
    for (ConfigurationNumber number = 0; number < 50; ++number) {
      const auto found = snapshot->Find(number);
      if (found.ok() && *found) {
        EXPECT_EQ(**found, TestImage(**database, number));
      }
    }
  }
  std::cout << refused << " refused, " << lost << " records lost" << std::endl;
  EXPECT_GT(refused, 50);
  EXPECT_GT(lost, 20);
}

TEST(Database, WithADamagedPageIsRefusedByName) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  std::string bytes = ReadFile(folder / "db/data.mdb");
  for (size_t page = 2 * 4096; page < bytes.size(); page += 4096) bytes[page] ^= 1;  // its number
  WriteFile(folder / "db/data.mdb", bytes);
  const absl::Status status = Database::Open(folder / "db", Access::kRead).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(status.message(), HasSubstr("data.mdb' is damaged: page "));
  EXPECT_THAT(status.message(), HasSubstr("restore it from a copy"));
}

// Opens a database whose file has `bytes`; what can be read of it is right. Whether it opens.
bool OpensRightly(const std::string& folder, const RobotImage& first) {
  const auto database = Database::Open(folder, Access::kRead);
  if (!database.ok()) {
    EXPECT_THAT(std::string(database.status().message()), HasSubstr(folder));
    return false;
  }
  const auto snapshot = (*database)->Read();
  if (!snapshot.ok()) return false;
  const auto found = snapshot->Find(first.number);
  if (found.ok() && *found) {
    EXPECT_EQ(**found, first);
  }
  return true;
}

// LMDB believes its meta pages: a wrong page size or page number there ended the process.
TEST(Database, WithAnyBitFlippedInItsMetaPagesIsRefusedOrRight) {
  constexpr size_t kPage = 4096;
  constexpr size_t kMeta = 152;  // the head of a meta page and what it says
  const std::filesystem::path folder = FreshFolder();
  RobotImage first;
  {
    const auto database = MakeDatabase(TestCell(6, 5), folder / "db");
    for (const ConfigurationNumber number : {0, 1}) {
      PutAll(*database, {TestImage(*database, number)});
    }
    first = TestImage(*database, 0);
  }
  std::fstream file(folder / "db/data.mdb", std::ios::in | std::ios::out | std::ios::binary);
  const std::string sound = ReadFile(folder / "db/data.mdb");
  const auto opens_with = [&](size_t at, char byte) {
    const auto write = [&](char written) {
      file.seekp(static_cast<std::streamoff>(at)).put(written).flush();
    };
    write(byte);
    const bool opens = OpensRightly(folder / "db", first);
    write(sound[at]);
    return opens;
  };
  int refused = 0;
  // With a sanitizer some bytes only.
  const size_t step = SampleCount(10) < 10 ? 7 : 1;
  for (size_t at = 0; at < 2 * kPage; at += step) {
    SCOPED_TRACE(at);
    const bool meta = at % kPage < kMeta;
    for (int bit = 0; bit < (meta ? 8 : 1); ++bit) {
      const bool opens = opens_with(at, static_cast<char>(sound[at] ^ (meta ? 1 << bit : 0xff)));
      if (!opens) ++refused;
      EXPECT_TRUE(opens || meta);  // the rest of the pages has no meaning
    }
  }
  EXPECT_GT(refused, SampleCount(1000));
  EXPECT_TRUE(opens_with(0, sound[0]));
}

TEST(Database, OpenedAgainWhileItIsInUseHasItsPagesCheckedAgain) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  const auto in_use = Database::Open(folder / "db", Access::kRead);
  ASSERT_TRUE(in_use.ok());
  EXPECT_TRUE(Database::Open(folder / "db", Access::kRead).ok());
  std::fstream file(folder / "db/data.mdb", std::ios::in | std::ios::out | std::ios::binary);
  for (std::streamoff page = 2; page < 8; ++page) file.seekp(page * 4096).put('x');  // its number
  file.flush();
  EXPECT_EQ(Database::Open(folder / "db", Access::kRead).status().code(),
            absl::StatusCode::kDataLoss);
}

// LMDB does not look at the meta pages of a file that is in use.
TEST(Database, OpenedAgainWhileItIsInUseHasEachValueOfItsMetaPagesChecked) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  const auto in_use = Database::Open(folder / "db", Access::kRead);
  ASSERT_TRUE(in_use.ok());
  const std::string sound = ReadFile(folder / "db/data.mdb");
  std::fstream file(folder / "db/data.mdb", std::ios::in | std::ios::out | std::ios::binary);
  const auto said_with = [&](size_t at, const auto& value) {
    const auto place = static_cast<std::streamoff>(at);
    file.seekp(place).write(reinterpret_cast<const char*>(&value), sizeof(value)).flush();
    const absl::Status status = Database::Open(folder / "db", Access::kRead).status();
    file.seekp(place).write(sound.data() + at, sizeof(value)).flush();
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    return std::string(status.message());
  };
  const auto transaction_of = [&](size_t page) {
    uint64_t transaction = 0;
    std::memcpy(&transaction, sound.data() + page + 144, sizeof(transaction));
    return transaction;
  };
  for (const size_t page : {0, 4096}) {
    SCOPED_TRACE(page);
    const uint64_t transaction = transaction_of(page);
    EXPECT_THAT(said_with(page, uint64_t{7}), HasSubstr("its page number is 7"));
    EXPECT_THAT(said_with(page + 10, uint16_t{2}), HasSubstr("its page flags are 2"));
    if (page > 0) {
      EXPECT_THAT(said_with(page + 16, uint32_t{0}), HasSubstr("does not begin as a meta page"));
    }
    EXPECT_THAT(said_with(page + 20, uint32_t{2}), HasSubstr("its data version is 2"));
    EXPECT_THAT(said_with(page + 32, ~uint64_t{0}), HasSubstr("its map has"));
    EXPECT_THAT(said_with(page + 40, uint32_t{0}), HasSubstr("its page size is 0"));
    EXPECT_THAT(said_with(page + 44, uint16_t{0}), HasSubstr("the flags of its trees"));
    EXPECT_THAT(said_with(page + 88, uint32_t{1}), HasSubstr("the flags of its trees"));
    EXPECT_THAT(said_with(page + 92, uint16_t{4}), HasSubstr("the flags of its trees"));
    for (const size_t root : {80, 128}) {
      if (transaction < transaction_of(4096 - page)) continue;
      EXPECT_THAT(said_with(page + root, uint64_t{1}), HasSubstr("a tree begins at page 1"));
      EXPECT_THAT(said_with(page + root, uint64_t{1} << 40), HasSubstr("a tree begins at page"));
    }
    EXPECT_THAT(said_with(page + 136, uint64_t{0}), HasSubstr("its last page is 0"));
    EXPECT_THAT(said_with(page + 136, uint64_t{1} << 40), HasSubstr("beyond its map"));
    EXPECT_THAT(said_with(page + 144, transaction + 1), HasSubstr("does not write it"));
    EXPECT_THAT(said_with(page + 144, transaction + 4), HasSubstr("are of transactions"));
  }
  EXPECT_TRUE(Database::Open(folder / "db", Access::kRead).ok());
}

// LMDB writes the old transaction back into a meta page that it could not write, beside new trees.
TEST(Database, WithNewTreesInItsOlderMetaPageIsWhole) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  const std::string sound = ReadFile(folder / "db/data.mdb");
  std::array<uint64_t, 2> transactions{};
  for (const size_t page : {0, 1}) {
    std::memcpy(&transactions[page], sound.data() + page * 4096 + 144, sizeof(uint64_t));
  }
  const size_t older = transactions[0] < transactions[1] ? 0 : 4096;
  const uint64_t beyond = sound.size() / 4096 + 5;
  std::fstream(folder / "db/data.mdb", std::ios::in | std::ios::out | std::ios::binary)
      .seekp(static_cast<std::streamoff>(older + 128))
      .write(reinterpret_cast<const char*>(&beyond), sizeof(beyond));
  const auto database = Database::Open(folder / "db", Access::kWrite);
  ASSERT_TRUE(database.ok()) << database.status();
  EXPECT_TRUE((*database)->SetCaptureHistory({}).ok()) << "the next change mends the page";
}

TEST(Database, MetaPagesThatAreWrittenWhileTheyAreReadAreNoFault) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  const std::string path = folder / "db/data.mdb";
  std::atomic<bool> written = false;
  const std::jthread writer([&] {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    for (uint64_t transaction = 1000; transaction < 300'000; ++transaction) {
      file.seekp(static_cast<std::streamoff>(transaction % 2 * 4096 + 144));
      file.write(reinterpret_cast<const char*>(&transaction), sizeof(transaction)).flush();
    }
    written = true;
  });
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  while (!written) ASSERT_TRUE(CheckMetaPages(file, path).ok());
  close(file);
}

TEST(Database, MetaPageThatIsOverwrittenWhileItsPagesAreCheckedIsNoFault) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  const std::string path = folder / "db/data.mdb";
  const auto transaction_in = [](const std::string& bytes, size_t page) {
    uint64_t transaction = 0;
    std::memcpy(&transaction, bytes.data() + page * 4096 + 144, sizeof(transaction));
    return transaction;
  };
  std::string before;
  {
    const auto database = Database::Open(folder / "db", Access::kWrite);
    for (uint64_t seed = 1; seed < 6; ++seed) {  // many free pages
      std::vector<RobotImage> images;
      for (const ConfigurationNumber number : AllNumbers((*database)->grid())) {
        images.push_back(TestImage(**database, number, seed));
      }
      PutAll(**database, images, true);
    }
    const auto kept = (*database)->Read();  // no page of this state is used again
    before = ReadFile(path);
    for (int i = 0; i < 2; ++i) ASSERT_TRUE((*database)->SetCaptureHistory({}).ok());
  }
  const std::string after = ReadFile(path);
  const size_t page = transaction_in(before, 0) > transaction_in(before, 1) ? 0 : 1;
  const uint64_t transaction = transaction_in(before, page);
  ASSERT_EQ(transaction_in(after, page), transaction + 2);
  const int file = open(path.c_str(), O_RDWR | O_CLOEXEC);
  const auto put_meta = [&](const std::string& bytes) {
    const auto at = static_cast<off_t>(page * 4096);
    EXPECT_EQ(pwrite(file, bytes.data() + at, 4096, at), 4096);
  };
  int sound = 0;
  for (int round = 0; round < 1000; ++round) {
    put_meta(before);
    std::atomic<bool> ready = false;
    std::atomic<bool> begun = false;
    std::jthread writer([&] {
      ready = true;
      while (!begun) std::this_thread::yield();
      const auto until = std::chrono::steady_clock::now() + std::chrono::microseconds(round % 100);
      while (std::chrono::steady_clock::now() < until) continue;
      put_meta(after);
    });
    while (!ready) std::this_thread::yield();
    begun = true;
    const absl::Status status = CheckPages(file, path, transaction);
    writer.join();
    sound += status.ok() ? 1 : 0;
    ASSERT_TRUE(status.ok() || absl::IsUnavailable(status)) << round << ": " << status;
  }
  close(file);
  EXPECT_GT(sound, 0);
}

TEST(Database, WithADamagedDescriptionIsRefused) {
  const std::filesystem::path folder = FreshFolder();
  MakeFullDatabase(folder / "db");
  std::string bytes = ReadFile(folder / "db/data.mdb");
  for (size_t place = bytes.find("axis_1"); place != std::string::npos;
       place = bytes.find("axis_1", place + 1)) {
    bytes[place] = 'b';
  }
  WriteFile(folder / "db/data.mdb", bytes);
  const absl::Status status = Database::Open(folder / "db", Access::kRead).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << status;
  EXPECT_THAT(status.message(), HasSubstr("its entry 'cell' is damaged"));
}

TEST(Database, OfAnotherFormatVersionIsRefusedAndLeftAlone) {
  const std::filesystem::path folder = FreshFolder();
  MakeLmdb(folder / "db", schema::kMeta, "format", "silhouette 2");
  for (Access access : {Access::kRead, Access::kWrite}) {
    const absl::Status status = Database::Open(folder / "db", access).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_THAT(status.message(), HasSubstr("has format version 2, this program knows version 1"));
  }
  EXPECT_EQ(Database::Create(folder / "db", TestCell()).status().code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST(Database, OfAnotherProgramIsRefusedAndLeftAlone) {
  const std::filesystem::path folder = FreshFolder();
  MakeLmdb(folder / "named", "something", "key", "value");
  MakeLmdb(folder / "meta", schema::kMeta, "key", "value");
  MakeLmdb(folder / "plain", nullptr, "meta", "value");
  for (const char* name : {"named", "meta", "plain"}) {
    const std::string before = ReadFile(folder / name / "data.mdb");
    const absl::Status status = Database::Open(folder / name, Access::kWrite).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
    EXPECT_THAT(status.message(), HasSubstr("is an LMDB database, but not one of Silhouette's"));
    EXPECT_FALSE(Database::Create(folder / name, TestCell()).ok());
    EXPECT_EQ(ReadFile(folder / name / "data.mdb"), before);
  }
}

TEST(Database, OfNoKindAtAllIsRefused) {
  const std::filesystem::path folder = FreshFolder();
  std::filesystem::create_directories(folder / "db");
  WriteFile(folder / "db/data.mdb", std::string(20'000, 'x'));
  const absl::Status status = Database::Open(folder / "db", Access::kRead).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
  EXPECT_THAT(status.message(), HasSubstr("is not a database"));
  WriteFile(folder / "file", "x");
  EXPECT_EQ(Database::Open(folder / "file", Access::kRead).status().code(),
            absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace silhouette
