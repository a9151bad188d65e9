// SPDX-License-Identifier: Apache-2.0
#include "db/store/outliers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "db/store/statistics.h"
#include "tests/db/store/test_cell.h"

namespace silhouette {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

// One view of 64x64: a body in the middle and an arm of 22 pixels that joint 1 turns and joint 2
// bends at half its length.
Mask ArmMask(double q1, double q2) {
  const double elbow_x = 32 + 12 * std::cos(q1);
  const double elbow_y = 32 + 12 * std::sin(q1);
  const double hand_x = elbow_x + 10 * std::cos(q1 + q2);
  const double hand_y = elbow_y + 10 * std::sin(q1 + q2);
  const auto near_segment = [](double x, double y, double ax, double ay, double bx, double by) {
    const double length = (bx - ax) * (bx - ax) + (by - ay) * (by - ay);
    const double t = std::clamp(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length, 0.0, 1.0);
    return std::hypot(x - ax - t * (bx - ax), y - ay - t * (by - ay)) < 2.5;
  };
  return Mask::FromPredicate({64, 64}, [&](int x, int y) {
    return std::hypot(x - 32, y - 32) < 4 || near_segment(x, y, 32, 32, elbow_x, elbow_y) ||
           near_segment(x, y, elbow_x, elbow_y, hand_x, hand_y);
  });
}

class Outliers : public testing::Test {
 protected:
  Outliers() { MakeDatabase(); }

  void MakeDatabase() {
    database_.reset();
    std::filesystem::remove_all(folder_ / "db");
    storage::v1::CellDescription cell = TestCell(30, 20);
    cell.mutable_views()->RemoveLast();
    database_ = *Database::Create(folder_ / "db", cell);
  }

  // Writes what an arm looks like everywhere, as `spoil` changes it; `spoil` returns false where
  // there is to be no record.
  void Write(const std::function<bool(RobotImage&)>& spoil) {
    auto writer = database_->Write("test", absl::Hours(1));
    for (ConfigurationNumber number : AllNumbers(database_->grid())) {
      const Configuration q = database_->grid().At(number);
      RobotImage image;
      image.number = number;
      image.masks = {ArmMask(q[0], q[1])};
      if (spoil(image)) {
        ASSERT_TRUE(writer->Put(image).ok());
      }
    }
    ASSERT_TRUE(writer->Commit().ok());
  }

  std::vector<Outlier> Find() const { return *FindOutliers(*database_->Read(), database_->grid()); }

  ConfigurationNumber NumberAt(int first, int second) const {
    return database_->grid().NumberOf({first, second});
  }

  const std::filesystem::path folder_ = FreshFolder();
  std::unique_ptr<Database> database_;
};

TEST_F(Outliers, AreNoneWhereTheArmMovesSteadily) {
  Write([](RobotImage&) { return true; });
  EXPECT_THAT(Find(), IsEmpty());
}

TEST_F(Outliers, AreNoneForHolesAndExcludedConfigurations) {
  Write([](RobotImage& image) {
    image.excluded = image.number % 7 == 0;
    if (image.excluded) image.masks.clear();
    return image.number % 5 != 0;
  });
  EXPECT_THAT(Find(), IsEmpty());
}

TEST_F(Outliers, AreFoundInTheMiddleAndAtTheRim) {
  for (const auto& [first, second] : {std::pair(15, 10), std::pair(0, 0), std::pair(29, 7)}) {
    const ConfigurationNumber wrong = NumberAt(first, second);
    Write([&](RobotImage& image) {
      if (image.number == wrong) image.masks = {ArmMask(2.5, -1)};
      return true;
    });
    EXPECT_THAT(Find(), ElementsAre(Outlier{wrong, OutlierReason::kUnlikeNeighbours, 0}))
        << first << ", " << second;
    MakeDatabase();
  }
}

TEST_F(Outliers, AreEmptyMasksAndMasksAtTheBorder) {
  const ConfigurationNumber empty = NumberAt(3, 3);
  const ConfigurationNumber corner = NumberAt(20, 15);
  Write([&](RobotImage& image) {
    if (image.number == empty) image.masks = {Mask({64, 64})};
    if (image.number == corner) {
      image.masks[0] = image.masks[0] | Mask::FromPredicate({64, 64}, [](int x, int y) {
                         return x == 63 && y == 0;
                       });
    }
    return true;
  });
  EXPECT_THAT(Find(),
              testing::UnorderedElementsAre(Outlier{empty, OutlierReason::kEmpty, 0},
                                            Outlier{corner, OutlierReason::kTouchesBorder, 0}));
}

TEST_F(Outliers, SearchEndsWhenToldTo) {
  Write([](RobotImage&) { return true; });
  const auto outliers = FindOutliers(*database_->Read(), database_->grid(), {},
                                     [](uint64_t done) { return done < 10; });
  EXPECT_EQ(outliers.status().code(), absl::StatusCode::kCancelled);
}

TEST(Statistics, CountRecordsAreasAndPermanentPixels) {
  const auto database = *Database::Create(FreshFolder() / "db", TestCell());
  auto writer = database->Write("test");
  std::vector<Mask> permanent;
  std::vector<Mask> ever;
  for (MaskSize size : database->mask_sizes()) {
    permanent.push_back(~Mask(size));
    ever.emplace_back(size);
  }
  uint64_t captured = 0;
  uint64_t excluded = 0;
  double area = 0;
  for (ConfigurationNumber number : AllNumbers(database->grid())) {
    if (captured + excluded == 50) break;
    RobotImage image = TestImage(*database, number);
    for (Mask& mask : image.masks) {
      mask = mask | Mask::FromPredicate(mask.size(), [](int x, int y) { return x < 2 && y < 3; });
    }
    ASSERT_TRUE(writer->Put(image).ok());
    image.excluded ? ++excluded : ++captured;
    for (size_t i = 0; i < image.masks.size(); ++i) {
      permanent[i] = permanent[i] & image.masks[i];
      ever[i] = ever[i] | image.masks[i];
    }
    if (!image.excluded) area += static_cast<double>(image.masks[1].Count());
  }
  ASSERT_TRUE(writer->Commit().ok());
  const auto statistics = StatisticsOf(*database->Read(), database->grid(), database->mask_sizes());
  ASSERT_TRUE(statistics.ok());
  EXPECT_EQ(statistics->captured, captured);
  EXPECT_EQ(statistics->excluded, excluded);
  EXPECT_EQ(statistics->damaged, 0);
  EXPECT_EQ(statistics->missing, database->grid().size() - 50);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(statistics->views[i].permanent, permanent[i]);
    EXPECT_EQ(statistics->views[i].ever, ever[i]);
    EXPECT_GE(statistics->views[i].least_area, 6);
  }
  EXPECT_NEAR(statistics->views[1].mean_area, area / static_cast<double>(captured), 1e-9);
}

}  // namespace
}  // namespace silhouette
