// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include "db/store/store.h"
#include "tests/tools/cell/cell_file.h"
#include "tools/cell/segmentation_text.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

TEST(Segmentation, SettingsOfADatabaseAreThoseItWasMadeWith) {
  const auto read = [](const std::string& text) {
    storage::v1::CellDescription cell;
    cell.set_segmentation(text);
    return SegmentationOf(cell);
  };
  for (const SegmentationSettings& settings :
       {SegmentationSettings{}, LeftOutOfDescriptions(),
        SegmentationSettings{.faint_difference = 3, .texture_difference = 0, .faint_side = 5},
        SegmentationSettings{.noise_factor = 1.0 / 3,
        .faint_side = 3,
        .follow_brightness = false,
        .keep_thin_parts = false,
        .min_cover = 0.25,
        .shadows = Shadows::kIgnore}}) {
    const auto found = read(Describe(settings));
    ASSERT_TRUE(found.ok()) << found.status();
    EXPECT_EQ(*found, settings) << Describe(settings);
  }
  // Of databases that are older than the keys which are not there.
  const std::string first =
      "clean_up_radius: 1\nfollow_brightness: true\nmin_blob_pixels: 12\nmin_cover: 0\n"
      "min_difference: 8\nnoise_factor: 6\n";
  EXPECT_EQ(*read(first), (SegmentationSettings{.faint_difference = 0,
                                                .texture_difference = 0,
                                                .faint_side = 5,
                                                .keep_thin_parts = false}));
  EXPECT_EQ(*read(first + "faint_difference: 3\n"),
            (SegmentationSettings{.faint_difference = 3,
                                  .texture_difference = 0,
                                  .faint_side = 5,
                                  .keep_thin_parts = false}));
  EXPECT_TRUE(absl::IsNotFound(read("").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(read("blobs: 1\n").status()));
}

TEST(Segmentation, CellFileThatDiffersFromItsDatabaseIsToldWhatToWrite) {
  storage::v1::CellDescription database;
  database.set_segmentation(
      Describe({.faint_difference = 3, .texture_difference = 0, .faint_side = 5}));
  EXPECT_THAT(SegmentationAdvice({}, database),
              HasSubstr("'segmentation: {faint_difference: 3, faint_side: 5, "
                        "texture_difference: 0}'"));
  EXPECT_THAT(SegmentationAdvice({}, database), HasSubstr("silhouette-capture remask"));
  const auto settings = SegmentationIn("faint_difference: 3, faint_side: 5, texture_difference: 0",
                                       "the command line", {});
  ASSERT_TRUE(settings.ok()) << settings.status();
  EXPECT_EQ(SegmentationAdvice(*settings, database), "");
}

TEST(Segmentation, DatabaseWithoutThinPartsIsNotServedAsIfItHadThem) {
  storage::v1::CellDescription database;
  SegmentationSettings without;
  without.keep_thin_parts = false;
  database.set_segmentation(Describe(without));
  EXPECT_EQ(database.segmentation().find("thin"), std::string::npos) << "as it was captured then";
  EXPECT_THAT(SegmentationAdvice({}, database),
              HasSubstr("'segmentation: {keep_thin_parts: false}'"));
}

TEST(Segmentation, TextSaysWhatChangesAndRefusesWhatIsUnknown) {
  const SegmentationSettings usual{.min_difference = 5};
  EXPECT_EQ(
      *SegmentationIn("faint_side: 7, shadows: ignore", "--try", usual),
      (SegmentationSettings{.min_difference = 5, .faint_side = 7, .shadows = Shadows::kIgnore}));
  EXPECT_EQ(SegmentationIn("{faint_side: 7}", "--try", usual)->faint_side, 7);
  EXPECT_THAT(SegmentationIn("fant_side: 7", "--try", usual).status().message(),
              HasSubstr("did you mean 'faint_side'?"));
  EXPECT_THAT(SegmentationIn("x: 7", "--try", usual).status().message(),
              HasSubstr("known are 'clean_up_radius'"));
  EXPECT_FALSE(SegmentationIn("faint_side: 4", "--try", usual).ok());
}

}  // namespace
}  // namespace silhouette
