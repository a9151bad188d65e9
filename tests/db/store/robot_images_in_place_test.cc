// SPDX-License-Identifier: Apache-2.0
#include "db/store/robot_images_in_place.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <thread>

#include "db/store/environment.h"
#include "tests/db/store/test_database.h"
#include "tests/random.h"

namespace silhouette {
namespace {

// Two views; with `large`, of so many pixels that most records need pages of their own.
storage::v1::CellDescription Cell(bool large) {
  storage::v1::CellDescription cell = TestCell();
  if (!large) return cell;
  cell.mutable_views(0)->set_mask_width(320);
  cell.mutable_views(0)->set_mask_height(240);
  return cell;
}

std::unique_ptr<Database> MakeLargeOrSmall(bool large = false) {
  auto database = MakeDatabase(Cell(large));
  std::vector<RobotImage> images;
  for (const ConfigurationNumber number : AllNumbers(database->grid())) {
    if (number % 7 != 0) images.push_back(TestImage(*database, number));
  }
  PutAll(*database, images);
  return database;
}

std::vector<uint64_t> WordsOf(const RobotImage& image) {
  std::vector<uint64_t> words;
  for (const Mask& mask : image.masks) {
    words.insert(words.end(), mask.words().begin(), mask.words().end());
  }
  return words;
}

size_t RoomFor(const Database& database) {
  size_t words = 0;
  for (const MaskSize size : database.mask_sizes()) words += size.words();
  return words;
}

std::shared_ptr<const RobotImagesInPlace> OpenImages(const Database& database) {
  auto images = RobotImagesInPlace::Open(std::make_shared<const Snapshot>(*database.Read()),
                                         [](const MetRecord&) {});
  EXPECT_TRUE(images.ok()) << images.status();
  return *std::move(images);
}

void ExpectReads(const RobotImagesInPlace& images, const ConfigurationGrid& grid, size_t room,
                 const Content& records) {
  std::vector<uint64_t> words(room);
  for (ConfigurationNumber number = 0; number < grid.number_limit() + kTileSize; ++number) {
    const auto found = records.find(number);
    const bool there = found != records.end() && !found->second.excluded;
    ASSERT_EQ(images.Read(number, words), there) << number;
    if (there) {
      ASSERT_EQ(words, WordsOf(found->second)) << number;
    }
  }
}

class RobotImagesOfSize : public ::testing::TestWithParam<bool> {};

TEST_P(RobotImagesOfSize, AreReadAsTheyAreStored) {
  const auto database = MakeLargeOrSmall(GetParam());
  const Content records = ContentOf(*database);
  ExpectReads(*OpenImages(*database), database->grid(), RoomFor(*database), records);
}

TEST_P(RobotImagesOfSize, AreMetOnceInTheirOrder) {
  const auto database = MakeLargeOrSmall(GetParam());
  const Content records = ContentOf(*database);
  std::vector<ConfigurationNumber> expected;
  for (const auto& [number, image] : records) expected.push_back(number);
  const auto snapshot = std::make_shared<const Snapshot>(*database->Read());
  std::vector<ConfigurationNumber> met;
  const VisitRecord visit = [&](const MetRecord& record) {
    met.push_back(record.number);
    const RobotImage& image = records.at(record.number);
    ASSERT_EQ(record.masks, image.excluded ? StoredMasks::kExcluded : StoredMasks::kPresent);
    if (image.excluded) return;
    ASSERT_EQ(std::vector(record.words.begin(), record.words.end()), WordsOf(image));
  };
  ASSERT_TRUE(RobotImagesInPlace::Open(snapshot, visit).ok());
  EXPECT_EQ(met, expected);
  met.clear();
  ASSERT_TRUE(ForEachMasks(*snapshot, visit).ok());
  EXPECT_EQ(met, expected);
}

INSTANTIATE_TEST_SUITE_P(Content, RobotImagesOfSize, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "Large" : "Small"; });

TEST(RobotImagesInPlace, StayThoseOfTheirStateForManyThreadsWhileTheMapGrows) {
  auto database = MakeLargeOrSmall();
  const Content records = ContentOf(*database);
  const auto images = OpenImages(*database);
  const size_t room = RoomFor(*database);
  const size_t before = MapSize(*database);
  std::atomic<bool> done = false;
  std::vector<std::jthread> readers;
  for (int i = 0; i < 3; ++i) {
    readers.emplace_back([&] {
      do {
        ASSERT_NO_FATAL_FAILURE(ExpectReads(*images, database->grid(), room, records));
      } while (!done);
    });
  }
  for (uint64_t round = 1; MapSize(*database) == before; ++round) {
    ASSERT_LT(round, 20);
    for (const auto& [number, image] : records) {
      if (number % 20 == 0) PutAll(*database, {TestImage(*database, number, round)}, true);
    }
    PutMuch(*database);
  }
  done = true;
  readers.clear();
  // And without the database.
  const ConfigurationGrid grid = database->grid();
  database.reset();
  ExpectReads(*images, grid, room, records);
}

struct DamagedUnderTheReader : ::testing::Test {
  std::unique_ptr<Database> database = MakeLargeOrSmall();
  const Content records = ContentOf(*database);
  const std::shared_ptr<const RobotImagesInPlace> images = OpenImages(*database);
  const std::string file = database->path() + "/data.mdb";

  // How many records can still be read; all of these are as they were.
  size_t Readable() {
    size_t readable = 0;
    std::vector<uint64_t> words(RoomFor(*database));
    for (const auto& [number, image] : records) {
      if (!images->Read(number, words)) continue;
      EXPECT_EQ(words, WordsOf(image)) << number;
      ++readable;
    }
    return readable;
  }
};

TEST_F(DamagedUnderTheReader, RecordIsNotReadOrAsItWas) {
  const size_t all = Readable();
  Random random;
  std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
  bytes.seekg(0, std::ios::end);
  const auto size = static_cast<uint64_t>(bytes.tellg());
  for (int i = 0; i < 300; ++i) {
    const auto place = static_cast<std::streamoff>(random() % size);
    bytes.seekg(place);
    const int byte = bytes.get();
    bytes.seekp(place);
    bytes.put(static_cast<char>(byte ^ (1 << random() % 8)));
  }
  bytes.close();
  EXPECT_LT(Readable(), all);
  EXPECT_GT(Readable(), 0u);
}

TEST_F(DamagedUnderTheReader, FileCutShortEndsNoProcess) {
  const size_t all = Readable();
  const auto size = std::filesystem::file_size(file);
  ASSERT_EQ(truncate(file.c_str(), static_cast<off_t>(size / 2)), 0);
  EXPECT_LT(Readable(), all);
  ASSERT_EQ(truncate(file.c_str(), 0), 0);
  EXPECT_EQ(Readable(), 0u);
  ASSERT_EQ(truncate(file.c_str(), static_cast<off_t>(size)), 0);  // for those who close it
}

}  // namespace
}  // namespace silhouette
