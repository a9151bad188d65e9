// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/image_condition.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace silhouette {
namespace {

constexpr int kBlock = 8;             // pixels of the outline per side
constexpr double kKnownShare = 0.75;  // of a block's pixels
constexpr size_t kFewestOutlineBlocks = 6;
// More foreground than this share of a block, and it may show something else than the cell. Slopes
// reach kSlopeReach pixels.
constexpr double kMostHidden = 0.1;
constexpr int kSlopeReach = 2;
// A block's structure hardly ever is there by chance.
constexpr size_t kFewestVisibleBlocks = 2;
// Grey levels per pixel of the outline, root mean square: less is no structure.
constexpr double kLeastSlope = 0.5;
constexpr float kOutlineDarkest = 12;
// With less of its structure in place, an image may be another view's, or have moved far.
constexpr double kMostInPlace = 0.5;
// With less than that it is looked for, which takes some milliseconds.
constexpr double kHardlyInPlace = 0.35;
// Share of the blocks that must be found elsewhere.
constexpr double kFoundElsewhere = 0.4;
// Blocks that correlate less say nothing of where their structure is.
constexpr double kLeastForShift = 0.5;
constexpr int kShiftRounds = 8;
constexpr double kLeftOver = 1;   // grey levels; blocks with more left have little weight
constexpr double kFirmness = 20;  // square grey levels: against a shift where hardly anything tells
constexpr double kTurnUnit = 20;  // pixels from the image's middle at which a turn is measured
constexpr int kFarthest = 8;      // pixels of the outline: shifts that are tried

cv::Mat Small(const cv::Mat& image, int scale) {
  cv::Mat small;
  cv::resize(image, small, {image.cols / scale, image.rows / scale}, 0, 0, cv::INTER_AREA);
  return small;
}

cv::Mat SmallGrey(const cv::Mat& image, int scale) {
  cv::Mat small = Grey(Small(image, scale));
  small.convertTo(small, CV_32F);
  return small;
}

cv::Mat Smoothed(const cv::Mat& image) {
  cv::Mat smooth;
  cv::GaussianBlur(image, smooth, {5, 5}, 1, 1, cv::BORDER_REPLICATE);
  return smooth;
}

void SlopesOf(const cv::Mat& image, cv::Mat& x, cv::Mat& y) {
  const cv::Matx13f across(-0.5F, 0, 0.5F);
  cv::filter2D(image, x, CV_32F, across, {-1, -1}, 0, cv::BORDER_REPLICATE);
  cv::filter2D(image, y, CV_32F, across.t(), {-1, -1}, 0, cv::BORDER_REPLICATE);
}

double MedianOfLevels(std::vector<float>& values, double of_nothing) {
  if (values.empty()) return of_nothing;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Normal equations of a block: by how much a shift (x, y) and a turn about the image's middle
// explain what the image differs from the outline. Means are taken out: they are light.
struct BlockSums {
  cv::Matx33d squares = cv::Matx33d::zeros();
  cv::Vec3d products = {0, 0, 0};
  double difference = 0;  // its square
  double count = 0;

  double LeftAt(const cv::Vec3d& move) const {
    const double left = difference - 2 * move.dot(products) + move.dot(squares * move);
    return std::sqrt(std::max(0.0, left) / count);
  }
};

}  // namespace

Outline::Outline(const Reference& reference)
    : image_size_(reference.size()),
      scale_(std::max(1, static_cast<int>(std::lround(reference.size().width / double{kWidth})))) {
  const Reference grey = reference.AsGrey();
  scale_ = std::min({scale_, image_size_.width, image_size_.height});
  cv::Mat mean;
  grey.mean().convertTo(mean, CV_32F, 1.0 / Reference::kGreyLevel);
  cv::Mat unknown = (mean < kOutlineDarkest) | (mean >= Reference::kSaturated);
  if (!grey.undefined().empty()) unknown |= grey.undefined();
  // One unknown pixel reaches as far as smoothing and slopes do.
  cv::Mat small_unknown;
  unknown.convertTo(small_unknown, CV_32F);
  small_unknown = Small(small_unknown, scale_) > 0;
  cv::dilate(small_unknown, small_unknown, cv::Mat::ones(3, 3, CV_8UC1));
  known_ = ~small_unknown;
  mean_ = Smoothed(Small(mean, scale_));
  SlopesOf(mean_, slope_x_, slope_y_);
  for (int y = 0; y + kBlock <= mean_.rows; y += kBlock) {
    for (int x = 0; x + kBlock <= mean_.cols; x += kBlock) {
      const cv::Rect block(x, y, kBlock, kBlock);
      const int known = cv::countNonZero(known_(block));
      if (known < kKnownShare * kBlock * kBlock) continue;
      const cv::Mat squares =
          slope_x_(block).mul(slope_x_(block)) + slope_y_(block).mul(slope_y_(block));
      const double slope = std::sqrt(cv::mean(squares, known_(block))[0]);
      if (slope >= kLeastSlope) blocks_.push_back(block);
    }
  }
}

bool Outline::tells_structure() const { return blocks_.size() >= kFewestOutlineBlocks; }

bool Outline::tells_light() const { return cv::countNonZero(known_) > 0; }

// An image beside an outline.
class OutlineComparison {
 public:
  // `small`: as SmallGrey() makes it; kept while this is used.
  OutlineComparison(const cv::Mat& small, const Outline& outline)
      : outline_(outline), image_(Smoothed(small)), gain_(GainOf(small)) {
    SlopesOf(image_, slope_x_, slope_y_);
  }

