// SPDX-License-Identifier: Apache-2.0
// Databases of the test cell and what is in them, for the tests of db/store.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "db/store/environment.h"
#include "tests/db/store/test_cell.h"
#include "tests/test_folder.h"

namespace silhouette {

using Access = Database::Access;
// The name of a further variant.
inline constexpr char kTool[] = "gripper-open";

using Content = std::map<ConfigurationNumber, RobotImage>;

// In a new folder, unless `path` says another.
inline std::unique_ptr<Database> MakeDatabase(const storage::v1::CellDescription& cell = TestCell(),
                                              const std::string& path = FreshFolder() / "db") {
  auto database = Database::Create(path, cell);
  EXPECT_TRUE(database.ok()) << database.status();
  return *std::move(database);
}

// Puts the records into the database in one change.
inline void PutAll(Database& database, const std::vector<RobotImage>& images,
                   bool replace = false) {
  auto writer = database.Write("test", absl::Hours(1));
  ASSERT_TRUE(writer.ok()) << writer.status();
  for (const RobotImage& image : images) ASSERT_TRUE(writer->Put(image, replace).ok());
  ASSERT_TRUE(writer->Commit().ok());
}

// With the test image of every `every`-th configuration of a grid of several tiles.
inline std::unique_ptr<Database> MakeFilledDatabase(
    uint64_t every = 5, const storage::v1::CellDescription& cell = TestCell(100, 140),
    const std::string& path = FreshFolder() / "db") {
  auto database = MakeDatabase(cell, path);
  std::vector<RobotImage> images;
  for (const ConfigurationNumber number : AllNumbers(database->grid())) {
    if (number % every == 0) images.push_back(TestImage(*database, number));
  }
  PutAll(*database, images);
  return database;
}

// All records; expects that they can be read.
inline Content ContentOf(const Database& database) {
  Content content;
  const auto visit = [&](ConfigurationNumber number, absl::StatusOr<RobotImage> image) {
    EXPECT_TRUE(image.ok()) << image.status();
    if (image.ok()) content[number] = *std::move(image);
    return true;
  };
  EXPECT_TRUE(database.Read()->ForEach(visit).ok());
  return content;
}

// How much of the file the process has mapped, and what soon needs more.
inline size_t MapSize(const Database& database) {
  MDB_envinfo info;
  mdb_env_info((*Environment::Open(database.path()))->get(), &info);
  return info.me_mapsize;
}
inline void PutMuch(Database& database) {
  storage::v1::References references;
  references.add_views();
  references.add_views()->set_mean_png(std::string(size_t{30} << 20, 'x'));
  ASSERT_TRUE(database.SetReferences(references, "test").ok());
}

inline std::string ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Flips one to four bits of a data file, half of them where pages and entries have their heads.
inline std::string WithFlippedBits(std::string bytes, std::mt19937_64& random) {
  for (int flips = 1 + static_cast<int>(random() % 4); flips > 0; --flips) {
    size_t place = random() % bytes.size();
    if (random() % 2 == 0) place = place / 4096 * 4096 + random() % 64;
    bytes[place] = static_cast<char>(bytes[place] ^ (1 << random() % 8));
  }
  return bytes;
}

}  // namespace silhouette
