#include "tools/silhouette-calibrate/run_tags.h"

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "absl/strings/str_cat.h"
#include "calib/detection/image_tags.h"

namespace silhouette {

namespace fs = std::filesystem;

std::vector<std::string> FamiliesOf(const std::vector<Board>& boards) {
  std::set<std::string> families;
  for (const Board& board : boards) families.insert(board.description().family);
  return {families.begin(), families.end()};
}

std::vector<TagSighting> TagsIn(const cv::Mat& image, const std::string& view,
                                const std::string& frame, const std::vector<Board>& boards,
                                const Lens& lens, TagDetector& detector) {
  cv::Mat grey = image;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  ImageTags tags = FindTags(detector, grey, lens, boards);
  tags.view = view;
  tags.frame = frame;
  return SightingsOf(tags);
}

absl::StatusOr<std::vector<TagSighting>> DetectAgain(const std::string& folder,
                                                     const std::vector<std::string>& frames,
                                                     const std::vector<std::string>& views,
                                                     const std::vector<CameraIntrinsics>& lenses,
                                                     const std::vector<Board>& boards) {
  TagDetector detector(FamiliesOf(boards));
  std::vector<TagSighting> sightings;
  for (const std::string& frame : frames) {
    for (size_t v = 0; v < views.size(); ++v) {
      const fs::path file = fs::path(folder) / "images" / views[v] / (frame + ".png");
      const cv::Mat image = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
      if (image.empty()) {
        return absl::NotFoundError(
            absl::StrCat("the image '", file.string(), "' of the session is not there any more"));
      }
      const auto found = TagsIn(image, views[v], frame, boards, Lens(lenses[v]), detector);
      sightings.insert(sightings.end(), found.begin(), found.end());
    }
  }
  return sightings;
}

}  // namespace silhouette
