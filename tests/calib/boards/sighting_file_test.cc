// SPDX-License-Identifier: Apache-2.0
#include "calib/boards/sighting_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <stdexcept>

#include "absl/strings/str_replace.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

constexpr char kSightingFileFile[] =
    "frame,view,family,tag,corner,x,y,sigma\n"
    "0001,left,tag36h11,5,0,10,20,0.02\n"
    "0001,left,tag36h11,5,1,30,20,0.02\n"
    "0001,left,tag36h11,5,2,30,5.5,0.02\n"
    "0001,left,tag36h11,5,3,10,5.25,0.02\n";

std::string SightingFileMessageFor(const std::string& text) {
  return std::string(SightingsFromText(text, "corners.csv").status().message());
}

// The message for kSightingFileFile with `from` replaced.
std::string MessageForChanged(const std::string& from, const std::string& to) {
  const std::string text = absl::StrReplaceAll(kSightingFileFile, {{from, to}});
  EXPECT_NE(text, kSightingFileFile);
  return SightingFileMessageFor(text);
}

TEST(SightingFile, GivesSightings) {
  const auto sightings = SightingsFromText(kSightingFileFile, "corners.csv");
  ASSERT_TRUE(sightings.ok()) << sightings.status();
  ASSERT_EQ(sightings->size(), 1u);
  const TagSighting& tag = sightings->front();
  EXPECT_EQ(tag.frame, "0001");
  EXPECT_EQ(tag.view, "left");
  EXPECT_EQ(tag.family, "tag36h11");
  EXPECT_EQ(tag.tag, 5);
  EXPECT_EQ(tag.corners[2], Eigen::Vector2d(30, 5.5));
  EXPECT_EQ(tag.sigma, 0.02);
}

TEST(SightingFile, GivesBackWhatWasWrittenToTheLastBit) {
  Random random;
  std::uniform_real_distribution<double> pixel(-5, 4000);
  std::vector<TagSighting> written;
  for (const char* frame : {"2", "1", "a,b", " \"quoted\" "}) {
    for (int tag = 0; tag < 20; ++tag) {
      TagSighting sighting{.frame = frame, .view = "v, 1", .family = "tag36h11", .tag = tag};
      for (int i = 0; i < 4; ++i) sighting.corners.emplace_back(pixel(random), pixel(random));
      sighting.sigma = pixel(random) + 6;
      sighting.image = {1280, 960};
      written.push_back(sighting);
    }
  }
  const auto read = SightingsFromText(SightingFileText(written), "corners.csv");
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), written.size());
  for (size_t i = 0; i < written.size(); ++i) {
    EXPECT_EQ((*read)[i].frame, written[i].frame);
    EXPECT_EQ((*read)[i].view, written[i].view);
    EXPECT_EQ((*read)[i].family, written[i].family);
    EXPECT_EQ((*read)[i].tag, written[i].tag);
    EXPECT_EQ((*read)[i].corners, written[i].corners);
    EXPECT_EQ((*read)[i].sigma, written[i].sigma);
    EXPECT_EQ((*read)[i].image, written[i].image);
  }
}

TEST(SightingFile, TakesOtherOrdersAndLineEnds) {
  const auto sightings = SightingsFromText(
      "\xEF\xBB\xBFsigma,y,x,corner,tag,family,view,frame\r\n"
      "0.02,4,3,3,5,t,v,f\r\n\r\n0.02,2,2,2,5,t,\"v\",f\r\n0.02,1,1,1,5,t,v,f\r\n"
      "0.02,0,0,0,5,t,v,f",
      "corners.csv");
  ASSERT_TRUE(sightings.ok()) << sightings.status();
  ASSERT_EQ(sightings->size(), 1u);
  EXPECT_EQ(sightings->front().corners[3], Eigen::Vector2d(3, 4));
}

TEST(SightingFile, HeaderAloneIsNoSighting) {
  EXPECT_EQ(SightingFileMessageFor("frame,view,family,tag,corner,x,y,sigma\n"), "");
}

TEST(SightingFile, MistakesAreToldWithTheLine) {
  EXPECT_THAT(SightingFileMessageFor(""), HasSubstr("empty"));
  EXPECT_THAT(MessageForChanged("sigma", "sgima"),
              AllOf(StartsWith("corners.csv:1:"), HasSubstr("did you mean 'sigma'?")));
  EXPECT_THAT(MessageForChanged("frame,", ""), HasSubstr("'frame' is missing"));
  EXPECT_THAT(MessageForChanged("x,y", "x,x"), HasSubstr("'x' is there twice"));
  EXPECT_THAT(MessageForChanged("30,5.5,0.02", "30,5.5"),
              AllOf(StartsWith("corners.csv:4:"), HasSubstr("7 fields")));
  EXPECT_THAT(MessageForChanged("5.25", "nan"),
              AllOf(StartsWith("corners.csv:5:"), HasSubstr("not a finite number")));
  EXPECT_THAT(MessageForChanged("5.25", "inf"), HasSubstr("not a finite number"));
  EXPECT_THAT(MessageForChanged("5.25", "5,25"), HasSubstr("9 fields"));
  EXPECT_THAT(MessageForChanged("5.25", "five"), HasSubstr("not a finite number"));
  EXPECT_THAT(MessageForChanged("5.25,0.02", "5.25,0.03"), HasSubstr("different sigma"));
  EXPECT_THAT(MessageForChanged("0.02", "0"), HasSubstr("sigma 0"));
  EXPECT_THAT(MessageForChanged("5,3,10", "5,4,10"), HasSubstr("corners are 0 to 3"));
  EXPECT_THAT(MessageForChanged("5,3,10", "-5,3,10"), HasSubstr("not negative"));
  EXPECT_THAT(MessageForChanged("5,3,10", "5.5,3,10"), HasSubstr("not a whole number"));
  EXPECT_THAT(MessageForChanged("left", "\"left"), HasSubstr("double quotes"));
  EXPECT_THAT(MessageForChanged("left", ""), HasSubstr("the view is empty"));
}

