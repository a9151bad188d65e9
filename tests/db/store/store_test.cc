// SPDX-License-Identifier: Apache-2.0
#include "db/store/store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <map>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/db/store/test_database.h"

namespace silhouette {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

std::unique_ptr<Database> OpenDatabase(const std::string& path, Access access = Access::kRead) {
  absl::StatusOr<std::unique_ptr<Database>> database = Database::Open(path, access);
  EXPECT_TRUE(database.ok()) << database.status();
  return *std::move(database);
}

RobotImageWriter MakeWriter(Database& database, absl::Duration max_delay = absl::Hours(1)) {
  absl::StatusOr<RobotImageWriter> writer = database.Write("store_test", max_delay);
  EXPECT_TRUE(writer.ok()) << writer.status();
  return *std::move(writer);
}

TEST(Database, GivesBackWhatWasPutAfterReopening) {
  const std::string path = FreshFolder() / "db";
  std::map<ConfigurationNumber, RobotImage> expected;
  {
    const auto database = MakeDatabase(TestCell(), path);
    RobotImageWriter writer = MakeWriter(*database);
    std::vector<ConfigurationNumber> numbers = AllNumbers(database->grid());
    std::shuffle(numbers.begin(), numbers.end(), std::mt19937_64(1));
    for (ConfigurationNumber number : numbers) {
      expected[number] = TestImage(*database, number);
      ASSERT_TRUE(writer.Put(expected[number]).ok());
      if (number % 7 == 0) {
        ASSERT_TRUE(writer.Commit().ok());
      }
    }
    ASSERT_TRUE(writer.Commit().ok());
    EXPECT_EQ(writer.committed(), expected.size());
  }
  const auto database = OpenDatabase(path);
  EXPECT_EQ(ContentOf(*database), expected);
  const absl::StatusOr<Snapshot> snapshot = database->Read();
  EXPECT_EQ(snapshot->size(), expected.size());
  for (const auto& [number, image] : expected) EXPECT_EQ(**snapshot->Find(number), image);
}

TEST(Database, KeepsItsCellDescriptionAndChoosesOpenTileEdges) {
  const auto database = OpenDatabase(MakeDatabase()->path());
  storage::v1::CellDescription expected = TestCell();
  for (int edge : database->grid().tile_edges()) expected.add_tile_edges(edge);
  EXPECT_EQ(database->cell().SerializeAsString(), expected.SerializeAsString());
  EXPECT_EQ(database->grid(), *GridOf(expected));
  EXPECT_THAT(database->mask_sizes(), ElementsAre(MaskSize{64, 64}, MaskSize{33, 20}));
}

TEST(Database, RefusesADescriptionThatIsNotValid) {
  const std::filesystem::path folder = FreshFolder();
  const auto message = [&](const std::function<void(storage::v1::CellDescription&)>& spoil) {
    storage::v1::CellDescription cell = TestCell();
    spoil(cell);
    const absl::Status status = Database::Create(folder / "db", cell).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  EXPECT_THAT(message([](auto& cell) { cell.clear_views(); }), HasSubstr("at least one view"));
  EXPECT_THAT(message([](auto& cell) { cell.mutable_views(1)->set_name("left"); }),
              HasSubstr("view 'left' is named twice"));
  EXPECT_THAT(message([](auto& cell) { cell.mutable_views(1)->set_mask_width(1025); }),
              HasSubstr("view 'top': mask size 1025x20"));
  EXPECT_THAT(message([](auto& cell) { cell.mutable_grid_joints(0)->set_steps(0); }),
              HasSubstr("joint 'axis_1': steps"));
  EXPECT_THAT(message([](auto& cell) { cell.mutable_fixed_joints(0)->set_name("axis_2"); }),
              HasSubstr("joint 'axis_2' is named twice"));
  EXPECT_FALSE(std::filesystem::exists(folder / "db"));
}

TEST(Database, IsNotMadeTwiceNorAmongOtherFiles) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(TestCell(), folder / "db");
  absl::Status status = Database::Create(folder / "db", TestCell()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kAlreadyExists) << status;
  status = Database::Create(folder, TestCell()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("is not empty"));
  status = Database::Open(folder / "none", Access::kRead).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(status.message(), HasSubstr(absl::StrCat("there is no database in '",
                                                       (folder / "none").string(), "'")));
}

TEST(Snapshot, FindsNothingWhereNothingIsStored) {
  const auto database = MakeDatabase();
  const absl::StatusOr<Snapshot> snapshot = database->Read();
  EXPECT_EQ(snapshot->size(), 0);
  EXPECT_EQ(*snapshot->Find(0), std::nullopt);
  EXPECT_FALSE(*snapshot->Contains(0));
  EXPECT_EQ(*snapshot->Find(~uint64_t{0}), std::nullopt);
  EXPECT_FALSE(snapshot->References()->has_value());
}

TEST(Snapshot, DoesNotChangeWhileOthersWrite) {
  const auto database = MakeDatabase();
  RobotImageWriter writer = MakeWriter(*database);
  ASSERT_TRUE(writer.Put(TestImage(*database, 0)).ok());
  ASSERT_TRUE(writer.Commit().ok());
  const absl::StatusOr<Snapshot> before = database->Read();
  ASSERT_TRUE(writer.Put(TestImage(*database, 1)).ok());
  ASSERT_TRUE(writer.Put(TestImage(*database, 0, 5), true).ok());
  ASSERT_TRUE(writer.Commit().ok());
  EXPECT_EQ(before->size(), 1);
  EXPECT_EQ(**before->Find(0), TestImage(*database, 0));
  EXPECT_FALSE(*before->Contains(1));
  const absl::StatusOr<Snapshot> after = database->Read();
  EXPECT_EQ(**after->Find(0), TestImage(*database, 0, 5));
  EXPECT_TRUE(*after->Contains(1));
  EXPECT_GT(after->generation(), before->generation());
}

TEST(Snapshot, OutlivesItsDatabase) {
  auto database = MakeDatabase();
  RobotImageWriter writer = MakeWriter(*database);
  const RobotImage image = TestImage(*database, 3);
  ASSERT_TRUE(writer.Put(image).ok());
  ASSERT_TRUE(writer.Commit().ok());
  const absl::StatusOr<Snapshot> snapshot = database->Read();
  database.reset();
  EXPECT_EQ(**snapshot->Find(3), image);
}

TEST(Snapshot, VisitsInOrderOfNumbersUntilToldToStop) {
  const auto database = MakeDatabase();
  RobotImageWriter writer = MakeWriter(*database);
  const std::vector<ConfigurationNumber> numbers = AllNumbers(database->grid());
  for (ConfigurationNumber number : numbers) {
    ASSERT_TRUE(writer.Put(TestImage(*database, number)).ok());
  }
  ASSERT_TRUE(writer.Commit().ok());
  std::vector<ConfigurationNumber> visited;
  const auto visit = [&](ConfigurationNumber number, const absl::StatusOr<RobotImage>&) {
    visited.push_back(number);
    return visited.size() < 100;
  };
  ASSERT_TRUE(database->Read()->ForEach(visit).ok());
  EXPECT_EQ(visited, std::vector(numbers.begin(), numbers.begin() + 100));
}

TEST(Snapshot, LetsTheVisitorWriteEvenIfTheMapGrows) {
  storage::v1::CellDescription cell = TestCell(64, 64);
  cell.mutable_views(0)->set_mask_width(1024);
  cell.mutable_views(0)->set_mask_height(1024);
  const auto database = MakeDatabase(cell);
  RobotImageWriter writer = MakeWriter(*database);
  std::mt19937_64 random(3);
  RobotImage image;
  for (MaskSize size : database->mask_sizes()) {
    std::vector<uint64_t> words(size.words());
    for (uint64_t& word : words) word = random();
    if (size.pixels() % 64 != 0) words.back() &= (uint64_t{1} << (size.pixels() % 64)) - 1;
    image.masks.push_back(Mask::FromWords(size, std::move(words)));
  }
  for (int i = 0; i < 40; ++i) {
    image.number = static_cast<uint64_t>(i);
    ASSERT_TRUE(writer.Put(image).ok());
  }
  ASSERT_TRUE(writer.Commit().ok());
  const absl::StatusOr<Snapshot> snapshot = database->Read();
  int visited = 0;
  const auto visit = [&](ConfigurationNumber number, absl::StatusOr<RobotImage> found) {
    EXPECT_TRUE(found.ok());
    EXPECT_EQ(found->masks, image.masks);
    for (uint64_t copy = 0; copy < 16; ++copy) {  // 16 x 40 x 128 KiB: more than the first map
      image.number = 40 + number * 16 + copy;
      EXPECT_TRUE(writer.Put(image).ok());
    }
    image.number = number;
    EXPECT_TRUE(writer.Put(image, true).ok());
    EXPECT_TRUE(writer.Commit().ok());
    ++visited;
    return true;
  };
  ASSERT_TRUE(snapshot->ForEach(visit).ok());
  EXPECT_EQ(visited, 40);
}

TEST(RobotImageWriter, ReplacesOnlyWhenAsked) {
  const auto database = MakeDatabase();
  RobotImageWriter writer = MakeWriter(*database);
  ASSERT_TRUE(writer.Put(TestImage(*database, 1)).ok());
  EXPECT_EQ(writer.Put(TestImage(*database, 1, 2)).code(), absl::StatusCode::kAlreadyExists);
  ASSERT_TRUE(writer.Commit().ok());
  EXPECT_EQ(writer.Put(TestImage(*database, 1, 2)).code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(**database->Read()->Find(1), TestImage(*database, 1));
  ASSERT_TRUE(writer.Put(TestImage(*database, 1, 2), true).ok());
  ASSERT_TRUE(writer.Put(TestImage(*database, 1, 3), true).ok());
  ASSERT_TRUE(writer.Commit().ok());
  EXPECT_EQ(**database->Read()->Find(1), TestImage(*database, 1, 3));
  EXPECT_EQ(database->Read()->size(), 1);
}

TEST(RobotImageWriter, RefusesWhatDoesNotFitTheCell) {
  const auto database = MakeDatabase();
  RobotImageWriter writer = MakeWriter(*database);
  const auto refusal = [&](const std::function<void(RobotImage&)>& spoil) {
    RobotImage image;
    for (MaskSize size : database->mask_sizes()) image.masks.emplace_back(size);
    spoil(image);
    const absl::Status status = writer.Put(image);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  EXPECT_THAT(refusal([](RobotImage& image) { image.number = ~uint64_t{0}; }),
              HasSubstr("the grid has no configuration of this number"));
  EXPECT_THAT(refusal([](RobotImage& image) { image.masks.pop_back(); }),
              HasSubstr("it has 1 masks and should have 2"));
  EXPECT_THAT(refusal([](RobotImage& image) {
                image.masks[1] = Mask({20, 33});
              }),
              HasSubstr("view 'top' has masks of 33x20, not 20x33"));
  EXPECT_THAT(refusal([](RobotImage& image) { image.excluded = true; }),
              HasSubstr("it has 2 masks and should have 0"));
  EXPECT_THAT(refusal([](RobotImage& image) {
                image.measured = {1, 2};
              }),
              HasSubstr("it has 2 joint values, the cell has 3 joints"));
  ASSERT_TRUE(writer.Commit().ok());
  EXPECT_EQ(database->Read()->size(), 0);
}

TEST(RobotImageWriter, DropsWhatWasNotCommitted) {
  const auto database = MakeDatabase();
  {
    RobotImageWriter writer = MakeWriter(*database);
    ASSERT_TRUE(writer.Put(TestImage(*database, 1)).ok());
  }
  EXPECT_EQ(database->Read()->size(), 0);
}

TEST(RobotImageWriter, CommitsByItselfOnceTheDelayHasPassed) {
  const auto database = MakeDatabase();
  RobotImageWriter writer = MakeWriter(*database, absl::ZeroDuration());
  ASSERT_TRUE(writer.Put(TestImage(*database, 1)).ok());
  EXPECT_EQ(writer.committed(), 1);
  EXPECT_TRUE(*database->Read()->Contains(1));
}

TEST(RobotImageWriter, IsTheOnlyOneOfItsDatabase) {
  const auto database = MakeDatabase();
  {
    RobotImageWriter writer = MakeWriter(*database);
    EXPECT_EQ(database->Write("second").status().code(), absl::StatusCode::kFailedPrecondition);
  }
  EXPECT_TRUE(database->Write("third").ok());
  const auto reader = OpenDatabase(database->path());
  const absl::Status status = reader->Write("fourth").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("open for reading only"));
}

TEST(RobotImageWriter, LeavesItsSessionInTheProvenanceLog) {
  const auto database = MakeDatabase();
  for (uint64_t session = 0; session < 3; ++session) {
    RobotImageWriter writer = *database->Write(absl::StrCat("session ", session));
    for (uint64_t i = 0; i < 5 * session; ++i) {
      ASSERT_TRUE(writer.Put(TestImage(*database, 10 * session + i)).ok());
      if (i % 2 == 0) {
        ASSERT_TRUE(writer.Commit().ok());
      }
    }
    ASSERT_TRUE(writer.Commit().ok());
  }
  const absl::StatusOr<storage::v1::ProvenanceLog> log = database->Read()->Provenance();
  ASSERT_THAT(log->entries(), SizeIs(2));  // the first session wrote nothing
  EXPECT_EQ(log->entries(0).program(), "session 1");
  EXPECT_EQ(log->entries(0).robot_images(), 5);
  EXPECT_EQ(log->entries(1).program(), "session 2");
  EXPECT_EQ(log->entries(1).robot_images(), 10);
  const absl::Time now = absl::Now();
  EXPECT_LE(now - absl::FromUnixSeconds(log->entries(0).time().seconds()), absl::Minutes(10));
}

TEST(Database, KeepsReferencesAndCountsThemAsAChange) {
  const auto database = MakeDatabase();
  const uint64_t before = database->Read()->generation();
  storage::v1::References references;
  references.add_views()->set_mean_png(std::string(100'000, 'x'));
  EXPECT_EQ(database->SetReferences(references, "test").code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(database->Read()->generation(), before);
  references.add_views()->set_images(20);
  ASSERT_TRUE(database->SetReferences(references, "test").ok());
  const absl::StatusOr<Snapshot> snapshot = database->Read();
  EXPECT_EQ((*snapshot->References())->SerializeAsString(), references.SerializeAsString());
  EXPECT_GT(snapshot->generation(), before);
  EXPECT_EQ(snapshot->Provenance()->entries_size(), 1);
}

TEST(Database, HasOneWriterAndManyReadersInAProcess) {
  auto writer = MakeDatabase();
  const absl::Status second = Database::Open(writer->path(), Access::kWrite).status();
  EXPECT_EQ(second.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(second.message(), HasSubstr("this process already is writing to it"));
  const auto reader = OpenDatabase(writer->path());
  const auto another = OpenDatabase(writer->path());
  RobotImageWriter images = MakeWriter(*writer);
  ASSERT_TRUE(images.Put(TestImage(*writer, 1)).ok());
  ASSERT_TRUE(images.Commit().ok());
  EXPECT_TRUE(*reader->Read()->Contains(1));
  EXPECT_TRUE(*another->Read()->Contains(1));
}

TEST(Database, CanBeWrittenAgainOnceTheWriterIsGone) {
  const std::string path = MakeDatabase()->path();
  OpenDatabase(path, Access::kWrite).reset();
  const auto database = OpenDatabase(path, Access::kWrite);
  RobotImageWriter writer = MakeWriter(*database);
  ASSERT_TRUE(writer.Put(TestImage(*database, 1)).ok());
  ASSERT_TRUE(writer.Commit().ok());
}

TEST(Database, ServesReadersInOtherThreadsWhileItIsWritten) {
  const auto database = MakeDatabase(TestCell(64, 64));
  const auto other = OpenDatabase(database->path());
  std::atomic<bool> done = false;
  std::vector<std::thread> readers;
  for (const Database* source : {database.get(), other.get()}) {
    readers.emplace_back([&, source] {
      uint64_t last_size = 0;
      while (!done) {
        const absl::StatusOr<Snapshot> snapshot = source->Read();
        ASSERT_TRUE(snapshot.ok()) << snapshot.status();
        ASSERT_GE(snapshot->size(), last_size);
        last_size = snapshot->size();
        uint64_t seen = 0;
        const auto visit = [&](ConfigurationNumber number, absl::StatusOr<RobotImage> image) {
          EXPECT_TRUE(image.ok()) << image.status();
          EXPECT_EQ(*image, TestImage(*source, number));
          ++seen;
          return true;
        };
        ASSERT_TRUE(snapshot->ForEach(visit).ok());
        EXPECT_EQ(seen, last_size);
      }
    });
  }
  RobotImageWriter writer = MakeWriter(*database);
  for (ConfigurationNumber number = 0; number < 1000; ++number) {
    ASSERT_TRUE(writer.Put(TestImage(*database, number)).ok());
    if (number % 20 == 0) {
      ASSERT_TRUE(writer.Commit().ok());
    }
  }
  ASSERT_TRUE(writer.Commit().ok());
  done = true;
  for (std::thread& reader : readers) reader.join();
}

TEST(Database, TakesManyRecordsWithoutAsManyTransactions) {
  const auto database = MakeDatabase(TestCell(400, 500));
  const uint64_t before = database->Read()->generation();
  RobotImageWriter writer = MakeWriter(*database, absl::Seconds(1));
  RobotImage image;
  for (MaskSize size : database->mask_sizes()) image.masks.emplace_back(size);
  for (ConfigurationNumber number : AllNumbers(database->grid())) {
    image.number = number;
    ASSERT_TRUE(writer.Put(image).ok());
  }
  ASSERT_TRUE(writer.Commit().ok());
  const absl::StatusOr<Snapshot> snapshot = database->Read();
  EXPECT_EQ(snapshot->size(), 200'000);
  EXPECT_LT(snapshot->generation() - before, 1000);
  // A mask of few pixels takes far less room than its bits.
  EXPECT_LT(database->GetUsage()->used_bytes, 200'000 * 120);
}

TEST(Database, IsSmallerWhenCompactedAndHoldsTheSame) {
  const std::string copied = FreshFolder() / "copy";
  const auto database = MakeDatabase();
  RobotImageWriter writer = MakeWriter(*database);
  for (uint64_t round = 0; round < 4; ++round) {
    for (ConfigurationNumber number : AllNumbers(database->grid())) {
      ASSERT_TRUE(writer.Put(TestImage(*database, number, round), true).ok());
    }
    ASSERT_TRUE(writer.Commit().ok());
  }
  ASSERT_TRUE(database->Compact(copied).ok());
  EXPECT_EQ(database->Compact(copied).code(), absl::StatusCode::kAlreadyExists);
  const auto copy = OpenDatabase(copied, Access::kWrite);
  EXPECT_EQ(ContentOf(*copy), ContentOf(*database));
  EXPECT_EQ(copy->Read()->generation(), database->Read()->generation());
  EXPECT_LT(copy->GetUsage()->file_bytes, database->GetUsage()->file_bytes);
  EXPECT_LE(copy->GetUsage()->used_bytes, copy->GetUsage()->file_bytes);
}

}  // namespace
}  // namespace silhouette
