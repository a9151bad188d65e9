// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <random>
#include <vector>

#include "absl/strings/str_cat.h"
#include "db/store/collision_index.h"
#include "db/store/database_state.h"
#include "db/store/robot_image_format.h"
#include "db/store/robot_images_in_place.h"
#include "db/store/schema.h"
#include "db/store/tile_value.h"
#include "tests/db/store/index_checks.h"
#include "tests/db/store/test_database.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::unique_ptr<Database> MakeVariant(Database& database, const std::string& name = kTool) {
  auto variant = database.CreateVariant(name, "test");
  EXPECT_TRUE(variant.ok()) << variant.status();
  return *std::move(variant);
}

std::vector<RobotImage> Images(const Database& database, uint64_t seed) {
  std::vector<RobotImage> images;
  for (const ConfigurationNumber number : AllNumbers(database.grid())) {
    images.push_back(TestImage(database, number, seed));
  }
  return images;
}

// The same robot with something on its hand: a few pixels more, a few less.
RobotImage WithTool(RobotImage image, uint64_t seed) {
  std::mt19937_64 random(seed + image.number);
  for (Mask& mask : image.masks) {
    const int x0 = static_cast<int>(random() % static_cast<uint64_t>(mask.width()));
    const int y0 = static_cast<int>(random() % static_cast<uint64_t>(mask.height()));
    mask = Mask::FromPredicate(mask.size(), [&](int x, int y) {
      const bool tool = x >= x0 && x < x0 + 3 && y >= y0 && y < y0 + 2;
      return mask.at(x, y) != tool;
    });
  }
  return image;
}

std::vector<RobotImage> WithTools(std::vector<RobotImage> images, uint64_t seed) {
  for (RobotImage& image : images) image = WithTool(std::move(image), seed);
  return images;
}

Content AsContent(const std::vector<RobotImage>& images) {
  Content content;
  for (const RobotImage& image : images) content[image.number] = image;
  return content;
}

// A database and another variant of it.
class Variants : public testing::Test {
 protected:
  // Puts images into both: those of the other variant have something on the robot's hand. Returns
  // those of the default variant.
  std::vector<RobotImage> Fill(uint64_t seed, uint64_t tool_seed) {
    std::vector<RobotImage> plain = Images(*database_, seed);
    PutAll(*database_, plain);
    PutAll(*variant_, WithTools(plain, tool_seed));
    return plain;
  }

  std::unique_ptr<Database> database_ = MakeDatabase();
  std::unique_ptr<Database> variant_ = MakeVariant(*database_);
};

// How many records of a variant are stored by their difference from the default variant's.
int SharedRecords(const std::string& folder, const std::string& variant) {
  const auto environment = Environment::Open(folder);
  EXPECT_TRUE(environment.ok());
  const auto images = (*environment)->Find(schema::PlacesOfVariant(variant).robot_images);
  const auto transaction = (*environment)->Read();
  MDB_cursor* cursor = nullptr;
  EXPECT_EQ(mdb_cursor_open(transaction->get(), **images, &cursor), 0);
  int shared = 0;
  MDB_val key;
  MDB_val value;
  while (mdb_cursor_get(cursor, &key, &value, MDB_NEXT) == 0) shared += NeedsBase(FromVal(value));
  mdb_cursor_close(cursor);
  return shared;
}

TEST_F(Variants, AreKeptBesideEachOther) {
  const std::string path = FreshFolder() / "db";
  std::vector<RobotImage> plain;
  std::vector<RobotImage> tool;
  {
    const auto database = MakeDatabase(TestCell(), path);
    EXPECT_THAT(*database->Variants(), ElementsAre("default"));
    const auto variant = MakeVariant(*database);
    EXPECT_EQ(variant->variant(), kTool);
    EXPECT_THAT(*database->Variants(), ElementsAre("default", kTool));
    plain = Images(*database, 1);
    tool = WithTools(plain, 7);
    PutAll(*database, plain);
    PutAll(*variant, tool);
  }
  const auto database = *Database::Open(path, Access::kRead);
  EXPECT_EQ(ContentOf(*database), AsContent(plain));
  EXPECT_EQ(ContentOf(**database->OpenVariant(kTool)), AsContent(tool));
  EXPECT_GT(SharedRecords(path, kTool), static_cast<int>(tool.size()) * 3 / 4);
  const auto found = (*database->OpenVariant(kTool))->Read();
  for (const RobotImage& image : tool) EXPECT_EQ(**found->Find(image.number), image);
}

