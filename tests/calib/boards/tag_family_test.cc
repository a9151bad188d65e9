// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/tag_family.h"

#include <apriltag/apriltag.h>
extern "C" {
#include <apriltag/common/image_u8.h>
}
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <stdexcept>

namespace silhouette {
namespace {

using testing::HasSubstr;

std::string TagFamilyMessageFor(const std::string& name) {
  try {
    TagFamily family(name);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

// What the library finds in a picture of a tag's modules, `scale` pixels each, with a wide white
// rim.
struct Found {
  int id = -1;
  double corners[4][2] = {};  // in modules of the print, from its top left
};

Found Detect(const TagFamily& family, const TagModules& modules, int scale) {
  const int rim = 4;
  const int size = (modules.width + 2 * rim) * scale;
  image_u8_t* image = image_u8_create(size, size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const int column = x / scale - rim;
      const int row = y / scale - rim;
      const bool inside = column >= 0 && row >= 0 && column < modules.width && row < modules.width;
      image->buf[y * image->stride + x] = !inside || modules.White(column, row) ? 255 : 0;
    }
  }
  const AprilTagFamily library = family.Library();
  apriltag_detector_t* detector = apriltag_detector_create();
  apriltag_detector_add_family_bits(detector, library.get(), 0);
  zarray_t* detections = apriltag_detector_detect(detector, image);
  Found found;
  if (zarray_size(detections) == 1) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(detections, 0, &detection);
    found.id = detection->id;
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 2; ++k) found.corners[i][k] = detection->p[i][k] / scale - rim;
    }
  }
  apriltag_detections_destroy(detections);
  apriltag_detector_destroy(detector);
  image_u8_destroy(image);
  return found;
}

TEST(TagFamily, ModulesOfEveryFamilyAreATagThatIsDetected) {
  for (const std::string& name : TagFamily::Names()) {
    const TagFamily family(name);
    for (const int id : {0, 1, family.tags() - 1}) {
      SCOPED_TRACE(name + " " + std::to_string(id));
      const Found found = Detect(family, family.Modules(id), 12);
      EXPECT_EQ(found.id, id);
      // In AprilTag's order: bottom left, bottom right, top right, top left.
      const double low = 0.5 * (family.total_width() - family.width_at_border());
      const double high = low + family.width_at_border();
      const double expected[4][2] = {{low, high}, {high, high}, {high, low}, {low, low}};
      for (int i = 0; i < 4; ++i) {
        for (int k = 0; k < 2; ++k) EXPECT_NEAR(found.corners[i][k], expected[i][k], 0.1);
      }
    }
  }
}

TEST(TagFamily, BorderIsWhereItIsSaidToBe) {
  for (const std::string& name : TagFamily::Names()) {
    SCOPED_TRACE(name);
    const TagFamily family(name);
    const TagModules modules = family.Modules(0);
    ASSERT_EQ(modules.width, family.total_width());
    const int first = (family.total_width() - family.width_at_border()) / 2;
    const int last = family.total_width() - 1 - first;
    for (int i = first; i <= last; ++i) {
      EXPECT_EQ(modules.White(i, first), family.reversed_border());
      EXPECT_EQ(modules.White(last, i), family.reversed_border());
      EXPECT_EQ(modules.White(i, first - 1), !family.reversed_border());
      EXPECT_EQ(modules.White(last + 1, i), !family.reversed_border());
    }
  }
}

// As kalibr_create_target_pdf draws it, with --border-bits 2; its detector reads no other.
TEST(TagFamily, BorderOfKalibrsTagsIsTwoBlackModulesWide) {
  const TagFamily family(kKalibrFamily);
  EXPECT_EQ(family.border(), 2);
  const int first = (family.total_width() - family.width_at_border()) / 2;
  const int last = family.total_width() - 1 - first;
  for (const int id : {0, 35}) {
    const TagModules modules = family.Modules(id);
    for (int i = first; i <= last; ++i) {
      for (const int ring : {0, 1}) {
        EXPECT_FALSE(modules.White(i, first + ring)) << id << " " << i << " " << ring;
        EXPECT_FALSE(modules.White(i, last - ring)) << id << " " << i << " " << ring;
        EXPECT_FALSE(modules.White(first + ring, i)) << id << " " << i << " " << ring;
        EXPECT_FALSE(modules.White(last - ring, i)) << id << " " << i << " " << ring;
      }
    }
  }
}

TEST(TagFamily, TagsDiffer) {
  const TagFamily family("tagStandard41h12");
  EXPECT_EQ(family.total_width(), 9);
  EXPECT_EQ(family.width_at_border(), 5);
  std::set<std::vector<bool>> all;
  for (int id = 0; id < 100; ++id) all.insert(family.Modules(id).white);
  EXPECT_EQ(all.size(), 100u);
}

TEST(TagFamily, UnknownOnesAreRefusedWithTheNearest) {
  EXPECT_THAT(TagFamilyMessageFor("tag36h1"), HasSubstr("did you mean 'tag36h1"));
  EXPECT_THAT(TagFamilyMessageFor("chequers"), HasSubstr("'tagCustom48h12'"));
  EXPECT_THROW(TagFamily("tag16h5").Modules(30), std::out_of_range);
  EXPECT_THROW(TagFamily("tag16h5").Modules(-1), std::out_of_range);
}

}  // namespace
}  // namespace silhouette
