// SPDX-License-Identifier: Apache-2.0
// Shards of a drawing, and what merge makes of them.
#include "db/store/shards.h"

#include <gmock/gmock.h>
#include <lmdb.h>

#include <filesystem>
#include <fstream>

#include "db/store/collision_index.h"
#include "db/store/tile_value.h"
#include "tests/db/store/raw_values.h"
#include "tests/db/store/test_cell.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;

storage::v1::DrawnImages DrawnOf(uint32_t shard, uint32_t shards) {
  storage::v1::DrawnImages drawn;
  drawn.set_digest("00ff");
  drawn.set_tolerance(0.005);
  drawn.set_shard(shard);
  drawn.set_shards(shards);
  return drawn;
}

RobotImage DrawnImage(const Database& database, ConfigurationNumber number, uint64_t seed = 0) {
  RobotImage image = TestImage(database, number, seed);
  image.captured = absl::UnixEpoch();
  image.commanded.clear();
  image.measured.clear();
  return image;
}

storage::v1::Calibration SomeCalibration() {
  storage::v1::Calibration calibration;
  for (int i = 0; i < 2; ++i) {
    storage::v1::CameraModel& camera = *calibration.add_cameras();
    camera.set_image_width(640);
    camera.set_image_height(480);
    for (const auto set : {&storage::v1::CameraModel::set_fx, &storage::v1::CameraModel::set_fy,
                           &storage::v1::CameraModel::set_cx, &storage::v1::CameraModel::set_cy}) {
      (camera.*set)(300);
    }
    for (int k = 0; k < 3; ++k) {
      camera.add_rotation(0.1 * k);
      camera.add_translation(k + i);
    }
  }
  return calibration;
}

// 100 x 170 configurations, some of them in tiles that are not full.
class ShardsTest : public testing::Test {
 protected:
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  // Draws what a shard has, but for `omitted`, and its index. The default variant.
  std::string Draw(const storage::v1::DrawnImages& drawn, const std::string& name,
                   std::optional<ConfigurationNumber> omitted = std::nullopt, bool index = true,
                   std::optional<ConfigurationNumber> added = std::nullopt) const {
    const auto database = Database::Create(Path(name), TestCell(100, 170));
    EXPECT_TRUE(database.ok()) << database.status();
    EXPECT_TRUE((*database)->SetCalibration(SomeCalibration(), "test").ok());
    EXPECT_TRUE((*database)->SetDrawnImages(drawn, "test").ok());
    {
      auto writer = (*database)->Write("test");
      for (const ConfigurationNumber number : AllNumbers((*database)->grid())) {
        const bool own = HasTile(drawn, number / kTileSize) && number != omitted;
        if (!own && number != added) continue;
        EXPECT_TRUE(writer->Put(DrawnImage(**database, number)).ok());
      }
      EXPECT_TRUE(writer->Commit().ok());
    }
    if (index) {
      EXPECT_TRUE(BuildCollisionIndex(**database).ok());
    }
    return Path(name);
  }

  std::vector<std::string> DrawShards(uint32_t shards) const {
    std::vector<std::string> paths;
    for (uint32_t i = 0; i < shards; ++i) {
      paths.push_back(Draw(DrawnOf(i, shards), absl::StrCat("shard", i)));
    }
    return paths;
  }

  absl::Status Merge(const std::vector<std::string>& shards) const {
    return MergeShards(shards, Path("whole"), {.program = "test merge"}).status();
  }

  void ExpectRefused(const absl::Status& status, const std::string& why) const {
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_THAT(std::string(status.message()), HasSubstr(why));
    EXPECT_FALSE(std::filesystem::exists(Path("whole")));
    EXPECT_FALSE(std::filesystem::exists(Path("whole.part")));
  }

  const std::filesystem::path folder_ = FreshFolder();
};