  // Whether an image of this size can be compared.
  static bool Fits(const cv::Mat& image, const Outline& outline) {
    return image.size() == outline.image_size_;
  }

  double gain() const { return gain_; }

  // ImageCondition::structure of all blocks, if the image's structure lies `by` further to the
  // right and down.
  double Structure(cv::Point by = {0, 0}) const {
    return StructureOf(outline_.blocks_, by, kFewestOutlineBlocks).value_or(0);
  }

  // Of the blocks that are not foreground; nothing: too few. `foreground`: as the image.
  std::optional<double> VisibleStructure(const cv::Mat& foreground) const {
    cv::Mat hidden;
    cv::resize(foreground != 0, hidden, image_.size(), 0, 0, cv::INTER_AREA);
    cv::dilate(hidden != 0, hidden,
               cv::Mat::ones(2 * kSlopeReach + 1, 2 * kSlopeReach + 1, CV_8UC1));
    std::vector<cv::Rect> visible;
    for (const cv::Rect& block : outline_.blocks_) {
      if (cv::countNonZero(hidden(block)) <= kMostHidden * block.area()) visible.push_back(block);
    }
    return StructureOf(visible, {0, 0}, kFewestVisibleBlocks);
  }

  // In pixels of the outline.
  double Shift() const {
    std::vector<BlockSums> sums;
    for (const cv::Rect& block : outline_.blocks_) {
      const std::optional<double> correlation = CorrelationOf(block, {0, 0});
      if (correlation && *correlation >= kLeastForShift) sums.push_back(SumsOf(block));
    }
    if (sums.size() < kFewestOutlineBlocks) return 0;
    cv::Vec3d move = {0, 0, 0};
    for (int round = 0; round < kShiftRounds; ++round) {
      cv::Matx33d squares = kFirmness * cv::Matx33d::eye();
      cv::Vec3d products = {0, 0, 0};
      for (const BlockSums& block : sums) {
        const double left = block.LeftAt(move) / kLeftOver;
        const double weight = 1 / (1 + left * left);
        squares += weight * block.squares;
        products += weight * block.products;
      }
      move = squares.solve(products, cv::DECOMP_CHOLESKY);
    }
    // Root mean square of the distance from the middle, for the turn.
    const double far = std::hypot(image_.cols, image_.rows) / std::sqrt(12) / kTurnUnit;
    return std::hypot(move[0], move[1], move[2] * far);
  }

  // The shift by whole pixels of the outline that shows the most structure; 0 if none shows enough.
  double FarShift() const {
    double most = std::max(kFoundElsewhere, Structure());
    double best = 0;
    for (int y = -kFarthest; y <= kFarthest; ++y) {
      for (int x = -kFarthest; x <= kFarthest; ++x) {
        const double structure = Structure({x, y});
        if (structure <= most) continue;
        most = structure;
        best = std::hypot(x, y);
      }
    }
    return best;
  }

 private:
  double GainOf(const cv::Mat& small) const {
    std::vector<float> gains;
    for (int y = 0; y < small.rows; ++y) {
      const auto* known = outline_.known_.ptr<uint8_t>(y);
      const auto* now = small.ptr<float>(y);
      const auto* mean = outline_.mean_.ptr<float>(y);
      for (int x = 0; x < small.cols; ++x) {
        if (known[x] != 0) gains.push_back(now[x] / mean[x]);
      }
    }
    return MedianOfLevels(gains, 1);
  }

  // Nothing: fewer than `fewest` of them are in the image.
  std::optional<double> StructureOf(std::span<const cv::Rect> blocks, cv::Point by,
                                    size_t fewest) const {
    size_t inside = 0;
    size_t same = 0;
    for (const cv::Rect& block : blocks) {
      const std::optional<double> correlation = CorrelationOf(block, by);
      if (!correlation) continue;
      ++inside;
      same += *correlation >= kSameStructure ? 1 : 0;
    }
    if (inside < fewest) return std::nullopt;
    return static_cast<double>(same) / static_cast<double>(inside);
  }