TEST_F(Variants, ThatDifferInFewPixelsCostLittle) {
  std::vector<RobotImage> plain = Images(*database_, 2);
  for (RobotImage& image : plain) {
    image.commanded.clear();
    image.measured.clear();
  }
  PutAll(*database_, plain);
  PutAll(*variant_, WithTools(plain, 3));
  const auto usage = database_->GetUsage();
  ASSERT_EQ(usage->variants.size(), 2);
  EXPECT_EQ(usage->variants[1].records, plain.size());
  EXPECT_LT(usage->variants[1].record_bytes, usage->variants[0].record_bytes);
}

// Whatever is replaced in whichever variant, in whatever order.
TEST_F(Variants, KeepTheirImagesWhateverIsReplaced) {
  Random random;
  const std::string path = FreshFolder() / "db";
  std::vector<Content> expected(3);
  {
    const auto database = MakeDatabase(TestCell(), path);
    std::vector<std::unique_ptr<Database>> variants;
    variants.push_back(*database->OpenVariant("default"));
    variants.push_back(MakeVariant(*database, "a"));
    variants.push_back(MakeVariant(*database, "b"));
    for (int round = 0; round < 30; ++round) {
      const size_t which = random() % variants.size();
      std::vector<RobotImage> images;
      for (const ConfigurationNumber number : AllNumbers(database->grid())) {
        if (random() % 8 != 0) continue;
        RobotImage image = TestImage(*database, number, random() % 3);
        if (which > 0) image = WithTool(image, random() % 3);
        images.push_back(image);
        expected[which][number] = image;
      }
      PutAll(*variants[which], images, true);
    }
  }
  const auto database = *Database::Open(path, Access::kRead);
  const auto states = database->ReadVariants();
  ASSERT_TRUE(states.ok()) << states.status();
  ASSERT_EQ(states->size(), 3);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ((*states)[i].snapshot.generation(), (*states)[0].snapshot.generation());
    EXPECT_EQ(ContentOf(*(*states)[i].database), expected[i]);
  }
}

// The record of the default variant is lost, or another one gets in its place without Silhouette's
// doing: those that rest on it are damaged, and nothing else.
TEST_F(Variants, DoNotTakeAnotherRecordForTheOneTheyRestOn) {
  RobotImage image = TestImage(*database_, 5, 1);
  image.excluded = false;
  image.masks = {Mask({64, 64}), Mask({33, 20})};
  image.masks[0] = Mask::FromPredicate({64, 64}, [](int x, int y) { return x * y % 7 == 3; });
  PutAll(*database_, {image});
  PutAll(*variant_, {WithTool(image, 1)});
  ASSERT_EQ(SharedRecords(database_->path(), kTool), 1);
  const auto environment = *Environment::Open(database_->path());
  const schema::NumberKey key = schema::EncodeKey(5);
  const auto change = [&](const std::function<absl::Status(WriteTransaction&)>& how) {
    ASSERT_TRUE(environment->Update(0, how).ok());
    const auto snapshot = variant_->Read();
    const auto found = snapshot->Find(5);
    EXPECT_EQ(found.status().code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(found.status().message(), HasSubstr("that it rests on is missing or different"));
    int met = 0;
    ASSERT_TRUE(ForEachMasks(*snapshot, [&](const MetRecord& record) {
                  ++met;
                  EXPECT_EQ(record.masks, StoredMasks::kDamaged);
                }).ok());
    EXPECT_EQ(met, 1);
  };
  change([&](WriteTransaction& transaction) {
    return transaction.Delete(environment->robot_images(), {key.data(), key.size()});
  });
  for (RobotImage other : {TestImage(*database_, 5, 2), WithTool(image, 9)}) {
    change([&](WriteTransaction& transaction) {
      return transaction.Put(environment->robot_images(), {key.data(), key.size()},
                             EncodeRobotImage(other));
    });
  }
}

TEST_F(Variants, AreReadInPlaceAsTheyAreStored) {
  const std::vector<RobotImage> plain = Images(*database_, 4);
  const std::vector<RobotImage> tool = WithTools(plain, 5);
  PutAll(*database_, plain);
  PutAll(*variant_, tool);
  auto snapshot = std::make_shared<const Snapshot>(*variant_->Read());
  const auto images = RobotImagesInPlace::Open(snapshot, [](const MetRecord&) {});
  ASSERT_TRUE(images.ok()) << images.status();
  for (const RobotImage& image : tool) {
    std::vector<uint64_t> expected;
    for (const Mask& mask : image.masks) {
      expected.insert(expected.end(), mask.words().begin(), mask.words().end());
    }
    size_t words = 0;
    for (const MaskSize size : database_->mask_sizes()) words += size.words();
    std::vector<uint64_t> read(words);
    EXPECT_EQ((*images)->Read(image.number, read), !image.excluded);
    if (!image.excluded) {
      EXPECT_EQ(read, expected);
    }
  }
}

TEST_F(Variants, HaveACollisionIndexEach) {
  const std::vector<RobotImage> plain = Fill(6, 5);
  const auto report = BuildCollisionIndex(*database_);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->done, report->tiles);
  ExpectIndexHoldsTheRobotImages(*database_);
  ExpectIndexHoldsTheRobotImages(*variant_);
  // A change of one says nothing wrong of the other.
  PutAll(*database_, {TestImage(*database_, plain[3].number, 77)}, true);
  ExpectIndexHoldsTheRobotImages(*database_, false);
  ExpectIndexHoldsTheRobotImages(*variant_, false);
  ASSERT_TRUE(BuildCollisionIndex(*database_).ok());
  ExpectIndexHoldsTheRobotImages(*database_);
  ExpectIndexHoldsTheRobotImages(*variant_);
}

