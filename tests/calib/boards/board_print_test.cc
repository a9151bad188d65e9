// SPDX-License-Identifier: Apache-2.0
// Boards as they come out of the printer: PNG and PDF.
#include <apriltag/apriltag.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "calib/boards/board_sheet.h"
#include "calib/boards/tag_family.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr double kDpi = 150;

Board BoardOf(const std::string& family, int rows, int columns, double tag_size, int first_id) {
  return Board({.name = "test",
                .family = family,
                .rows = rows,
                .columns = columns,
                .tag_size = tag_size,
                .gap = rows * columns > 1 ? 1.4 * tag_size : 0,
                .first_id = first_id});
}

cv::Mat Decoded(const std::string& png) {
  return cv::imdecode(std::vector<uint8_t>(png.begin(), png.end()), cv::IMREAD_GRAYSCALE);
}

// The tags of a page by id, with their corners in millimetres.
std::map<int, std::array<PagePoint, 4>> TagsOn(cv::Mat image, const std::string& family) {
  const AprilTagFamily library = TagFamily(family).Library();
  apriltag_detector_t* detector = apriltag_detector_create();
  apriltag_detector_add_family_bits(detector, library.get(), 0);
  image_u8_t view{image.cols, image.rows, static_cast<int>(image.step), image.data};
  zarray_t* detections = apriltag_detector_detect(detector, &view);
  std::map<int, std::array<PagePoint, 4>> tags;
  for (int i = 0; i < zarray_size(detections); ++i) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(detections, i, &detection);
    EXPECT_FALSE(tags.contains(detection->id)) << detection->id;
    for (int k = 0; k < 4; ++k) {
      tags[detection->id][k] = {detection->p[k][0] * 25.4 / kDpi, detection->p[k][1] * 25.4 / kDpi};
    }
  }
  apriltag_detections_destroy(detections);
  apriltag_detector_destroy(detector);
  return tags;
}

void ExpectTagsWhereTheyAreSaidToBe(const BoardSheet& sheet) {
  const std::string family = sheet.boards.front().board.description().family;
  const auto tags = TagsOn(Decoded(PngOf(PageOf(sheet), kDpi)), family);
  size_t expected = 0;
  for (const PlacedBoard& placed : sheet.boards) {
    const BoardDescription& d = placed.board.description();
    expected += placed.board.tags();
    for (int id = d.first_id; id < d.first_id + placed.board.tags(); ++id) {
      ASSERT_TRUE(tags.contains(id)) << family << " " << id;
      const MarkCorners corners = placed.board.CornersOf(id);
      for (int k = 0; k < 4; ++k) {
        EXPECT_NEAR(tags.at(id)[k].x, placed.origin.x + 1000 * corners[k].x(), 0.05) << id;
        EXPECT_NEAR(tags.at(id)[k].y, placed.origin.y + 1000 * corners[k].y(), 0.05) << id;
      }
    }
  }
  EXPECT_EQ(tags.size(), expected);
}