  // How the image's slopes correlate with a block's; nothing: the block is not in the image.
  std::optional<double> CorrelationOf(const cv::Rect& block, cv::Point by) const {
    const cv::Rect there = block + by;
    if ((there & cv::Rect({0, 0}, image_.size())) != there) return std::nullopt;
    double common = 0;
    double own = 0;
    double other = 0;
    for (int y = 0; y < block.height; ++y) {
      const auto* known = outline_.known_.ptr<uint8_t>(block.y + y) + block.x;
      const auto* own_x = outline_.slope_x_.ptr<float>(block.y + y) + block.x;
      const auto* own_y = outline_.slope_y_.ptr<float>(block.y + y) + block.x;
      const auto* now_x = slope_x_.ptr<float>(there.y + y) + there.x;
      const auto* now_y = slope_y_.ptr<float>(there.y + y) + there.x;
      for (int x = 0; x < block.width; ++x) {
        if (known[x] == 0) continue;
        common += own_x[x] * now_x[x] + own_y[x] * now_y[x];
        own += own_x[x] * own_x[x] + own_y[x] * own_y[x];
        other += now_x[x] * now_x[x] + now_y[x] * now_y[x];
      }
    }
    return own * other > 0 ? common / std::sqrt(own * other) : 0;
  }

  BlockSums SumsOf(const cv::Rect& block) const {
    BlockSums sums;
    cv::Vec3d slopes = {0, 0, 0};
    double differences = 0;
    for (int y = block.y; y < block.br().y; ++y) {
      const auto* known = outline_.known_.ptr<uint8_t>(y);
      const auto* mean = outline_.mean_.ptr<float>(y);
      const auto* now = image_.ptr<float>(y);
      const auto* along_x = outline_.slope_x_.ptr<float>(y);
      const auto* along_y = outline_.slope_y_.ptr<float>(y);
      for (int x = block.x; x < block.br().x; ++x) {
        if (known[x] == 0) continue;
        // The image shows at a place what the outline has where it came from.
        const double from_x = (x - image_.cols / 2.0) / kTurnUnit;
        const double from_y = (y - image_.rows / 2.0) / kTurnUnit;
        const cv::Vec3d slope(-along_x[x], -along_y[x], along_x[x] * from_y - along_y[x] * from_x);
        const double difference = now[x] / std::max(gain_, 0.05) - mean[x];
        sums.squares += slope * slope.t();
        sums.products += slope * difference;
        sums.difference += difference * difference;
        slopes += slope;
        differences += difference;
        ++sums.count;
      }
    }
    sums.squares -= slopes * slopes.t() * (1 / sums.count);
    sums.products -= slopes * (differences / sums.count);
    sums.difference -= differences * differences / sums.count;
    return sums;
  }

  const Outline& outline_;
  const cv::Mat image_;
  double gain_ = 1;
  cv::Mat slope_x_;
  cv::Mat slope_y_;
};

ImageCondition ConditionOf(const cv::Mat& image, const cv::Mat& foreground,
                           std::span<const Outline> outlines, size_t view) {
  if (view >= outlines.size() || !OutlineComparison::Fits(image, outlines[view]) ||
      !OutlineComparison::Fits(foreground, outlines[view])) {
    throw std::invalid_argument("an image of the size of its reference is expected");
  }
  const Outline& own = outlines[view];
  const cv::Mat small = SmallGrey(image, own.scale());
  const OutlineComparison comparison(small, own);
  ImageCondition condition;
  condition.gain = comparison.gain();
  condition.saturated =
      cv::countNonZero(small >= Reference::kSaturated) / static_cast<double>(small.total());
  if (!own.tells_structure()) return condition;
  const double all = comparison.Structure();
  condition.structure = comparison.VisibleStructure(foreground).value_or(all);
  condition.shift = own.scale() * comparison.Shift();
  if (all >= kMostInPlace) return condition;
  double most = kMostInPlace;
  for (size_t other = 0; other < outlines.size(); ++other) {
    if (other == view || !OutlineComparison::Fits(image, outlines[other])) continue;
    const OutlineComparison with(small, outlines[other]);
    const double structure = outlines[other].tells_structure() ? with.Structure() : 0;
    if (structure < most) continue;
    most = structure;
    condition.other = other;
  }
  if (!condition.other && all < kHardlyInPlace) {
    condition.shift = std::max(condition.shift, own.scale() * comparison.FarShift());
  }
  return condition;
}

}  // namespace silhouette