TEST_F(Variants, IndexIsBuiltOfTheDefaultVariantOnlyWhereAskedTo) {
  Fill(6, 5);
  EXPECT_EQ(BuildIndex(*database_, {.only_variant = true}).built, 1);
  EXPECT_EQ(OpenIndex(*database_)->State(0), TileState::kFresh);
  EXPECT_EQ(OpenIndex(*variant_)->State(0), TileState::kMissing);
}

// Earlier programs coded another variant's index by its differences from the default variant's.
TEST_F(Variants, IndexInAnEarlierFormIsStaleAndIsBuiltAgain) {
  Fill(6, 5);
  ASSERT_TRUE(BuildCollisionIndex(*database_).ok());
  EXPECT_EQ(OpenIndex(*variant_)->State(0), TileState::kFresh);
  const auto environment = *Environment::Open(database_->path());
  const MDB_dbi values = **environment->Find(schema::PlacesOfVariant(kTool).collision_index);
  const schema::NumberKey key = schema::EncodeKey(0);
  const std::string_view key_view(key.data(), key.size());
  std::string stored;
  {
    const auto transaction = environment->Read();
    MDB_val key_val = ToVal(key_view);
    MDB_val value;
    ASSERT_EQ(mdb_get(transaction->get(), values, &key_val, &value), 0);
    stored = FromVal(value);
  }
  // `coding` is that of the header, `top` the highest byte of the number of views.
  const auto state_with = [&](uint64_t coding, std::byte top) {
    const std::span<const std::byte> index = TileIndexIn(stored);
    std::vector<std::byte> bytes(index.begin(), index.end());
    bytes[7] = top;
    TileHeader header = *TileHeaderIn(stored);
    header.coding = coding;
    const std::string value = EncodeTileValue(0, header, bytes, 0);
    EXPECT_TRUE(environment
                    ->Update(value.size(),
                             [&](WriteTransaction& transaction) {
                               return transaction.Put(values, key_view, value);
                             })
                    .ok());
    ExpectIndexHoldsTheRobotImages(*variant_, false);
    return OpenIndex(*variant_)->State(0);
  };
  EXPECT_EQ(state_with(0, std::byte{0}), TileState::kFresh);
  EXPECT_EQ(state_with(0, std::byte{0x80}), TileState::kDamaged);
  EXPECT_EQ(state_with(1, std::byte{0}), TileState::kStale);
  EXPECT_EQ(state_with(0x0123456789abcdef, std::byte{0x80}), TileState::kStale);
  const auto report = BuildCollisionIndex(*database_);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->built, 1);
  ExpectIndexHoldsTheRobotImages(*variant_);
}

