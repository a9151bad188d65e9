// SPDX-License-Identifier: Apache-2.0
// silhouette-capture tune, as its user runs it.
#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/capture/session/program_cell.h"

namespace silhouette {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

nlohmann::json TuneProgramJson(const std::string& text) {
  return nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
}

TEST(Tune, TellsWhatOtherSettingsWouldFindAndChangesNothing) {
  ProgramCell cell;
  cell.CaptureAll();
  const auto before = cell.Content();
  const Outcome outcome = cell.Run(cell.Arguments(
      "tune", {"--try", "min_difference: 200, faint_difference: 0, texture_difference: 0", "--try",
               "faint_side: 7", "--most", "2", "--out", cell / "tune", "--format", "json"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json json = TuneProgramJson(outcome.out);
  ASSERT_THAT(json["variants"], SizeIs(3));
  ASSERT_THAT(json["images"], SizeIs(2 * 2));
  const nlohmann::json& now = json["variants"][0];
  EXPECT_GT(now["foreground"], 0);
  EXPECT_EQ(now["gained"], 0);
  // The recorded masks were made with these very settings.
  EXPECT_EQ(now["recorded_added"], 0);
  EXPECT_EQ(now["recorded_removed"], 0);
  const nlohmann::json& blind = json["variants"][1];
  EXPECT_EQ(blind["cell_file_line"],
            "segmentation: {faint_difference: 0, min_difference: 200, texture_difference: 0}");
  EXPECT_GT(blind["lost"], 0);
  EXPECT_GT(blind["recorded_removed"], 0);
  EXPECT_EQ(now["foreground"].get<int>() - blind["lost"].get<int>() + blind["gained"].get<int>(),
            blind["foreground"]);
  EXPECT_EQ(cell.Content(), before);
  EXPECT_THAT(ReadText(cell / "tune/tune.html"), HasSubstr("data:image/png;base64,"));
  for (const nlohmann::json& image : json["images"]) {
    EXPECT_GT(cv::imread(cell / ("tune/" + image["sheet"].get<std::string>())).cols, 300);
  }
}

TEST(Tune, AllThatIsFoundInTheEmptyCellIsFalse) {
  ProgramCell cell;
  cell.CaptureAll();
  // The cell without anything in it, but for a patch and a speck in one view.
  std::filesystem::create_directory(cell / "empty");
  const auto database = Database::Open(cell.database(), Database::Access::kRead);
  const auto references = (*database)->Read()->References();
  ASSERT_TRUE(references.ok() && references->has_value());
  for (int v = 0; v < 2; ++v) {
    const std::string& png = (*references)->views(v).mean_png();
    const cv::Mat mean =
        cv::imdecode(std::vector<uint8_t>(png.begin(), png.end()), cv::IMREAD_UNCHANGED);
    cv::Mat image;
    mean.convertTo(image, CV_8U, 1.0 / 256);
    if (v == 0) image(cv::Rect(40, 40, 16, 12)) = cv::Scalar::all(255);
    if (v == 0) image(cv::Rect(100, 80, 3, 3)) = cv::Scalar::all(255);
    cv::imwrite(cell / (v == 0 ? "empty/top.png" : "empty/front.png"), image);
  }
  const Outcome outcome = cell.Run(cell.Arguments(
      "tune", {"--empty", cell / "empty", "--most", "0", "--try", "min_blob_pixels: 1000", "--out",
               cell / "tune", "--format", "json"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json json = TuneProgramJson(outcome.out);
  EXPECT_NEAR(json["variants"][0]["false_share"].get<double>(), 16.0 * 12 / (2 * 160 * 120), 1e-3);
  EXPECT_EQ(json["variants"][1]["false_share"], 0);

  const Outcome worse =
      cell.Run(cell.Arguments("tune", {"--empty", cell / "empty", "--most", "0", "--try",
                                       "min_blob_pixels: 1", "--out", cell / "tune"}));
  EXPECT_THAT(worse.out, HasSubstr("'min_blob_pixels: 1' is worse"));
}

TEST(Tune, WithoutTriesItSweepsAndSaysHowToLookCloser) {
  ProgramCell cell;
  cell.CaptureAll();
  const Outcome outcome = cell.Run(cell.Arguments("tune", {"--most", "1"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* said : {"the database's", "min_difference: 4", "min_difference: 16",
                           "shadows: ignore", "look closer", "cell.lmdb.tune/tune.html"}) {
    EXPECT_THAT(outcome.out, HasSubstr(said));
  }
}

TEST(Tune, SaysWhichLineAndWhichCommandUseWhatWasTried) {
  ProgramCell cell;
  cell.WriteCell({{"commit_interval: 20 ms", "commit_interval: 20 ms\n  raw_images: all"}});
  cell.CaptureAll();
  Outcome outcome = cell.Run(cell.Arguments("tune", {"--most", "1", "--try", "faint_side: 7"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("segmentation: {faint_side: 7}"));
  EXPECT_THAT(outcome.out, HasSubstr("silhouette-capture remask --cell"));
}

TEST(Tune, MistakesAreToldInASentence) {
  ProgramCell cell;
  cell.WriteCell({{"commit_interval: 20 ms", "commit_interval: 20 ms\n  raw_images: none"}});
  cell.CaptureAll();
  const auto fails = [&](const std::vector<std::string>& more, const std::string& said) {
    const Outcome outcome = cell.Run(cell.Arguments("tune", more));
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    EXPECT_THAT(outcome.err, HasSubstr(said));
  };
  fails({}, "has no raw images: capture with 'raw_images: sentinels'");
  fails({"--try", "x: 1"}, "known are 'clean_up_radius'");
  fails({"--try", "faint_side: 9"}, "changes nothing");
  fails({"--images", cell / "nowhere"}, "they are called top.png, front.png");
  std::filesystem::create_directory(cell / "images");
  WriteText(cell / "images/top.png", "no image");
  fails({"--images", cell / "images"}, "is no image that can be read");
}

}  // namespace
}  // namespace silhouette
