// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/samples.h"

#include <gmock/gmock.h>

#include <memory>
#include <string>

#include "tests/test_folder.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// A captured cell of one moving joint, one fixed joint and two views.
storage::v1::CellDescription CapturedCell() {
  storage::v1::CellDescription cell;
  storage::v1::GridJoint& joint = *cell.add_grid_joints();
  joint.set_name("turn");
  joint.set_upper(9);
  joint.set_steps(10);
  storage::v1::FixedJoint& fixed = *cell.add_fixed_joints();
  fixed.set_name("reach");
  fixed.set_position(0.1);
  for (const char* name : {"top", "left"}) {
    storage::v1::View& view = *cell.add_views();
    view.set_name(name);
    view.set_mask_width(8);
    view.set_mask_height(8);
  }
  return cell;
}

Mask OnePixel(int x, int y) {
  return Mask::FromPredicate({8, 8}, [&](int u, int v) { return u == x && v == y; });
}

struct SamplesTest : ::testing::Test {
  SamplesTest() {
    auto writer = *database->Write("test");
    for (int i = 0; i < 8; ++i) {
      RobotImage image;
      image.number = database->grid().NumberOf({i});
      image.excluded = i == 3;
      if (!image.excluded) {
        image.masks = {OnePixel(i, 0), OnePixel(i, 1)};
        image.commanded = {static_cast<double>(i), 0.1};
        image.measured = {i + 0.01, 0.102};
      }
      EXPECT_TRUE(writer.Put(image).ok());
    }
    EXPECT_TRUE(writer.Commit().ok());
  }

  std::unique_ptr<Database> database = *Database::Create(FreshFolder() / "db", CapturedCell());
  storage::v1::CellDescription cell = CapturedCell();
};

TEST_F(SamplesTest, AreTheCapturedOnesAtTheirMeasuredJointValues) {
  const auto samples = SamplesIn(*database, cell, 100, 0.005, 1);
  ASSERT_TRUE(samples.ok()) << samples.status();
  ASSERT_EQ(samples->size(), 7u);
  for (const ModelSample& sample : *samples) {
    ASSERT_EQ(sample.q.size(), 1u);
    const int i = static_cast<int>(sample.q[0]);
    EXPECT_DOUBLE_EQ(sample.q[0], i + 0.01);
    EXPECT_EQ(sample.captured[0], OnePixel(i, 0));
    EXPECT_EQ(sample.captured[1], OnePixel(i, 1));
  }
  EXPECT_EQ(SamplesIn(*database, cell, 3, 0.005, 1)->size(), 3u);
}

TEST_F(SamplesTest, JointsAndViewsAreFoundByTheirNames) {
  cell.mutable_views()->SwapElements(0, 1);
  // The drawn cell moves both joints.
  storage::v1::GridJoint& reach = *cell.add_grid_joints();
  reach.set_name("reach");
  reach.set_lower(0.1);
  reach.set_upper(0.1);
  cell.clear_fixed_joints();
  const auto samples = SamplesIn(*database, cell, 1, 0.005, 1);
  ASSERT_TRUE(samples.ok()) << samples.status();
  const ModelSample& sample = samples->front();
  ASSERT_EQ(sample.q.size(), 2u);
  EXPECT_DOUBLE_EQ(sample.q[1], 0.102);
  EXPECT_EQ(sample.captured[0], OnePixel(static_cast<int>(sample.q[0]), 1));
}