// Keys and values of a sub-database.
std::map<std::string, std::string> Raw(const std::string& path, const char* name) {
  MDB_env* environment = nullptr;
  MDB_txn* transaction = nullptr;
  MDB_dbi database = 0;
  MDB_cursor* cursor = nullptr;
  EXPECT_EQ(mdb_env_create(&environment), 0);
  mdb_env_set_maxdbs(environment, 96);
  EXPECT_EQ(mdb_env_open(environment, path.c_str(), MDB_RDONLY, 0600), 0);
  EXPECT_EQ(mdb_txn_begin(environment, nullptr, MDB_RDONLY, &transaction), 0);
  EXPECT_EQ(mdb_dbi_open(transaction, name, 0, &database), 0);
  EXPECT_EQ(mdb_cursor_open(transaction, database, &cursor), 0);
  std::map<std::string, std::string> all;
  MDB_val key;
  MDB_val value;
  while (mdb_cursor_get(cursor, &key, &value, MDB_NEXT) == 0) {
    all[{static_cast<const char*>(key.mv_data), key.mv_size}] = {
        static_cast<const char*>(value.mv_data), value.mv_size};
  }
  mdb_cursor_close(cursor);
  mdb_txn_abort(transaction);
  mdb_env_close(environment);
  return all;
}

TEST_F(ShardsTest, MergedShardsAreByteByByteWhatIsDrawnWithoutShards) {
  const std::string whole = Draw(DrawnOf(0, 1), "unsharded");
  std::vector<std::string> shards = DrawShards(3);
  std::swap(shards[0], shards[2]);  // in any order
  const auto report = MergeShards(shards, Path("whole") + "/", {.program = "test merge"});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->shards, 3u);
  EXPECT_EQ(report->records, 17000u);
  for (const char* name : {"robot_images", "collision_index"}) {
    EXPECT_EQ(Raw(Path("whole"), name), Raw(whole, name)) << name;
  }
  std::map<std::string, std::string> meta = Raw(Path("whole"), "meta");
  std::map<std::string, std::string> expected = Raw(whole, "meta");
  for (const char* own : {"generation", "provenance"}) {
    meta.erase(own);
    expected.erase(own);
  }
  EXPECT_EQ(meta, expected);
  EXPECT_TRUE(meta.contains("calibration"));
  const auto database = Database::Open(Path("whole"), Database::Access::kRead);
  ASSERT_TRUE(database.ok()) << database.status();
  EXPECT_EQ((*database)->Read()->Provenance()->entries(0).program(), "test merge");
  EXPECT_FALSE(std::filesystem::exists(Path("whole.part")));
}

TEST_F(ShardsTest, VariantsAreUnitedByNameWhateverTheirOrder) {
  const std::map<std::string, uint64_t> seeds = {{"own", 1}, {"reach", 2}};
  const std::vector<std::vector<std::string>> orders = {{"own", "reach"}, {"reach", "own"}};
  const std::vector<std::string> shards = DrawShards(2);
  for (uint32_t shard = 0; shard < 2; ++shard) {
    const auto database = Database::Open(shards[shard], Database::Access::kWrite);
    ASSERT_TRUE(database.ok()) << database.status();
    for (const std::string& name : orders[shard]) {
      const auto variant = (*database)->CreateVariant(name, "test");
      ASSERT_TRUE(variant.ok()) << variant.status();
      ASSERT_TRUE((*variant)->SetDrawnImages(DrawnOf(shard, 2), "test").ok());
      {
        auto writer = (*variant)->Write("test");
        for (const ConfigurationNumber number : AllNumbers((*variant)->grid())) {
          if (!HasTile(DrawnOf(shard, 2), number / kTileSize)) continue;
          ASSERT_TRUE(writer->Put(DrawnImage(**variant, number, seeds.at(name))).ok());
        }
        ASSERT_TRUE(writer->Commit().ok());
      }
      ASSERT_TRUE(BuildCollisionIndex(**variant).ok());
    }
  }
  const absl::Status merged = Merge(shards);
  ASSERT_TRUE(merged.ok()) << merged;
  const auto whole = Database::Open(Path("whole"), Database::Access::kRead);
  ASSERT_TRUE(whole.ok()) << whole.status();
  const std::vector<ConfigurationNumber> numbers = AllNumbers((*whole)->grid());
  for (const auto& [name, seed] : seeds) {
    const auto variant = (*whole)->OpenVariant(name);
    ASSERT_TRUE(variant.ok()) << variant.status();
    const auto snapshot = (*variant)->Read();
    EXPECT_EQ(snapshot->size(), 17000u);
    for (size_t i = 0; i < numbers.size(); i += 97) {
      const auto image = snapshot->Find(numbers[i]);
      ASSERT_TRUE(image.ok() && *image) << image.status();
      ASSERT_EQ((*image)->masks, DrawnImage(**variant, numbers[i], seed).masks) << name << i;
    }
  }
}