std::string RefusalOf(const Board& board, SheetKind kind, const std::string& paper) {
  try {
    LayOutSheets({board}, kind, 1, PapersFromText(paper));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(BoardPrint, TagsOfEveryFamilyAreDetectedWhereTheBoardSays) {
  for (const std::string& family : TagFamily::Names()) {
    const Board board = BoardOf(family, 2, 3, 0.03, 2);
    const auto sheets = LayOutSheets({board}, SheetKind::kBoard, 1, AutomaticPapers());
    ASSERT_EQ(sheets.size(), 1u);
    ExpectTagsWhereTheyAreSaidToBe(sheets.front());
  }
}

TEST(BoardPrint, BoardsThatAreNoLatticeAreDetectedToo) {
  const Board board({.name = "test", .rows = 3, .columns = 2, .tag_size = 0.03, .gap = 0.0255});
  const auto sheets = LayOutSheets({board}, SheetKind::kBoard, 1, AutomaticPapers());
  ExpectTagsWhereTheyAreSaidToBe(sheets.front());
}

TEST(BoardPrint, FlangeAndFloorTagsAreDetectedWhereTheBoardSays) {
  const Board flange = BoardOf("tagStandard41h12", 1, 1, 0.04, 100);
  ExpectTagsWhereTheyAreSaidToBe(
      LayOutSheets({flange}, SheetKind::kFlangeTag, 1, AutomaticPapers()).front());
  std::vector<Board> floor;
  for (int id = 7; id < 12; ++id) {
    floor.push_back(Board({.name = std::to_string(id), .tag_size = 0.03, .first_id = id}));
  }
  const auto sheets = LayOutSheets(floor, SheetKind::kFloorTag, 4, PapersFromText("A4"));
  ASSERT_EQ(sheets.size(), 2u);
  EXPECT_EQ(sheets[0].boards.size(), 4u);
  for (const BoardSheet& sheet : sheets) ExpectTagsWhereTheyAreSaidToBe(sheet);
}

TEST(BoardPrint, PdfHasThePapersSize) {
  const Board board = BoardOf("tagStandard41h12", 1, 1, 0.04, 0);
  const auto sheets = LayOutSheets({board}, SheetKind::kBoard, 1, PapersFromText("254x508 mm"));
  const std::string pdf = PdfOf({PageOf(sheets.front())});
  EXPECT_TRUE(pdf.starts_with("%PDF-"));
  EXPECT_THAT(pdf, HasSubstr("MediaBox [ 0 0 720 1440 ]"));
}

TEST(BoardPrint, PngHasThePapersSizeAndSaysItsResolution) {
  const Board board = BoardOf("tagStandard41h12", 1, 1, 0.04, 0);
  const auto sheets = LayOutSheets({board}, SheetKind::kBoard, 1, PapersFromText("127x254"));
  const std::string png = PngOf(PageOf(sheets.front()), 100);
  const cv::Mat image = Decoded(png);
  EXPECT_EQ(image.size(), cv::Size(500, 1000));
  // 3937 pixels per metre, both ways.
  EXPECT_THAT(png, HasSubstr(std::string("pHYs\0\0\x0f\x61\0\0\x0f\x61\1", 13)));
  EXPECT_THROW(PngOf(PageOf(sheets.front()), 4000), std::invalid_argument);
}

TEST(BoardPrint, SmallestPaperIsChosen) {
  const auto paper = [](double tag_size) {
    return LayOutSheets({BoardOf("tagStandard41h12", 4, 6, tag_size, 0)}, SheetKind::kBoard, 1,
                        AutomaticPapers())
        .front()
        .paper.name;
  };
  EXPECT_EQ(paper(0.010), "A4");
  EXPECT_EQ(paper(0.016), "A4 landscape");
  EXPECT_EQ(paper(0.025), "A3 landscape");
}

TEST(BoardPrint, NothingReachesIntoMarginsOrNotes) {
  for (const double tag_size : {0.010, 0.016, 0.025}) {
    const BoardSheet sheet = LayOutSheets({BoardOf("tagStandard41h12", 4, 6, tag_size, 0)},
                                          SheetKind::kBoard, 1, AutomaticPapers())
                                 .front();
    const PageBox& outline = sheet.boards.front().outline;
    EXPECT_GE(outline.left, 10);
    EXPECT_GE(outline.top, 10);
    EXPECT_LE(outline.right(), sheet.paper.width - 10);
    EXPECT_LE(outline.bottom(), sheet.paper.height - 10 - 17);
  }
}

TEST(BoardPrint, BoardsThatDoNotFitAreRefusedWithTheMend) {
  const std::string refusal =
      RefusalOf(BoardOf("tagStandard41h12", 4, 6, 0.03, 0), SheetKind::kBoard, "A4");
  EXPECT_THAT(refusal, AllOf(HasSubstr("A4 landscape has room for"), HasSubstr("--paper 'A2"),
                             HasSubstr("--tag-size 16 "), HasSubstr("fewer rows")));
  EXPECT_EQ(RefusalOf(BoardOf("tagStandard41h12", 4, 6, 0.016, 0), SheetKind::kBoard, "A4"), "");
}

TEST(BoardPrint, IdsBeyondTheFamilyAreRefused) {
  EXPECT_THAT(RefusalOf(BoardOf("tag16h5", 4, 8, 0.01, 0), SheetKind::kBoard, "A3"),
              HasSubstr("tag16h5 has only 0 to 29"));
  EXPECT_THAT(RefusalOf(BoardOf("tag36h11", 2, 2, 0.01, 0), SheetKind::kFlangeTag, "A3"),
              HasSubstr("single ones"));
}

TEST(Paper, IsNamedOrMeasured) {
  EXPECT_EQ(PapersFromText("A4").size(), 2u);
  EXPECT_EQ(PapersFromText("a3 LANDSCAPE").front().width, 420);
  EXPECT_EQ(PapersFromText("600x400").front().height, 400);
  EXPECT_EQ(PapersFromText("600.5 x 400 mm").front().width, 600.5);
  for (const char* wrong : {"A9", "", "10x10", "600x", "1.2.3x400", "600x-4"}) {
    EXPECT_THROW(PapersFromText(wrong), std::invalid_argument) << wrong;
  }
}

}  // namespace
}  // namespace silhouette
