// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/tag_detector.h"

#include <apriltag/apriltag.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "calib/boards/charuco.h"
#include "calib/boards/tag_family.h"
#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

// The blur mixes narrower borders too much for their edges to be fitted.
constexpr double kLeastBorderInBlurs = 3.5;
constexpr int kLeastImage = 16;     // pixels; the library hangs in smaller ones
constexpr double kUsualBlur = 0.7;  // pixels, if no edge could be fitted

double MeanSide(const PixelCorners& corners) {
  double sum = 0;
  for (int i = 0; i < 4; ++i) sum += (corners[i] - corners[(i + 1) % 4]).norm();
  return sum / 4;
}

double ShortestSide(const PixelCorners& corners) {
  double shortest = 1e9;
  for (int i = 0; i < 4; ++i) {
    shortest = std::min(shortest, (corners[i] - corners[(i + 1) % 4]).norm());
  }
  return shortest;
}

// The library puts the top left pixel's corner at the origin, not its centre.
PixelCorners CornersOf(const apriltag_detection_t& detection) {
  PixelCorners corners;
  for (int i = 0; i < 4; ++i) corners[i] = {detection.p[i][0] - 0.5, detection.p[i][1] - 0.5};
  return corners;
}

struct FoundMarker {
  int id = 0;
  PixelCorners corners;  // in the order of tags
};

std::vector<FoundMarker> FindMarkers(const std::string& dictionary, int border,
                                     const cv::Mat& image) {
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->markerBorderBits = border;
  std::vector<int> ids;
  std::vector<std::vector<cv::Point2f>> found;
  // To a pixel; OpenCV's refinement takes inner corners of small markers.
  cv::aruco::detectMarkers(image, ArucoDictionary(dictionary), found, ids, parameters);
  std::vector<FoundMarker> markers;
  for (size_t i = 0; i < ids.size(); ++i) {
    FoundMarker& marker = markers.emplace_back(FoundMarker{.id = ids[i], .corners = {}});
    for (size_t k = 0; k < 4; ++k) marker.corners[k] = {found[i][3 - k].x, found[i][3 - k].y};
  }
  return markers;
}

// The squares that Kalibr prints touch its tags' corners. They come apart where bright areas
// are grown by a pixel, at more blur by two.
constexpr int kMostGrown = 2;
// From this many tags of an AprilGrid the places of the others follow. Of small ones the library
// may see none.
constexpr size_t kEnoughTags = 2;
constexpr char kKalibrDictionary[] = "DICT_APRILTAG_36h11";

cv::Mat Grown(const cv::Mat& image, int pixels) {
  if (pixels == 0) return image;
  cv::Mat grown;
  cv::dilate(image, grown,
             cv::getStructuringElement(cv::MORPH_RECT, {2 * pixels + 1, 2 * pixels + 1}));
  return grown;
}

// Where the corners of a dark square are whose sides are farther out.
PixelCorners MovedOut(const PixelCorners& corners, double pixels) {
  PixelCorners moved = corners;
  for (int i = 0; i < 4; ++i) {
    for (const int next : {(i + 1) % 4, (i + 3) % 4}) {
      moved[i] += pixels * (corners[i] - corners[next]).normalized();
    }
  }
  return moved;
}

// Families in which tags differ by so few bits that a wrong one is soon taken for right are read
// without correction; correcting two bits would take gigabytes for the largest.
int CorrectedBits(const apriltag_family_t& family) { return family.h >= 9 ? 1 : 0; }

// The error of the library's own corners, as measured on rendered tags: the next modules' grey
// draws them out, the more so the less a module is wider than the blur; on large tags the lens
// bends the edges that it takes for straight.
double LibrarySigma(double size, double module, double blur) {
  const double ratio = module / blur;
  return std::hypot(0.05, 1.6 / (ratio * ratio), 0.0011 * size);
}

}  // namespace

struct TagDetector::Library {
  std::vector<TagFamily> dictionaries;
  std::vector<AprilTagFamily> families;
  std::map<const apriltag_family_t*, TagFamily> descriptions;
  bool kalibr = false;
  apriltag_detector_t* detector = apriltag_detector_create();

  ~Library() { apriltag_detector_destroy(detector); }
};

