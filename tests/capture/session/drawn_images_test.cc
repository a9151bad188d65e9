// SPDX-License-Identifier: Apache-2.0
// Drawing a grid into a database.
#include "capture/session/drawn_images.h"

#include <gmock/gmock.h>

#include <atomic>

#include "common/picture/files.h"
#include "db/store/robot_image_format.h"
#include "db/store/shards.h"
#include "tests/db/store/test_cell.h"

namespace silhouette {
namespace {

storage::v1::DrawnImages DrawnBy(uint32_t shard, uint32_t shards) {
  storage::v1::DrawnImages drawn;
  drawn.set_digest("00ff");
  drawn.set_shard(shard);
  drawn.set_shards(shards);
  return drawn;
}

struct DrawIntoTest : testing::Test {
  std::unique_ptr<Database> New(const std::string& name) const {
    return Database::Create((folder / name).string(), TestCell(90, 130)).value();
  }

  // By the joint values alone; nothing where the first is above 1.2.
  DrawMasks Draw() {
    return [this](std::span<const double> q) -> std::optional<std::vector<Mask>> {
      ++calls;
      if (q[0] > 1.2) return std::nullopt;
      std::vector<Mask> masks;
      for (const MaskSize size : {MaskSize{64, 64}, MaskSize{33, 20}}) {
        masks.push_back(
            Mask::FromPredicate(size, [&](int x, int y) { return x * q[0] + y * q[1] > 3; }));
      }
      return masks;
    };
  }

  const std::filesystem::path folder = FreshFolder();
  std::atomic<uint64_t> calls = 0;
};

TEST_F(DrawIntoTest, EveryConfigurationIsDrawnAtItsJointValuesOrExcluded) {
  const auto database = New("a");
  const auto report = DrawInto(*database, DrawnBy(0, 1), Draw(), {.program = "test"});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_TRUE(report->complete());
  EXPECT_EQ(report->drawn, database->grid().size());
  const auto content = ContentWithoutTimes(*database);
  ASSERT_EQ(content.size(), database->grid().size());
  uint64_t excluded = 0;
  for (const auto& [number, image] : content) {
    const auto masks = Draw()(database->grid().At(number));
    ASSERT_EQ(image.excluded, !masks.has_value());
    excluded += image.excluded ? 1 : 0;
    if (masks) {
      ASSERT_EQ(image.masks, *masks);
    }
  }
  EXPECT_EQ(report->excluded, excluded);
  EXPECT_GT(excluded, 0u);
}

TEST_F(DrawIntoTest, WhatWasDrawnBeforeAnInterruptionIsKept) {
  const auto database = New("a");
  uint64_t tiles = 0;
  const auto first =
      DrawInto(*database, DrawnBy(0, 1), Draw(),
               {.program = "test", .progress = [&](const DrawReport&) { return ++tiles <= 2; }});
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_TRUE(first->stopped);
  EXPECT_FALSE(first->complete());
  EXPECT_GT(first->drawn, 0u);
  EXPECT_EQ(database->Read()->size(), first->drawn);
  calls = 0;
  const auto second = DrawInto(*database, DrawnBy(0, 1), Draw(), {.program = "test"});
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_TRUE(second->complete());
  EXPECT_EQ(second->kept, first->drawn);
  EXPECT_EQ(calls, second->drawn);
  const auto whole = New("b");
  ASSERT_TRUE(DrawInto(*whole, DrawnBy(0, 1), Draw(), {.program = "test"}).ok());
  EXPECT_EQ(ContentWithoutTimes(*database), ContentWithoutTimes(*whole));
}

TEST_F(DrawIntoTest, ADamagedRecordIsDrawnAnew) {
  RobotImage image;
  {
    const auto database = New("a");
    ASSERT_TRUE(DrawInto(*database, DrawnBy(0, 1), Draw(), {.program = "test"}).ok());
    image = **database->Read()->Find(5);
  }
  const std::string value = EncodeRobotImage(image), file = folder / "a" / "data.mdb";
  std::string bytes = ReadWholeFile(file).value();
  const size_t at = bytes.find(value);
  ASSERT_NE(at, std::string::npos);
  bytes[at + value.size() / 2] ^= 1;
  ASSERT_TRUE(WriteWholeFile(file, bytes).ok());
  const auto database = Database::Open(folder / "a", Database::Access::kWrite).value();
  ASSERT_FALSE(database->Read()->Find(5).ok());
  const auto mended = DrawInto(*database, DrawnBy(0, 1), Draw(), {.program = "test"});
  ASSERT_TRUE(mended.ok()) << mended.status();
  EXPECT_TRUE(mended->complete());
  EXPECT_EQ(mended->damaged, 1u);
  EXPECT_EQ(mended->drawn, 1u);
  const auto read = database->Read()->Find(5);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ((*read)->masks, image.masks);
}

TEST_F(DrawIntoTest, ShardsHaveEachConfigurationOnceInWholeTiles) {
  const auto whole = New("whole");
  std::map<ConfigurationNumber, int> times;
  for (uint32_t shard = 0; shard < 3; ++shard) {
    const auto database = New(absl::StrCat("shard", shard));
    const auto report = DrawInto(*database, DrawnBy(shard, 3), Draw(), {.program = "test"});
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_EQ(report->drawn, report->configurations);
    for (const auto& [number, image] : ContentWithoutTimes(*database)) {
      EXPECT_EQ(number / kTileSize % 3, shard);
      ++times[number];
    }
  }
  EXPECT_EQ(times.size(), whole->grid().size());
  for (const auto& [number, count] : times) ASSERT_EQ(count, 1) << number;
}

TEST_F(DrawIntoTest, AnotherDigestIsRefusedAndNothingIsDrawn) {
  const auto database = New("a");
  ASSERT_TRUE(DrawInto(*database, DrawnBy(0, 1), Draw(), {.program = "test"}).ok());
  storage::v1::DrawnImages other = DrawnBy(0, 1);
  other.set_digest("1111");
  calls = 0;
  const auto refused = DrawInto(*database, other, Draw(), {.program = "test"});
  EXPECT_TRUE(absl::IsFailedPrecondition(refused.status())) << refused.status();
  EXPECT_EQ(calls, 0u);
}

}  // namespace
}  // namespace silhouette