TEST_F(ShardsTest, ShardsWithDifferentVariantsAreNeverUnited) {
  const std::vector<std::string> shards = DrawShards(2);
  for (size_t shard = 0; shard < 2; ++shard) {
    const auto database = Database::Open(shards[shard], Database::Access::kWrite);
    ASSERT_TRUE((*database)->CreateVariant(shard == 0 ? "own" : "reach", "test").ok());
  }
  ExpectRefused(Merge(shards), "have different variants");
}

TEST_F(ShardsTest, MissingShardsAreNamed) {
  std::vector<std::string> shards = DrawShards(4);
  shards.erase(shards.begin() + 1);
  ExpectRefused(Merge(shards), "of 4 shards 1 is missing");
  shards.erase(shards.begin() + 1);
  ExpectRefused(Merge(shards), "of 4 shards 1, 2 are missing");
}

TEST_F(ShardsTest, ShardThatIsNamedTwiceIsRefused) {
  std::vector<std::string> shards = DrawShards(2);
  shards.push_back(Draw(DrawnOf(1, 2), "again"));
  ExpectRefused(Merge(shards), "are both shard 1 of 2");
}

TEST_F(ShardsTest, ShardsOfDifferentRobotsAreNeverUnited) {
  storage::v1::DrawnImages other = DrawnOf(1, 2);
  other.set_digest("aaaa");
  ExpectRefused(Merge({Draw(DrawnOf(0, 2), "a"), Draw(other, "b")}), "digest 00ff, aaaa");
  other = DrawnOf(1, 2);
  other.set_forbidden("joint 0 1");
  ExpectRefused(Merge({Path("a"), Draw(other, "c")}), "other forbidden regions");
  ExpectRefused(Merge({Path("a"), Draw(DrawnOf(1, 3), "d")}), "one of 2");
}

TEST_F(ShardsTest, ShardsWithDifferentCalibrationsAreNeverUnited) {
  const std::vector<std::string> shards = DrawShards(2);
  storage::v1::Calibration other = SomeCalibration();
  other.mutable_cameras(0)->set_fx(301);
  ASSERT_TRUE(
      (*Database::Open(shards[1], Database::Access::kWrite))->SetCalibration(other, "test").ok());
  ExpectRefused(Merge(shards), "entries 'calibration' differ");
}

TEST_F(ShardsTest, ShardWithAGapIsRefusedAndItsTileNamed) {
  const ConfigurationNumber omitted = 2 * kTileSize + 3;
  ExpectRefused(Merge({Draw(DrawnOf(0, 2), "a", omitted), Draw(DrawnOf(1, 2), "b")}),
                "configurations of tile 2; go on drawing it");
}

TEST_F(ShardsTest, ShardWithRecordsOfOthersIsRefused) {
  ExpectRefused(
      Merge({Draw(DrawnOf(0, 2), "a", std::nullopt, true, kTileSize), Draw(DrawnOf(1, 2), "b")}),
      "overlaps others");
}