TagDetector::TagDetector(const std::vector<std::string>& families)
    : library_(std::make_unique<Library>()) {
  if (families.empty()) throw std::invalid_argument("no tag family is to be looked for");
  for (const std::string& name : families) {
    const TagFamily family(name);
    if (family.is_dictionary()) {
      library_->dictionaries.push_back(family);
      continue;
    }
    AprilTagFamily& added = library_->families.emplace_back(family.Library());
    library_->descriptions.emplace(added.get(), family);
    library_->kalibr = library_->kalibr || name == kKalibrFamily;
    apriltag_detector_add_family_bits(library_->detector, added.get(), CorrectedBits(*added));
  }
  library_->detector->quad_decimate = 1;
}

TagDetector::~TagDetector() = default;
TagDetector::TagDetector(TagDetector&&) noexcept = default;
TagDetector& TagDetector::operator=(TagDetector&&) noexcept = default;

std::vector<DetectedTag> TagDetector::Detect(const cv::Mat& image,
                                             const std::optional<CameraModel>& lens) {
  if (image.type() != CV_8UC1) throw std::invalid_argument("tags are looked for in grey images");
  if (std::min(image.cols, image.rows) < kLeastImage) return {};
  std::vector<DetectedTag> tags;
  std::vector<double> modules;
  std::vector<double> blurs;
  const auto add = [&](const TagFamily& family, int id, const PixelCorners& corners, bool sure) {
    const double module = ShortestSide(corners) / family.width_at_border();
    DetectedTag tag{
        .family = family.name(), .tag = id, .corners = {corners.begin(), corners.end()}};
    tag.size = MeanSide(corners);
    const double border = family.border() * module;
    const auto fitted = FitCorners(image, lens, corners, border);
    if (fitted && border > kLeastBorderInBlurs * fitted->blur) {
      tag.fitted = true;
      tag.corners.assign(fitted->corners.begin(), fitted->corners.end());
      tag.sigma = fitted->sigma;
      tag.blur = fitted->blur;
    }
    if (!sure && !tag.fitted) return;
    if (fitted) blurs.push_back(fitted->blur);
    modules.push_back(module);
    tags.push_back(std::move(tag));
  };
  for (const TagFamily& dictionary : library_->dictionaries) {
    for (const FoundMarker& marker : FindMarkers(dictionary.name(), 1, image)) {
      add(dictionary, marker.id, marker.corners, false);
    }
  }
  const int rounds = library_->families.empty() ? 0 : library_->kalibr ? 1 + kMostGrown : 1;
  for (int grown = 0; grown < rounds; ++grown) {
    std::set<std::pair<std::string, int>> known;
    for (const DetectedTag& tag : tags) known.emplace(tag.family, tag.tag);
    const cv::Mat searched = Grown(image, grown);
    image_u8_t view{searched.cols, searched.rows, static_cast<int>(searched.step), searched.data};
    zarray_t* detections = apriltag_detector_detect(library_->detector, &view);
    for (int i = 0; i < zarray_size(detections); ++i) {
      apriltag_detection_t* detection = nullptr;
      zarray_get(detections, i, &detection);
      const TagFamily& family = library_->descriptions.at(detection->family);
      if (grown > 0 &&
          (family.name() != kKalibrFamily || known.contains({family.name(), detection->id}))) {
        continue;
      }
      add(family, detection->id, MovedOut(CornersOf(*detection), grown), grown == 0);
    }
    apriltag_detections_destroy(detections);
  }
  std::set<int> kalibr;
  for (const DetectedTag& tag : tags) {
    if (tag.family == kKalibrFamily && tag.fitted) kalibr.insert(tag.tag);
  }
  if (library_->kalibr && kalibr.size() < kEnoughTags) {
    const TagFamily family(kKalibrFamily);
    for (FoundMarker& marker : FindMarkers(kKalibrDictionary, family.border(), image)) {
      // OpenCV has these tags upside down.
      std::rotate(marker.corners.begin(), marker.corners.begin() + 2, marker.corners.end());
      if (!kalibr.contains(marker.id)) add(family, marker.id, marker.corners, false);
    }
  }
  const double blur = Median(blurs, kUsualBlur);
  for (size_t i = 0; i < tags.size(); ++i) {
    if (!tags[i].fitted) tags[i].sigma = LibrarySigma(tags[i].size, modules[i], blur);
  }
  std::ranges::sort(tags, {}, [](const DetectedTag& tag) { return std::tie(tag.family, tag.tag); });
  return tags;
}

}  // namespace silhouette
