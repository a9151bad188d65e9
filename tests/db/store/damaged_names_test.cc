// SPDX-License-Identifier: Apache-2.0
// Keys of `meta` and names of sub-databases with a flipped bit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "db/store/collision_index.h"
#include "db/store/database_state.h"
#include "db/store/schema.h"
#include "tests/db/store/test_database.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

// A database with every key of `meta`, and with a variant that has records and an index.
std::unique_ptr<Database> MakeDatabaseWithAllKeys(const std::string& path) {
  auto database = MakeDatabase(TestCell(), path);
  const auto variant = *database->CreateVariant(kTool, "test");
  storage::v1::References references;
  for (int i = 0; i < 2; ++i) references.add_views();
  EXPECT_TRUE(database->SetReferences(references, "test").ok());
  EXPECT_TRUE(database->SetVerification(storage::v1::ModelVerification(), "test").ok());
  for (Database* each : {database.get(), variant.get()}) {
    EXPECT_TRUE(each->SetCaptureHistory({}).ok());
    EXPECT_TRUE(each->SetDrawnImages({}, "test").ok());
    PutAll(*each, {TestImage(*each, 1)});
  }
  EXPECT_TRUE(BuildCollisionIndex(*database).ok());
  const auto environment = *Environment::Open(path);
  EXPECT_TRUE(environment
                  ->Update(0,
                           [&](WriteTransaction& transaction) {
                             return WriteMeta(*environment, transaction, schema::kCalibrationKey,
                                              storage::v1::Calibration().SerializeAsString());
                           })
                  .ok());
  return database;
}

std::vector<std::string> KeysIn(Environment& environment, MDB_dbi database) {
  const auto transaction = environment.Read();
  const auto hold = environment.HoldMap();
  std::vector<std::string> keys;
  EXPECT_TRUE(environment
                  .ForEachEntry(transaction->get(), database, "",
                                [&](std::string_view key, std::string_view) {
                                  keys.emplace_back(key);
                                  return true;
                                })
                  .ok());
  return keys;
}

absl::Status Rename(Environment& environment, std::string_view from, std::string_view to) {
  return environment.Update(0, [&](WriteTransaction& transaction) -> absl::Status {
    ASSIGN_OR_RETURN(const auto value,
                     environment.Get(transaction.get(), environment.meta(), from));
    const std::string kept(value.value());
    RETURN_IF_ERROR(transaction.Delete(environment.meta(), from));
    return transaction.Put(environment.meta(), to, kept);
  });
}

TEST(Database, WithADamagedKeyOfMetaNeverTakesItsEntryForAbsent) {
  const std::string path = FreshFolder() / "db";
  const auto database = MakeDatabaseWithAllKeys(path);
  const auto environment = *Environment::Open(path);
  const std::vector<std::string> keys = KeysIn(*environment, environment->meta());
  EXPECT_THAT(keys, testing::UnorderedElementsAreArray(
                        schema::KeysOfMeta({schema::kDefaultVariant, kTool})));
  for (const std::string& key : keys) {
    for (size_t i = 0; i < key.size(); ++i) {
      std::string damaged = key;
      damaged[i] = static_cast<char>(damaged[i] ^ 1 << i % 8);
      SCOPED_TRACE(key + " as " + damaged);
      ASSERT_TRUE(Rename(*environment, key, damaged).ok());
      const absl::Status opened = Database::Open(path, Access::kRead).status();
      EXPECT_TRUE(absl::IsDataLoss(opened)) << opened;
      EXPECT_THAT(std::string(opened.message()), HasSubstr("restore it from a copy"));
      EXPECT_TRUE(absl::IsDataLoss(database->Read().status())) << "while it is open";
      EXPECT_TRUE(absl::IsDataLoss(database->ReadVariants().status())) << "while it is open";
      ASSERT_TRUE(Rename(*environment, damaged, key).ok());
    }
  }
  EXPECT_TRUE(Database::Open(path, Access::kRead).ok());
  EXPECT_EQ(database->ReadVariants()->size(), 2);
}

// The bit is flipped in the data file: in the pages of earlier states, too.
TEST(Database, WithADamagedNameOfASubDatabaseIsRefused) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabaseWithAllKeys(folder / "db").reset();
  const std::string sound = ReadFile(folder / "db/data.mdb");
  const schema::VariantPlaces places = schema::PlacesOfVariant(kTool);
  for (const std::string& name :
       {std::string("collision_index"), places.robot_images, places.collision_index}) {
    SCOPED_TRACE(name);
    std::string bytes = sound;
    for (size_t at = bytes.find(name); at != std::string::npos; at = bytes.find(name, at + 1)) {
      bytes[at + name.size() - 1] ^= 1;
    }
    std::filesystem::create_directories(folder / "spoilt");
    WriteFile(folder / "spoilt/data.mdb", bytes);
    const absl::Status status = Database::Open(folder / "spoilt", Access::kRead).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    std::filesystem::remove_all(folder / "spoilt");
  }
}

TEST(Database, WithTheEmptySubDatabasesOfARemovedVariantIsSound) {
  const std::string path = FreshFolder() / "db";
  const auto database = MakeDatabaseWithAllKeys(path);
  ASSERT_TRUE(database->RemoveVariant(kTool, "test").ok());
  EXPECT_TRUE(Database::Open(path, Access::kRead).ok());
  EXPECT_EQ(database->ReadVariants()->size(), 1);
}

// Its entry `sets` is lost.
TEST(Database, WithRecordsOfAVariantThatIsNotListedIsRefused) {
  const std::string path = FreshFolder() / "db";
  const auto database = MakeDatabase(TestCell(), path);
  PutAll(**database->CreateVariant(kTool, "test"), {TestImage(*database, 1)});
  const auto environment = *Environment::Open(path);
  ASSERT_TRUE(environment
                  ->Update(0,
                           [&](WriteTransaction& transaction) {
                             return transaction.Delete(environment->meta(), schema::kVariantsKey);
                           })
                  .ok());
  const absl::Status status = Database::Open(path, Access::kRead).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("'robot_images/gripper-open'"));
}

}  // namespace
}  // namespace silhouette