TEST_F(SamplesTest, OfAnotherCellAreRefusedByName) {
  const auto refusal = [&] {
    const auto samples = SamplesIn(*database, cell, 100, 0.005, 1);
    EXPECT_EQ(samples.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(samples.status().message());
  };
  cell.mutable_fixed_joints(0)->set_position(0.12);
  EXPECT_THAT(refusal(), HasSubstr("fixed joint 'reach' at 0.102, the cell at 0.12"));
  cell = CapturedCell();
  cell.mutable_grid_joints(0)->set_name("axis");
  EXPECT_THAT(refusal(), HasSubstr("no joint 'axis'"));
  cell = CapturedCell();
  cell.mutable_views(1)->set_name("front");
  EXPECT_THAT(refusal(), HasSubstr("no view 'front'"));
  cell = CapturedCell();
  cell.mutable_views(1)->set_mask_width(16);
  EXPECT_THAT(refusal(), HasSubstr("of the view 'left'"));
}

// A model that was compared with a part of a joint's range is not known beyond.
TEST_F(SamplesTest, OfNarrowerJointsAreRefused) {
  const auto samples = [&] { return SamplesIn(*database, cell, 100, 0.005, 1).status(); };
  storage::v1::GridJoint& joint = *cell.mutable_grid_joints(0);
  const double upper = joint.upper();
  joint.set_upper(upper - 1);
  EXPECT_TRUE(samples().ok()) << samples();
  joint.set_upper(upper + 0.1);
  EXPECT_EQ(samples().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(samples().message(), HasSubstr("the joint 'turn' moves from 0 to 9.1"));
  joint.set_upper(upper);
  storage::v1::GridJoint& reach = *cell.add_grid_joints();
  reach.set_name("reach");
  reach.set_upper(0.5);
  cell.clear_fixed_joints();
  EXPECT_THAT(samples().message(), HasSubstr("the joint 'reach' moves from 0 to 0.5"));
}

TEST_F(SamplesTest, WhoseImagesAreSuspectAreLeftOut) {
  storage::v1::CaptureHistory history;
  storage::v1::SuspectSpan& span = *history.add_suspects();
  span.mutable_after()->set_seconds(102);
  span.mutable_until()->set_seconds(103);
  {
    auto writer = *database->Write("test");
    for (int i = 0; i < 3; ++i) {
      RobotImage image = **database->Read()->Find(database->grid().NumberOf({i}));
      image.captured = absl::FromUnixSeconds(102 + i);
      EXPECT_TRUE(writer.Put(image, /*replace=*/true).ok());
    }
    EXPECT_TRUE(writer.Commit().ok());
  }
  ASSERT_TRUE(database->SetCaptureHistory(history).ok());
  const auto samples = SamplesIn(*database, cell, 100, 0.005, 1);
  ASSERT_TRUE(samples.ok()) << samples.status();
  EXPECT_EQ(samples->size(), 6u);
  for (const ModelSample& sample : *samples) EXPECT_NE(sample.q[0], 1.01);
}

TEST(Samples, OfADatabaseWhoseImagesAreAllSuspectAreRefusedWithTheMend) {
  const auto database = *Database::Create(FreshFolder() / "db", CapturedCell());
  auto writer = *database->Write("test");
  RobotImage image;
  image.number = database->grid().NumberOf({4});
  image.masks = {OnePixel(4, 0), OnePixel(4, 1)};
  image.commanded = image.measured = {4, 0.1};
  image.captured = absl::FromUnixSeconds(150);
  EXPECT_TRUE(writer.Put(image).ok());
  EXPECT_TRUE(writer.Commit().ok());
  EXPECT_EQ(SamplesIn(*database, CapturedCell(), 10, 0.005, 1)->size(), 1u);
  storage::v1::CaptureHistory history;
  storage::v1::SuspectSpan& span = *history.add_suspects();
  span.mutable_after()->set_seconds(100);
  span.mutable_until()->set_seconds(200);
  EXPECT_TRUE(database->SetCaptureHistory(history).ok());
  const auto samples = SamplesIn(*database, CapturedCell(), 10, 0.005, 1);
  EXPECT_EQ(samples.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(samples.status().message()),
              AllOf(HasSubstr("all 1 robot images"), HasSubstr("--only suspect")));
}

TEST(Samples, OfADatabaseWithoutCapturedImagesAreNone) {
  const auto empty = *Database::Create(FreshFolder() / "db", CapturedCell());
  EXPECT_EQ(SamplesIn(*empty, CapturedCell(), 10, 0.005, 1).status().code(),
            absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace silhouette
