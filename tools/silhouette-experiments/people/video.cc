// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/video.h"

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/picture/picture.h"
#include "common/picture/sheet.h"
#include "common/picture/text.h"

namespace silhouette::people_experiment {
namespace {

// Pixels.
constexpr int kColumns = 2;
constexpr int kViewWidth = 400;
constexpr int kViewHeight = 300;
constexpr int kLine = 24;
constexpr int kMargin = 8;
constexpr int kTextHeight = 16;
constexpr double kOpacity = 0.5;

cv::Size SizeOf(size_t views) {
  const int rows = (static_cast<int>(views) + kColumns - 1) / kColumns;
  return {kColumns * kViewWidth, rows * kViewHeight + 2 * kLine};
}

Picture PictureOf(const CameraImage& image, const Scene* scene, size_t view) {
  Picture picture = PictureOfPixels(image.width, image.height, image.channels, image.pixels);
  if (scene != nullptr && scene->obstacle_images[view]) {
    const ObstacleImage& seen = *scene->obstacle_images[view];
    picture = WithVeil(picture, seen.unknown(), palette::kUnknown, kOpacity);
    picture = WithVeil(picture, seen.error(), palette::kError, kOpacity);
    picture = WithVeil(picture, seen.obstacle(), palette::kObstacle, kOpacity);
  }
  return FittedInto(picture, kViewWidth, kViewHeight);
}

}  // namespace

absl::StatusOr<Video> Video::Open(const std::string& path, size_t views, double rate) {
  int codec = 0;
  if (absl::EndsWith(path, ".mp4")) {
    codec = cv::VideoWriter::fourcc('a', 'v', 'c', '1');
  } else if (absl::EndsWith(path, ".avi")) {
    codec = cv::VideoWriter::fourcc('M', 'J', 'P', 'G');
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat("the video '", path, "' must end with .mp4 or .avi"));
  }
  cv::VideoWriter writer(path, codec, rate, SizeOf(views));
  if (!writer.isOpened()) {
    return absl::UnavailableError(absl::StrCat("the video '", path,
                                               "' cannot be written: is its folder there, and has ",
                                               "OpenCV this codec? .avi needs none"));
  }
  return Video(std::move(writer), views);
}

void Video::Add(const Sight& sight, const std::string& first_line, const std::string& second_line) {
  const cv::Size size = SizeOf(views_);
  Picture sheet = BlankPicture(size.width, size.height);
  for (size_t view = 0; view < sight.images.size(); ++view) {
    const int column = static_cast<int>(view) % kColumns;
    const int row = static_cast<int>(view) / kColumns;
    PictureOf(sight.images[view], sight.scene.get(), view)
        .copyTo(sheet(cv::Rect(column * kViewWidth, row * kViewHeight, kViewWidth, kViewHeight)));
  }
  const int below = size.height - 2 * kLine;
  DrawText(sheet, first_line, {kMargin, below + kLine / 2}, {.height = kTextHeight});
  DrawText(sheet, second_line, {kMargin, below + kLine + kLine / 2}, {.height = kTextHeight});
  DrawLegend(
      sheet,
      {{palette::kObstacle, "obstacle"}, {palette::kUnknown, "robot"}, {palette::kError, "error"}},
      size.width - kViewWidth + kMargin, below + kLine, kViewWidth - 2 * kMargin);
  writer_.write(sheet);
}

}  // namespace silhouette::people_experiment
