// SPDX-License-Identifier: Apache-2.0
// Camera images beside robot images, and masks that are made anew from them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "db/store/store.h"
#include "tests/db/store/full_disk.h"
#include "tests/db/store/test_cell.h"

namespace silhouette {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

storage::v1::References ReferencesOf(const std::string& name) {
  storage::v1::References references;
  references.add_views()->set_mean_png(name);
  references.add_views()->set_mean_png(name + "!");
  return references;
}

RobotImage Captured(const Database& database, ConfigurationNumber number, uint64_t seed = 0) {
  RobotImage image = TestImage(database, number, seed);
  while (image.excluded) image = TestImage(database, number, ++seed);
  image.number = number;
  return image;
}

class RawImagesTest : public testing::Test {
 protected:
  void SetUp() override {
    auto created = Database::Create(folder_ / "db", TestCell());
    ASSERT_TRUE(created.ok()) << created.status();
    database_ = *std::move(created);
    ASSERT_TRUE(database_->SetReferences(ReferencesOf("first"), "test").ok());
  }

  void Reopen() {
    database_.reset();
    auto opened = Database::Open(folder_ / "db", Database::Access::kWrite);
    ASSERT_TRUE(opened.ok()) << opened.status();
    database_ = *std::move(opened);
  }

  void Write(const RobotImage& image, std::vector<std::string> raw_images) {
    auto writer = database_->Write("test");
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer->Put(image, true, std::move(raw_images)).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }

  // A database of the same cell with these images, whose masks were made with other settings.
  std::unique_ptr<Database> Made(const std::vector<RobotImage>& images) {
    storage::v1::CellDescription cell = database_->cell();
    cell.set_segmentation("x: 1\n");
    auto made = Database::Create(folder_ / absl::StrCat("made-", ++made_), cell);
    EXPECT_TRUE(made.ok()) << made.status();
    auto writer = (*made)->Write("test");
    for (const RobotImage& image : images) EXPECT_TRUE(writer->Put(image).ok());
    EXPECT_TRUE(writer->Commit().ok());
    return *std::move(made);
  }

