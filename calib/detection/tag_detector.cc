// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/tag_detector.h"

#include <apriltag/apriltag.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <tuple>

#include "calib/boards/tag_family.h"
#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

// The blur mixes narrower modules too much for their edges to be fitted.
constexpr double kLeastModuleInBlurs = 3.5;
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

// The corners before a 3 x 3 dilation of white moved the sides inward (`sign` 1) or outward (-1).
PixelCorners WithRim(const PixelCorners& corners, double sign) {
  const Eigen::Vector2d middle = (corners[0] + corners[1] + corners[2] + corners[3]) / 4;
  std::array<Eigen::Vector2d, 4> normals;  // outward, of the side from each corner to the next
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector2d along = corners[(i + 1) % 4] - corners[i];
    const Eigen::Vector2d normal = Eigen::Vector2d(along.y(), -along.x()).normalized();
    normals[i] = normal.dot(corners[i] - middle) > 0 ? normal : Eigen::Vector2d(-normal);
  }
  PixelCorners before;
  for (int i = 0; i < 4; ++i) {
    Eigen::Matrix2d sides;
    sides << normals[(i + 3) % 4].transpose(), normals[i].transpose();
    // A side moves by as much as the 3 x 3 pixels reach along its normal.
    const Eigen::Vector2d reach(normals[(i + 3) % 4].lpNorm<1>(), normals[i].lpNorm<1>());
    before[i] = corners[i] + sign * (sides.inverse() * reach);
  }
  return before;
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
  std::vector<AprilTagFamily> families;
  std::map<const apriltag_family_t*, TagFamily> descriptions;
  bool has_touching = false;  // tags whose corners touch other black
  apriltag_detector_t* detector = apriltag_detector_create();

  ~Library() { apriltag_detector_destroy(detector); }
};

TagDetector::TagDetector(const std::vector<std::string>& families)
    : library_(std::make_unique<Library>()) {
  if (families.empty()) throw std::invalid_argument("no tag family is to be looked for");
  for (const std::string& name : families) {
    const TagFamily family(name);
    library_->has_touching = library_->has_touching || name == kKalibrFamily;
    AprilTagFamily& added = library_->families.emplace_back(family.Library());
    library_->descriptions.emplace(added.get(), family);
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
  // The squares at the corners of Kalibr's tags touch them. Without a rim of a pixel they do not.
  const bool touching = library_->has_touching;
  cv::Mat thinned = image;
  if (touching) cv::dilate(image, thinned, cv::Mat());
  image_u8_t view{thinned.cols, thinned.rows, static_cast<int>(thinned.step), thinned.data};
  zarray_t* detections = apriltag_detector_detect(library_->detector, &view);
  std::vector<DetectedTag> tags;
  std::vector<double> modules;
  std::vector<double> blurs;
  for (int i = 0; i < zarray_size(detections); ++i) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(detections, i, &detection);
    const TagFamily& family = library_->descriptions.at(detection->family);
    PixelCorners corners = CornersOf(*detection);
    if (touching) corners = WithRim(corners, family.reversed_border() ? -1 : 1);
    DetectedTag tag{
        .family = family.name(), .tag = detection->id, .corners = {corners.begin(), corners.end()}};
    tag.size = MeanSide(corners);
    modules.push_back(ShortestSide(corners) / family.width_at_border());
    if (const auto fitted = FitCorners(image, lens, corners, modules.back())) {
      blurs.push_back(fitted->blur);
      if (modules.back() > kLeastModuleInBlurs * fitted->blur) {
        tag.fitted = true;
        tag.corners.assign(fitted->corners.begin(), fitted->corners.end());
        tag.sigma = fitted->sigma;
        tag.blur = fitted->blur;
      }
    }
    tags.push_back(std::move(tag));
  }
  apriltag_detections_destroy(detections);
  const double blur = Median(blurs, kUsualBlur);
  for (size_t i = 0; i < tags.size(); ++i) {
    if (!tags[i].fitted) tags[i].sigma = LibrarySigma(tags[i].size, modules[i], blur);
  }
  std::ranges::sort(tags, {}, [](const DetectedTag& tag) { return std::tie(tag.family, tag.tag); });
  return tags;
}

}  // namespace silhouette
