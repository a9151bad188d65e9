// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/missed_tags.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "calib/boards/charuco.h"
#include "calib/boards/tag_family.h"
#include "calib/detection/corner_fit.h"

namespace silhouette {
namespace {

using Eigen::Vector2d;

// The tags that say where one near them is.
constexpr size_t kMostTagsNear = 4;
constexpr size_t kLeastTagsNear = 2;
// A corner is looked for so far from there, as a share of the gap.
constexpr double kGapSearched = 0.4;
constexpr double kRimLeft = 4;  // pixels between a tag's corners and the image's rim
// Grey values between a tag's white and its black modules.
constexpr double kLeastModuleContrast = 15;
// Modules between its corners that may look wrong. Two of Kalibr's tags differ in eleven and more.
constexpr int kMostWrongModules = 3;

int MostWrongModules(const TagFamily& family) {
  if (!family.is_dictionary()) return kMostWrongModules;
  return std::min(kMostWrongModules, ArucoDictionary(family.name())->maxCorrectionBits);
}

// A corner on the board, metres, and where it is seen, undistorted pixels.
struct KnownCorner {
  Vector2d on_board;
  Vector2d seen;
};
using KnownTag = std::array<KnownCorner, 4>;

cv::Point2d CvPoint(const Vector2d& at) { return {at.x(), at.y()}; }

class PlaneMap {
 public:
  // Of at least four corners, no three of which are on a line. Empty if there is none.
  explicit PlaneMap(std::span<const KnownCorner> corners) {
    std::vector<cv::Point2d> from;
    std::vector<cv::Point2d> to;
    for (const KnownCorner& corner : corners) {
      from.push_back(CvPoint(corner.on_board));
      to.push_back(CvPoint(corner.seen));
    }
    matrix_ = cv::findHomography(from, to);
  }
  bool empty() const { return matrix_.empty(); }
  Vector2d operator()(const Vector2d& at) const {
    const cv::Matx31d mapped = cv::Matx33d(matrix_) * cv::Matx31d(at.x(), at.y(), 1);
    return Vector2d(mapped(0), mapped(1)) / mapped(2);
  }

