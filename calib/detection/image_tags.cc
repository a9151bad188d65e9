// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/image_tags.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "absl/hash/hash.h"
#include "absl/strings/string_view.h"
#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

constexpr double kRim = 4;          // pixels
constexpr double kSamePlace = 0.5;  // pixels

uint64_t DigestOf(const cv::Mat& image) {
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  return absl::HashOf(absl::string_view(whole.ptr<char>(), whole.total()));
}

const Board* BoardOf(const DetectedTag& tag, std::span<const Board> boards) {
  for (const Board& board : boards) {
    if (board.HasTag(tag.family, tag.tag)) return &board;
  }
  return nullptr;
}

bool AtRim(const DetectedTag& tag, const cv::Size& size) {
  for (const Eigen::Vector2d& corner : tag.corners) {
    if (corner.minCoeff() < kRim || corner.x() > size.width - 1 - kRim ||
        corner.y() > size.height - 1 - kRim) {
      return true;
    }
  }
  return false;
}

// Chessboards and circles look the same mirrored.
bool ShowsBoardsMirrored(BoardDetector& detector, const cv::Mat& image) {
  if (std::ranges::all_of(detector.boards(), [](const Board& board) {
        const BoardDescription& d = board.description();
        return d.kind == BoardKind::kChessboard || d.kind == BoardKind::kCircles;
      })) {
    return false;
  }
  cv::Mat mirrored;
  cv::flip(image, mirrored, 1);
  const std::vector<DetectedTag> tags = detector.Detect(mirrored);
  return std::ranges::any_of(
      tags, [&](const DetectedTag& tag) { return BoardOf(tag, detector.boards()) != nullptr; });
}

}  // namespace

double ImageTags::MeanSize() const {
  double sum = 0;
  for (const DetectedTag& tag : tags) sum += tag.size;
  return tags.empty() ? 0 : sum / static_cast<double>(tags.size());
}

double ImageTags::MedianBlur() const {
  std::vector<double> blurs;
  for (const DetectedTag& tag : tags) {
    if (tag.fitted && tag.blur > 0) blurs.push_back(tag.blur);
  }
  return Median(std::move(blurs));
}

double ImageTags::TypicalSigma() const {
  double sum = 0;
  for (const DetectedTag& tag : tags) sum += tag.sigma * tag.sigma;
  return tags.empty() ? 0 : std::sqrt(sum / static_cast<double>(tags.size()));
}

ImageTags FindTags(BoardDetector& detector, const cv::Mat& image,
                   const std::optional<CameraModel>& lens) {
  ImageTags found;
  found.size = image.size();
  found.digest = DigestOf(image);
  std::map<std::pair<std::string, int>, int> times;
  std::set<const Board*> seen;
  std::vector<DetectedTag> all = detector.Detect(image, lens);
  for (const DetectedTag& tag : all) ++times[{tag.family, tag.tag}];
  for (DetectedTag& tag : all) {
    const Board* board = BoardOf(tag, detector.boards());
    if (board == nullptr) {
      found.foreign.push_back(std::move(tag));
    } else if (times[{tag.family, tag.tag}] > 1) {
      found.ambiguous.push_back(std::move(tag));
    } else {
      if (seen.insert(board).second) found.expected += board->tags();
      found.at_rim += AtRim(tag, found.size) ? 1 : 0;
      found.tags.push_back(std::move(tag));
    }
  }
  if (all.empty()) found.mirrored = ShowsBoardsMirrored(detector, image);
  return found;
}

std::vector<TagSighting> SightingsOf(const ImageTags& image) {
  std::vector<TagSighting> sightings;
  for (const DetectedTag& tag : image.tags) {
    sightings.push_back({.frame = image.frame,
                         .view = image.view,
                         .family = tag.family,
                         .tag = tag.tag,
                         .corners = tag.corners,
                         .sigma = tag.sigma,
                         .image = {image.size.width, image.size.height}});
  }
  return sightings;
}

bool ShowTheSame(const ImageTags& a, const ImageTags& b) {
  if (a.view != b.view || a.tags.empty() || a.tags.size() != b.tags.size()) return false;
  for (size_t i = 0; i < a.tags.size(); ++i) {
    if (a.tags[i].family != b.tags[i].family || a.tags[i].tag != b.tags[i].tag) return false;
    for (size_t k = 0; k < a.tags[i].corners.size(); ++k) {
      if ((a.tags[i].corners[k] - b.tags[i].corners[k]).norm() > kSamePlace) return false;
    }
  }
  return true;
}

void Coverage::Add(const ImageTags& image) {
  size_ = image.size;
  for (const DetectedTag& tag : image.tags) {
    corners_.insert(corners_.end(), tag.corners.begin(), tag.corners.end());
  }
}

int Coverage::Count(int column, int row) const {
  int count = 0;
  for (const Eigen::Vector2d& corner : corners_) {
    const int x = static_cast<int>((corner.x() + 0.5) * kColumns / size_.width);
    const int y = static_cast<int>((corner.y() + 0.5) * kRows / size_.height);
    count += std::clamp(x, 0, kColumns - 1) == column && std::clamp(y, 0, kRows - 1) == row;
  }
  return count;
}

double Coverage::Share() const {
  int covered = 0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) covered += Count(column, row) > 0 ? 1 : 0;
  }
  return static_cast<double>(covered) / (kColumns * kRows);
}

}  // namespace silhouette