TEST_F(ShardsTest, ShardWithoutItsIndexIsRefused) {
  ExpectRefused(Merge({Draw(DrawnOf(0, 2), "a"), Draw(DrawnOf(1, 2), "b", std::nullopt, false)}),
                "has no collision index of tile 1");
}

TEST_F(ShardsTest, ShardWithAnIndexInAnEarlierFormIsRefused) {
  const std::vector<std::string> shards = DrawShards(2);
  PutRaw(shards[1], schema::kCollisionIndex, 1, 1, [](const std::string& value) {
    TileHeader header = *TileHeaderIn(value);
    header.coding = 1;
    return EncodeTileValue(1, header, TileIndexIn(value), 4096);
  });
  ExpectRefused(Merge(shards), "has no collision index of tile 1");
}

TEST_F(ShardsTest, CapturedImagesAreNoShards) {
  const auto database = Database::Create(Path("captured"), TestCell(100, 170));
  ExpectRefused(Merge({Path("captured")}), "has no drawn robot images");
}

TEST_F(ShardsTest, MergeNeverReplacesWhatIsThere) {
  const std::vector<std::string> shards = DrawShards(2);
  std::filesystem::create_directory(folder_ / "whole");
  EXPECT_TRUE(absl::IsAlreadyExists(Merge(shards)));
}

TEST_F(ShardsTest, StoppedMergeLeavesNothingAndAnInterruptedOneIsReplaced) {
  const std::vector<std::string> shards = DrawShards(2);
  const auto stopped =
      MergeShards(shards, Path("whole"),
                  {.program = "test", .progress = [](uint64_t, uint64_t) { return false; }});
  EXPECT_TRUE(absl::IsCancelled(stopped.status()));
  EXPECT_FALSE(std::filesystem::exists(Path("whole")));
  EXPECT_FALSE(std::filesystem::exists(Path("whole.part")));
  ASSERT_TRUE(Database::Create(Path("whole.part"), TestCell(3, 3)).ok());
  EXPECT_TRUE(Merge(shards).ok());
  EXPECT_EQ((*Database::Open(Path("whole"), Database::Access::kRead))->Read()->size(), 17000u);
}

TEST_F(ShardsTest, DamagedRecordIsNeverCopied) {
  const std::vector<std::string> shards = DrawShards(2);
  const std::string file = shards[1] + "/data.mdb";
  std::string bytes;
  {
    std::ifstream in(file, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  const std::string value = Raw(shards[1], "robot_images").begin()->second;
  const size_t at = bytes.find(value);
  ASSERT_NE(at, std::string::npos);
  bytes[at + value.size() - 1] ^= 1;
  std::ofstream(file, std::ios::binary) << bytes;
  const absl::Status status = Merge(shards);
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_FALSE(std::filesystem::exists(Path("whole")));
}

TEST_F(ShardsTest, ADatabaseNeverMixesDigestsShardsOrCapturedImages) {
  const std::string path = Draw(DrawnOf(0, 2), "a");
  const auto database = Database::Open(path, Database::Access::kWrite);
  EXPECT_TRUE((*database)->SetDrawnImages(DrawnOf(0, 2), "test").ok());
  storage::v1::DrawnImages other = DrawnOf(0, 2);
  other.set_digest("bbbb");
  EXPECT_THAT(std::string((*database)->SetDrawnImages(other, "test").message()),
              AllOf(HasSubstr("drawn from another model"), HasSubstr("a new database")));
  EXPECT_THAT(std::string((*database)->SetDrawnImages(DrawnOf(1, 2), "test").message()),
              HasSubstr("is shard 0 of 2, not 1 of 2"));
  const auto captured = Database::Create(Path("captured"), TestCell());
  {
    auto writer = (*captured)->Write("test");
    ASSERT_TRUE(writer->Put(TestImage(**captured, 0)).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  EXPECT_THAT(std::string((*captured)->SetDrawnImages(DrawnOf(0, 1), "test").message()),
              HasSubstr("has captured robot images"));
}

}  // namespace
}  // namespace silhouette