  const std::filesystem::path folder_ = FreshFolder();
  std::unique_ptr<Database> database_;
  int made_ = 0;
};

TEST_F(RawImagesTest, AreThereAfterReopeningWithTheReferencesTheyWereTakenWith) {
  const RobotImage image = Captured(*database_, 7);
  const std::string noise = std::string("\0\1\2", 3) + std::string(100'000, 'x');
  Write(image, {"left", noise});
  ASSERT_TRUE(database_->SetReferences(ReferencesOf("second"), "test").ok());
  Write(Captured(*database_, 9), {"a", "b"});
  Reopen();
  const auto snapshot = database_->Read();
  ASSERT_TRUE(snapshot.ok());
  EXPECT_EQ(**snapshot->Find(7), image);
  const auto left = snapshot->FindRawImage(7, 0);
  ASSERT_TRUE(left.ok() && left->has_value()) << left.status();
  EXPECT_EQ((*left)->png, "left");
  EXPECT_EQ((*left)->captured, image.captured);
  EXPECT_EQ((*snapshot->FindRawImage(7, 1))->png, noise);
  EXPECT_EQ(snapshot->FindRawImage(8, 0)->has_value(), false);
  EXPECT_THAT(*snapshot->RawImageNumbers(), ElementsAre(7, 9));
  EXPECT_EQ(snapshot->ReferencesOf((*left)->references)->views(0).mean_png(), "first");
  const auto later = snapshot->FindRawImage(9, 0);
  EXPECT_EQ(snapshot->ReferencesOf((*later)->references)->views(0).mean_png(), "second");
  EXPECT_TRUE(absl::IsNotFound(snapshot->ReferencesOf(5).status()));
  EXPECT_GT(database_->GetUsage()->raw_image_bytes, noise.size());
}

TEST_F(RawImagesTest, ADatabaseWithoutThemSaysSo) {
  Write(Captured(*database_, 7), {});
  const auto snapshot = database_->Read();
  EXPECT_THAT(*snapshot->RawImageNumbers(), IsEmpty());
  EXPECT_FALSE(snapshot->FindRawImage(7, 0)->has_value());
  EXPECT_EQ(database_->GetUsage()->raw_image_bytes, 0u);
  // Also a snapshot of before there were any.
  Write(Captured(*database_, 7), {"a", "b"});
  EXPECT_FALSE(snapshot->FindRawImage(7, 0)->has_value());
  EXPECT_THAT(*snapshot->RawImageNumbers(), IsEmpty());
}

TEST_F(RawImagesTest, GoWithTheRobotImageThatTheyBelongTo) {
  Write(Captured(*database_, 7), {"a", "b"});
  Write(Captured(*database_, 7, 3), {"c", "d"});
  EXPECT_EQ((*database_->Read()->FindRawImage(7, 1))->png, "d");
  Write(Captured(*database_, 7, 4), {});
  EXPECT_FALSE(database_->Read()->FindRawImage(7, 0)->has_value());
  EXPECT_THAT(*database_->Read()->RawImageNumbers(), IsEmpty());
}

TEST_F(RawImagesTest, GoAlsoWhereNobodyLookedAtThemBefore) {
  Write(Captured(*database_, 7), {"a", "b"});
  Reopen();
  Write(Captured(*database_, 7, 4), {});
  EXPECT_FALSE(database_->Read()->FindRawImage(7, 0)->has_value());
}

TEST_F(RawImagesTest, ThatAreNotOnePerViewAreRefused) {
  auto writer = database_->Write("test");
  const absl::Status status = writer->Put(Captured(*database_, 7), true, {"only one"});
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
}

TEST_F(RawImagesTest, CaptureHistoryIsKept) {
  EXPECT_EQ(database_->Read()->CaptureHistory()->checks_size(), 0);
  storage::v1::CaptureHistory history;
  history.add_checks()->set_alarm("view 'left' moved");
  history.add_sentinels(17);
  ASSERT_TRUE(database_->SetCaptureHistory(history).ok());
  Reopen();
  EXPECT_EQ(database_->Read()->CaptureHistory()->SerializeAsString(), history.SerializeAsString());
}

TEST_F(RawImagesTest, MasksAreReplacedAllAtOnceAndTheSettingsWithThem) {
  std::vector<RobotImage> anew;
  for (const ConfigurationNumber number : {3u, 4u, 9u}) {
    Write(Captured(*database_, number), {"a", "b"});
    anew.push_back(Captured(*database_, number, 77));
  }
  RobotImage excluded;
  excluded.number = 11;
  excluded.excluded = true;
  Write(excluded, {});
  auto before = database_->Read();
  // Not all of them, too many, or masks of what is excluded: nothing changes.
  const std::vector<std::vector<RobotImage>> wrong = {
      {},
      {anew[0], anew[1], excluded},
      {anew[0], anew[1], anew[2]},
      {anew[0], anew[1], anew[2], excluded, Captured(*database_, 12)},
      {anew[0], anew[1], anew[2], Captured(*database_, 11)}};
  for (const std::vector<RobotImage>& images : wrong) {
    const absl::Status status = database_->ReplaceMasks(*Made(images), "test");
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_EQ(database_->Read()->generation(), before->generation());
  }
  const auto made = Made({anew[0], anew[1], anew[2], excluded});
  ASSERT_TRUE(database_->ReplaceMasks(*made, "test remask").ok());
  EXPECT_GT(database_->Read()->generation(), before->generation());
  // Who looked before sees what was before.
  EXPECT_EQ(**before->Find(3), Captured(*database_, 3));
  before = absl::CancelledError("not needed any more");
  Reopen();
  EXPECT_EQ(database_->cell().segmentation(), "x: 1\n");
  const auto after = database_->Read();
  for (const RobotImage& image : anew) EXPECT_EQ(**after->Find(image.number), image);
  EXPECT_TRUE((**after->Find(11)).excluded);
  EXPECT_THAT(*after->RawImageNumbers(), SizeIs(3));
  EXPECT_EQ(after->Provenance()->entries().rbegin()->program(), "test remask");
}

TEST_F(RawImagesTest, MasksAreNotReadWithTheSettingsOfThoseThatTheyReplaced) {
  Write(Captured(*database_, 3), {});
  const auto reader = *Database::Open(folder_ / "db", Database::Access::kRead);
  EXPECT_TRUE(reader->ReadVariants().ok());
  ASSERT_TRUE(database_->ReplaceMasks(*Made({Captured(*database_, 3, 77)}), "test").ok());
  const absl::Status status = reader->ReadVariants().status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("changed meanwhile; load it again"));
  EXPECT_TRUE(database_->ReadVariants().ok());
  EXPECT_TRUE((*Database::Open(folder_ / "db", Database::Access::kRead))->ReadVariants().ok());
}

TEST_F(RawImagesTest, ThatCannotBeLookedUpAreNotTakenForAbsent) {
  ASSERT_TRUE(database_->CreateVariant("tool", "test").ok());
  const RobotImage image = Captured(*database_, 7);
  {
    const auto tool = *database_->OpenVariant("tool");
    auto writer = tool->Write("test");
    ASSERT_TRUE(writer->Put(image, true, {"a", "b"}).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  Reopen();
  const auto tool = *database_->OpenVariant("tool");
  auto writer = tool->Write("test", absl::Hours(1));
  ASSERT_TRUE(writer->Put(image, true).ok());
  std::vector<Snapshot> readers;  // as many as there may be
  auto reader = database_->Read();
  for (; reader.ok(); reader = database_->Read()) readers.push_back(*std::move(reader));
  EXPECT_TRUE(absl::IsResourceExhausted(reader.status())) << reader.status();
  const absl::Status status = writer->Commit();
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  readers.clear();
  ASSERT_TRUE(writer->Commit().ok());
  EXPECT_THAT(*tool->Read()->RawImageNumbers(), IsEmpty());
}

using RawImagesOnAFullDisk = FullDisk;

TEST_F(RawImagesOnAFullDisk, AreStoredWithTheirRobotImageOrNotAtAll) {
  auto created = Database::Create(disk_ + "/db", TestCell());
  ASSERT_TRUE(created.ok()) << created.status();
  Database& database = **created;
  auto writer = database.Write("test", absl::ZeroDuration());
  ASSERT_TRUE(writer.ok());
  absl::Status status;
  std::vector<ConfigurationNumber> numbers = AllNumbers(database.grid());
  size_t next = 0;
  for (; status.ok() && next < numbers.size(); ++next) {
    status = writer->Put(Captured(database, numbers[next]), true,
                         {std::string(40'000, 'a'), std::string(30'000, 'b')});
  }
  ASSERT_TRUE(absl::IsResourceExhausted(status)) << status;
  const auto snapshot = database.Read();
  EXPECT_GT(snapshot->size(), 3u);
  EXPECT_EQ(snapshot->size(), writer->committed());
  EXPECT_THAT(*snapshot->RawImageNumbers(), SizeIs(snapshot->size()));
  const auto with_raw_images = snapshot->RawImageNumbers();
  for (const ConfigurationNumber number : *with_raw_images) {
    EXPECT_EQ((*snapshot->FindRawImage(number, 1))->png, std::string(30'000, 'b'));
  }
}

}  // namespace
}  // namespace silhouette