TEST_F(Variants, HaveNamesThatAreOnesAndAreAtMostSoMany) {
  const auto database = MakeDatabase();
  for (const char* name : {"", "Open", "a b", "a/b", "0123456789012345678901234567890123"}) {
    EXPECT_EQ(database->CreateVariant(name, "test").status().code(),
              absl::StatusCode::kInvalidArgument)
        << name;
  }
  for (size_t i = 1; i < schema::kMaxVariants; ++i)
    MakeVariant(*database, absl::StrCat("variant-", i));
  EXPECT_EQ(database->CreateVariant("variant-1", "test").status().code(),
            absl::StatusCode::kAlreadyExists);
  const absl::Status full = database->CreateVariant("another", "test").status();
  EXPECT_EQ(full.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(full.message(), HasSubstr("as many as there may be"));
  const absl::Status unknown = database->OpenVariant("another").status();
  EXPECT_EQ(unknown.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(unknown.message(), HasSubstr("its variants are 'default', 'variant-1'"));
  EXPECT_EQ(database->GetUsage()->variants.size(), schema::kMaxVariants);
}

TEST_F(Variants, AreRemovedWithWhatIsTheirOwn) {
  const std::vector<RobotImage> plain = Fill(8, 1);
  ASSERT_TRUE(BuildCollisionIndex(*database_).ok());
  const auto before = variant_->Read();
  ASSERT_TRUE(database_->RemoveVariant(kTool, "test").ok());
  EXPECT_EQ(before->size(), plain.size());
  EXPECT_THAT(*database_->Variants(), ElementsAre("default"));
  EXPECT_EQ(database_->OpenVariant(kTool).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(database_->RemoveVariant(kTool, "test").code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(database_->RemoveVariant("default", "test").code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(ContentOf(*database_), AsContent(plain));
  variant_ = MakeVariant(*database_);
  EXPECT_TRUE(ContentOf(*variant_).empty());
  EXPECT_TRUE(OpenIndex(*variant_)->Tiles().empty());
}

TEST_F(Variants, ThatWereMadeAndRemovedDoNotFillADatabaseThatStaysOpen) {
  for (int i = 0; i < 60; ++i) {
    const std::string name = absl::StrCat("tool-", i);
    PutAll(*MakeVariant(*database_, name), {TestImage(*database_, 1)});
    ASSERT_TRUE(BuildCollisionIndex(*database_->OpenVariant(name).value()).ok()) << name;
    ASSERT_TRUE(database_->RemoveVariant(name, "test").ok()) << name;
  }
}

TEST_F(Variants, ShareReferencesAndOneGeneration) {
  storage::v1::References references;
  for (int i = 0; i < 2; ++i) references.add_views()->set_images(20);
  ASSERT_TRUE(variant_->SetReferences(references, "test").ok());
  EXPECT_TRUE(database_->Read()->References()->has_value());
  const uint64_t before = database_->Read()->generation();
  PutAll(*variant_, {TestImage(*database_, 1)});
  EXPECT_GT(database_->Read()->generation(), before);
  const auto provenance = database_->Read()->Provenance();
  EXPECT_EQ(provenance->entries(provenance->entries_size() - 1).variant(), kTool);
  auto writer = database_->Write("test");
  ASSERT_TRUE(writer.ok());
  EXPECT_EQ(variant_->Write("test").status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(Variants, OutliveTheDatabaseTheyAreOf) {
  database_.reset();
  PutAll(*variant_, {TestImage(*variant_, 1)});
  EXPECT_EQ(ContentOf(*variant_).size(), 1);
  EXPECT_EQ(Database::Open(variant_->path(), Access::kWrite).status().code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST_F(Variants, MasksOfAllAreReplacedAtOnce) {
  const std::vector<RobotImage> plain = Fill(3, 1);
  storage::v1::CellDescription cell = database_->cell();
  cell.set_segmentation("x: 1\n");
  const auto made = MakeDatabase(cell);
  PutAll(*made, WithTools(plain, 2));
  EXPECT_TRUE(absl::IsInvalidArgument(database_->ReplaceMasks(*made, "test")));  // no such variant
  const auto made_variant = MakeVariant(*made);
  PutAll(*made_variant, WithTools(plain, 4));
  const auto before = database_->ReadVariants();
  ASSERT_TRUE(database_->ReplaceMasks(*made, "test").ok());
  EXPECT_EQ(ContentOf(*database_), AsContent(WithTools(plain, 2)));
  EXPECT_EQ(ContentOf(*variant_), AsContent(WithTools(plain, 4)));
  EXPECT_EQ(**(*before)[1].snapshot.Find(plain[3].number), WithTools(plain, 1)[3]);
  EXPECT_GT(SharedRecords(database_->path(), kTool), 0);
}

TEST_F(Variants, AreMadeAlsoWhereTheMapIsFull) {
  const auto database = MakeDatabase();
  const auto environment = *Environment::Open(database->path());
  const auto reader = environment->Read();                   // no page is used again
  ASSERT_EQ(mdb_env_set_mapsize(environment->get(), 1), 0);  // as small as the content allows
  const auto made = database->CreateVariant(kTool, "test");
  EXPECT_TRUE(made.ok()) << made.status();
}

TEST_F(Variants, AreInACompactCopy) {
  const std::vector<RobotImage> plain = Fill(9, 2);
  const std::string copied = FreshFolder() / "copy";
  ASSERT_TRUE(database_->Compact(copied).ok());
  const auto copy = *Database::Open(copied, Access::kRead);
  EXPECT_EQ(ContentOf(**copy->OpenVariant(kTool)), AsContent(WithTools(plain, 2)));
}

}  // namespace
}  // namespace silhouette