 private:
  cv::Mat matrix_;
};

std::optional<KnownTag> Known(const Board& board, const std::optional<CameraModel>& lens,
                              const DetectedTag& tag) {
  if (!board.HasTag(tag.family, tag.tag)) return std::nullopt;
  const MarkCorners corners = board.CornersOf(tag.tag);
  KnownTag known;
  for (size_t i = 0; i < known.size(); ++i) {
    const auto seen = Undistorted(lens, tag.corners[i]);
    if (!seen) return std::nullopt;
    known[i] = {corners[i].head<2>(), *seen};
  }
  return known;
}

std::optional<PlaneMap> MapNear(std::vector<KnownTag> tags, const Vector2d& at) {
  const size_t near = std::min(kMostTagsNear, tags.size());
  std::ranges::partial_sort(tags, tags.begin() + static_cast<std::ptrdiff_t>(near), {},
                            [&](const KnownTag& t) { return (t[0].on_board - at).norm(); });
  std::vector<KnownCorner> corners;
  for (const KnownTag& tag : std::span(tags).first(near)) {
    corners.insert(corners.end(), tag.begin(), tag.end());
  }
  PlaneMap map(corners);
  return map.empty() ? std::nullopt : std::optional(std::move(map));
}

// Where a tag's corners should be, moved to where black tag and black square meet. Pixels.
std::optional<PixelCorners> CornersNear(const cv::Mat& image,
                                        const std::optional<CameraModel>& lens, const PlaneMap& map,
                                        const MarkCorners& corners, double gap_in_tags) {
  std::vector<cv::Point2f> at;
  for (const Eigen::Vector3d& corner : corners) {
    const auto pixel = Distorted(lens, map(corner.head<2>()));
    if (!pixel || !(pixel->minCoeff() >= kRimLeft && pixel->x() <= image.cols - 1 - kRimLeft &&
                    pixel->y() <= image.rows - 1 - kRimLeft)) {
      return std::nullopt;
    }
    at.emplace_back(static_cast<float>(pixel->x()), static_cast<float>(pixel->y()));
  }
  const double side = cv::norm(at[1] - at[0]);
  const int reach = std::clamp(static_cast<int>(kGapSearched * gap_in_tags * side), 2, 8);
  std::vector<cv::Point2f> moved = at;
  cv::cornerSubPix(image, moved, {reach, reach}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 40, 1e-3});
  PixelCorners found;
  for (size_t i = 0; i < 4; ++i) {
    if (cv::norm(moved[i] - at[i]) > reach) return std::nullopt;
    found[i] = {moved[i].x, moved[i].y};
  }
  return found;
}

// Whether the modules between the corners are those of the tag `id`.
bool ShowsTag(const cv::Mat& image, const std::optional<CameraModel>& lens, const TagFamily& family,
              int id, const PixelCorners& corners) {
  const int width = family.width_at_border();
  std::array<KnownCorner, 4> square;
  for (size_t i = 0; i < 4; ++i) {
    const auto seen = Undistorted(lens, corners[i]);
    if (!seen) return false;
    square[i] = {Vector2d(i == 1 || i == 2 ? width : 0, i < 2 ? width : 0), *seen};
  }
  const PlaneMap map(square);
  if (map.empty()) return false;
  const TagModules modules = family.Modules(id);
  const int rim = (family.total_width() - width) / 2;
  std::vector<double> greys[2];  // of those that should be black, white
  for (int row = 0; row < width; ++row) {
    for (int column = 0; column < width; ++column) {
      const auto pixel = Distorted(lens, map(Vector2d(column + 0.5, row + 0.5)));
      if (!pixel) return false;
      const int x = std::clamp(static_cast<int>(std::lround(pixel->x())), 0, image.cols - 1);
      const int y = std::clamp(static_cast<int>(std::lround(pixel->y())), 0, image.rows - 1);
      greys[modules.White(column + rim, row + rim) ? 1 : 0].push_back(image.at<uint8_t>(y, x));
    }
  }
  double means[2] = {};
  for (int white = 0; white < 2; ++white) {
    for (const double grey : greys[white]) {
      means[white] += grey / static_cast<double>(greys[white].size());
    }
  }
  if (means[1] - means[0] < kLeastModuleContrast) return false;
  const double limit = (means[0] + means[1]) / 2;
  const auto wrong = std::ranges::count_if(greys[0], [&](double grey) { return grey > limit; }) +
                     std::ranges::count_if(greys[1], [&](double grey) { return grey <= limit; });
  return wrong <= MostWrongModules(family);
}

}  // namespace

std::vector<DetectedTag> MissedTags(const Board& board, const cv::Mat& image,
                                    const std::optional<CameraModel>& lens,
                                    std::span<const DetectedTag> found) {
  const TagFamily family(board.family());
  const double border = static_cast<double>(family.border()) / family.width_at_border();
  const double gap_in_tags = board.description().gap / board.description().tag_size;
  std::vector<KnownTag> known;
  std::vector<bool> has(static_cast<size_t>(board.tags()));
  const auto add = [&](const DetectedTag& tag) {
    const auto corners = Known(board, lens, tag);
    if (!corners) return;
    known.push_back(*corners);
    has[static_cast<size_t>(tag.tag - board.first_mark())] = true;
  };
  for (const DetectedTag& tag : found) add(tag);
  std::vector<DetectedTag> missed;
  // Those that are found say where their neighbours are.
  for (size_t before = 0; known.size() >= kLeastTagsNear && known.size() != before;) {
    before = known.size();
    for (int id = board.first_mark(); board.HasTag(id); ++id) {
      if (has[static_cast<size_t>(id - board.first_mark())]) continue;
      const MarkCorners corners = board.CornersOf(id);
      const auto map = MapNear(known, corners[0].head<2>());
      if (!map) continue;
      const auto near = CornersNear(image, lens, *map, corners, gap_in_tags);
      if (!near || !ShowsTag(image, lens, family, id, *near)) continue;
      double side = 0;
      for (size_t i = 0; i < 4; ++i) side += ((*near)[i] - (*near)[(i + 1) % 4]).norm() / 4;
      const auto fitted = FitCorners(image, lens, *near, border * side);
      if (!fitted) continue;
      missed.push_back({.family = board.family(),
                        .tag = id,
                        .corners = {fitted->corners.begin(), fitted->corners.end()},
                        .sigma = fitted->sigma,
                        .size = side,
                        .fitted = true,
                        .blur = fitted->blur});
      add(missed.back());
    }
  }
  return missed;
}

}  // namespace silhouette
