// SPDX-License-Identifier: Apache-2.0
// silhouette-db, and databases of TestCell that it is tried on.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "db/store/schema.h"
#include "tests/db/store/test_cell.h"
#include "tests/shell.h"

namespace silhouette {

inline Mask OnePixel(MaskSize size) {
  return Mask::FromPredicate(size, [](int x, int y) { return x == 3 && y == 4; });
}

// A PNG image of one value, of pixels of a type of OpenCV's.
inline std::string PlainPng(cv::Size size, int type, int value) {
  std::vector<uint8_t> png;
  cv::imencode(".png", cv::Mat(size, type, cv::Scalar(value)), png);
  return {png.begin(), png.end()};
}

// Of TestCell's views, with that mean value.
inline storage::v1::References TestReferences(int mean) {
  storage::v1::References references;
  for (const cv::Size size : {cv::Size(640, 480), cv::Size(33, 20)}) {
    storage::v1::Reference* view = references.add_views();
    view->set_mean_png(PlainPng(size, CV_16UC1, mean));
    view->set_noise_png(PlainPng(size, CV_16UC1, 200));
    view->set_images(20);
    view->mutable_time()->set_seconds(1'700'000'000);
    view->mutable_time()->set_nanos(5);
  }
  return references;
}

class SilhouetteDb : public ProgramTest {
 protected:
  SilhouetteDb() : ProgramTest("silhouette-db") {}

  // A database of 6 x 5 configurations; those in `left_out` have no record.
  void MakeDatabase(const std::string& name, uint64_t seed = 0,
                    const std::vector<size_t>& left_out = {}) const {
    const auto database = Database::Create(folder_ / name, TestCell(6, 5));
    ASSERT_TRUE(database.ok()) << database.status();
    auto writer = (*database)->Write("test");
    const std::vector<ConfigurationNumber> numbers = AllNumbers((*database)->grid());
    for (size_t i = 0; i < numbers.size(); ++i) {
      if (std::find(left_out.begin(), left_out.end(), i) != left_out.end()) continue;
      ASSERT_TRUE(writer->Put(TestImage(**database, numbers[i], seed)).ok());
    }
    ASSERT_TRUE(writer->Commit().ok());
    ASSERT_TRUE((*database)->SetReferences(TestReferences(25'000), "test").ok());
  }

  // A database with a drawn robot image in that variant.
  void MakeDrawnDatabase(const std::string& name,
                         const std::string& variant = schema::kDefaultVariant) const {
    const auto whole = Database::Create(folder_ / name, TestCell(6, 5)).value();
    const auto database = variant == schema::kDefaultVariant
                              ? whole->OpenVariant(variant).value()
                              : whole->CreateVariant(variant, "test").value();
    storage::v1::DrawnImages images;
    images.set_digest("00ff");
    images.set_shards(1);
    ASSERT_TRUE(database->SetDrawnImages(images, "test").ok());
    auto writer = database->Write("test");
    ASSERT_TRUE(writer->Put(TestImage(*database, NumberAt(2, 1))).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }

  std::vector<std::string> VariantsOf(const std::string& name) const {
    return Database::Open(folder_ / name, Database::Access::kRead).value()->Variants().value();
  }
  storage::v1::References ReferencesOf(const std::string& name) const {
    const auto database = Database::Open(folder_ / name, Database::Access::kRead).value();
    return database->Read()->References()->value();
  }

  ConfigurationNumber NumberAt(int first, int second) const {
    return GridOf(TestCell(6, 5))->NumberOf({first, second});
  }
};

}  // namespace silhouette