TEST(SightingFile, SizesOfImagesMayBeMissing) {
  const auto without = SightingsFromText(kSightingFileFile, "corners.csv");
  EXPECT_EQ(ImageSizeOf(*without, "left"), std::nullopt);
  EXPECT_TRUE(CheckImageSize(*without, "left", {320, 240}, "its size").ok());
  // As it is written again.
  const auto again = SightingsFromText(SightingFileText(*without), "corners.csv");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(ImageSizeOf(*again, "left"), std::nullopt);
}

TEST(SightingFile, ImagesOfAViewThatDifferInSizeAreRefused) {
  const auto message = [](const std::string& size) {
    return SightingFileMessageFor(
        "frame,view,family,tag,corner,x,y,sigma,width,height\n"
        "1,left,chessboard-9x6,0,0,10,20,0.02,640,480\n"
        "1,right,chessboard-9x6,0,0,10,20,0.02,1280,960\n"
        "2,left,chessboard-9x6,0,0,11,21,0.03," +
        size + "\n");
  };
  EXPECT_EQ(message("640,480"), "");
  EXPECT_EQ(message("0,0"), "");  // not known
  EXPECT_THAT(message("480,640"),
              AllOf(StartsWith("corners.csv:4:"),
                    HasSubstr("different sizes: frame '1' 640x480, frame '2' 480x640")));
  EXPECT_THAT(message("640,0"), HasSubstr("image of 640x0 pixels"));
  EXPECT_THAT(message("-640,480"), HasSubstr("image of -640x480 pixels"));
  EXPECT_THAT(SightingFileMessageFor("frame,view,family,tag,corner,x,y,sigma,width\n"),
              HasSubstr("'height' is missing"));
}

TEST(SightingFile, RepeatedOrMissingCornersAreRefused) {
  EXPECT_THAT(MessageForChanged("5,3,10", "5,2,10"),
              AllOf(StartsWith("corners.csv:5:"), HasSubstr("corner 2 of tag 5 of tag36h11"),
                    HasSubstr("twice"), HasSubstr("corners.csv:2")));
  EXPECT_THAT(MessageForChanged("0001,left,tag36h11,5,3,10,5.25,0.02\n", ""),
              AllOf(StartsWith("corners.csv:2:"), HasSubstr("has no corner 3")));
}

TEST(SightingFile, CornersOfChessboardsAreMarksOfTheirOwn) {
  const std::string corners =
      "frame,view,family,tag,corner,x,y,sigma,width,height\n"
      "1,left,chessboard-9x6,0,0,10,20,0.02,640,480\n"
      "1,left,chessboard-9x6,7,0,11,21,0.03,640,480\n";
  const auto sightings = SightingsFromText(corners, "corners.csv");
  ASSERT_TRUE(sightings.ok()) << sightings.status();
  ASSERT_EQ(sightings->size(), 2u);
  EXPECT_EQ((*sightings)[1].tag, 7);
  EXPECT_THAT((*sightings)[1].corners, testing::ElementsAre(Eigen::Vector2d(11, 21)));
  EXPECT_EQ(SightingFileText(*sightings), corners);
}

TEST(SightingFile, ATagWithOneCornerAmongTagsIsRefused) {
  const std::string rest = kSightingFileFile;
  EXPECT_THAT(SightingFileMessageFor(rest + "0002,left,tag36h11,5,0,10,5.25,0.02\n"),
              HasSubstr("a tag has four"));
}

TEST(SightingFile, WhatCouldNotBeReadIsNotWritten) {
  const TagSighting good{.frame = "f",
                         .view = "v",
                         .family = "t",
                         .corners = std::vector<Eigen::Vector2d>(4, Eigen::Vector2d(1, 2)),
                         .sigma = 1};
  const auto refused = [&](auto change) {
    TagSighting bad = good;
    change(bad);
    EXPECT_THROW(SightingFileText(std::vector{bad}), std::invalid_argument);
  };
  EXPECT_NO_THROW(SightingFileText(std::vector{good}));
  refused([](TagSighting& s) { s.frame.clear(); });
  refused([](TagSighting& s) { s.view = "a\nb"; });
  refused([](TagSighting& s) { s.tag = -1; });
  refused([](TagSighting& s) { s.sigma = 0; });
  refused([](TagSighting& s) { s.corners.clear(); });
  refused([](TagSighting& s) { s.corners.resize(3); });
  refused([](TagSighting& s) { s.corners[1].x() = std::numeric_limits<double>::quiet_NaN(); });
}

}  // namespace
}  // namespace silhouette
