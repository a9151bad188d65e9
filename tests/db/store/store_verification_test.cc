// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "db/store/store.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

TEST(Verification, IsKeptReplacedRemovedAndCompacted) {
  storage::v1::CellDescription cell;
  storage::v1::GridJoint& joint = *cell.add_grid_joints();
  joint.set_name("turn");
  joint.set_upper(1);
  joint.set_steps(2);
  storage::v1::View& view = *cell.add_views();
  view.set_name("top");
  view.set_mask_width(8);
  view.set_mask_height(8);
  const std::string path = FreshFolder() / "db";
  auto database = *Database::Create(path, cell);
  EXPECT_FALSE(database->Read()->Verification()->has_value());
  storage::v1::ModelVerification verification;
  for (const std::string digest : {"first", "second"}) {
    verification.set_digest(digest);
    const uint64_t generation = database->Read()->generation();
    ASSERT_TRUE(database->SetVerification(verification, "verify-model").ok());
    EXPECT_GT(database->Read()->generation(), generation);
  }
  database.reset();
  database = *Database::Open(path, Database::Access::kWrite);
  EXPECT_EQ((*database->Read()->Verification())->digest(), "second");
  const std::string copied = FreshFolder() / "copy";
  ASSERT_TRUE(database->Compact(copied).ok());
  const auto copy = *Database::Open(copied, Database::Access::kRead);
  EXPECT_EQ((*copy->Read()->Verification())->digest(), "second");
  ASSERT_TRUE(database->SetVerification({}, "verify-model").ok());
  EXPECT_FALSE(database->Read()->Verification()->has_value());
}

}  // namespace
}  // namespace silhouette
