// SPDX-License-Identifier: Apache-2.0
#include "server/collision/clearance.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "server/collision/collision_images.h"
#include "server/collision/obstacle_image.h"

namespace silhouette {

namespace {

// Per pixel, how many rows it is away from a set pixel of its column; `far` where there is none.
std::vector<int> RowsAway(const Mask& mask, int far) {
  const auto width = static_cast<size_t>(mask.width());
  const auto height = static_cast<size_t>(mask.height());
  std::vector<int> away(width * height, far);
  const MaskWords words = mask.words();
  for (size_t word = 0; word < words.size(); ++word) {
    for (uint64_t bits = words[word]; bits != 0; bits &= bits - 1) {
      away[64 * word + static_cast<size_t>(std::countr_zero(bits))] = 0;
    }
  }
  for (size_t i = width; i < away.size(); ++i) away[i] = std::min(away[i], away[i - width] + 1);
  for (size_t i = away.size() - width; i-- > 0;) away[i] = std::min(away[i], away[i + width] + 1);
  return away;
}

// The lower envelope of the parabolas (x - i)^2 + away[i]^2, as the two-pass distance transforms of
// Meijster et al. and of Felzenszwalb and Huttenlocher find it.
class Envelope {
 public:
  explicit Envelope(size_t width) : lowest_(width) {}

  // `squared` gets, for every x of the row, the height of the envelope there.
  void Evaluate(std::span<const int> away, std::span<uint32_t> squared) {
    const int width = static_cast<int>(away.size());
    const auto height_at = [&](int x, int i) { return (x - i) * (x - i) + away[i] * away[i]; };
    // The first x from which parabola `right` is lower than `left`, which is not below it at 0.
    const auto begins = [&](int left, int right) {
      const int lead =
          right * right - left * left + away[right] * away[right] - away[left] * away[left];
      return lead / (2 * (right - left)) + 1;
    };
    size_t count = 0;
    for (int i = 0; i < width; ++i) {
      while (count > 0 && height_at(lowest_[count - 1].from, lowest_[count - 1].parabola) >
                              height_at(lowest_[count - 1].from, i)) {
        --count;
      }
      const int from = count == 0 ? 0 : begins(lowest_[count - 1].parabola, i);
      if (from < width) lowest_[count++] = {from, i};
    }
    for (int x = width; count-- > 0;) {
      const Piece& piece = lowest_[count];
      while (x > piece.from) {
        --x;
        squared[static_cast<size_t>(x)] = static_cast<uint32_t>(height_at(x, piece.parabola));
      }
    }
  }

 private:
  // Which parabola is lowest from an x on.
  struct Piece {
    int from = 0;
    int parabola = 0;
  };
  std::vector<Piece> lowest_;
};

}  // namespace

DistanceImage::DistanceImage(const Mask& plane) : size_(plane.size()) {
  if (!size_.valid()) throw std::invalid_argument("a mask of no size has no distances");
  squared_.assign(size_.pixels(), kInfinite);
  if (plane.Empty()) return;
  // The distance between two squares is that of the one's centre to the nearest centre of the
  // other's 3 x 3 surroundings.
  const std::vector<int> away = RowsAway(Grown(plane, 1), size_.width + size_.height);
  const auto width = static_cast<size_t>(size_.width);
  Envelope envelope(width);
  for (size_t row = 0; row < away.size(); row += width) {
    envelope.Evaluate(std::span(away).subspan(row, width), std::span(squared_).subspan(row, width));
  }
}

uint32_t DistanceImage::LeastSquared(MaskWords pixels) const {
  uint32_t least = kInfinite;
  for (size_t word = 0; word < pixels.size(); ++word) {
    for (uint64_t bits = pixels[word]; bits != 0; bits &= bits - 1) {
      const size_t pixel = 64 * word + static_cast<size_t>(std::countr_zero(bits));
      least = std::min(least, squared_[pixel]);
    }
    if (least == 0) break;
  }
  return least;
}

Mask DistanceImage::Within(uint32_t squared) const {
  std::vector<uint64_t> words(size_.words());
  for (size_t pixel = 0; pixel < squared_.size(); ++pixel) {
    words[pixel / 64] |= uint64_t{squared_[pixel] <= squared ? 1U : 0U} << (pixel % 64);
  }
  return Mask::FromWords(size_, std::move(words));
}

double PixelsOf(uint32_t squared) {
  if (squared == DistanceImage::kInfinite) return std::numeric_limits<double>::infinity();
  const double pixels = std::sqrt(static_cast<double>(squared));
  // Rounded down where its square would come out greater: Grown compares squares.
  return pixels * pixels > squared ? std::nextafter(pixels, 0.0) : pixels;
}

namespace {

constexpr uint32_t kInfinite = DistanceImage::kInfinite;

// All pixels of an image are within this squared distance of each other.
uint32_t WholeImage(MaskSize size) {
  return static_cast<uint32_t>(size.width * size.width + size.height * size.height);
}

}  // namespace

DistanceImages DistancesTo(const CollisionImages& planes) {
  DistanceImages distances(planes.size());
  for (size_t view = 0; view < planes.size(); ++view) {
    if (planes[view]) distances[view].emplace(*planes[view]);
  }
  return distances;
}

CollisionImages ObstaclePlanes(const ObstacleImages& images) {
  CollisionImages planes(images.size());
  for (size_t view = 0; view < images.size(); ++view) {
    if (images[view]) planes[view] = images[view]->obstacle();
  }
  return planes;
}

ClearanceMeter::ClearanceMeter(const CollisionChecker& test, const ObstacleImages& obstacle_images,
                               const Policy& policy, const TestSupport& support,
                               const DistanceImages& distances)
    : test_(test), obstacle_images_(obstacle_images), distances_(distances) {
  bool fits = distances.size() == obstacle_images.size();
  for (size_t view = 0; fits && view < distances.size(); ++view) {
    fits = distances[view].has_value() == obstacle_images[view].has_value() &&
           (!distances[view] || distances[view]->size() == obstacle_images[view]->size());
  }
  if (!fits) throw std::invalid_argument("the distances are not those of the scene");
  if (IsSound(policy.preset)) possible_space_ = support.possible_space;
  if (policy.preset == Preset::kCalibrated) searched_bands_ = support.bands;
}

std::optional<double> ClearanceMeter::Measure(std::span<const double> q, const Verdict& verdict,
                                              std::span<ViewEvidence> evidence) const {
  for (ViewEvidence& view : evidence) view.distance.reset();
  if (verdict.state() == State::kUnknown) return std::nullopt;
  const std::optional<RobotImages> robot = test_.TestRobotImages(q);
  if (!robot) return std::nullopt;
  const std::vector<uint32_t> to_planes = ToPlanes(*robot);
  for (size_t view = 0; view < evidence.size(); ++view) {
    if (distances_[view]) evidence[view].distance = PixelsOf(to_planes[view]);
  }
  if (verdict.state() == State::kOccupied) return 0;
  return PixelsOf(Squared(*robot, kInfinite));
}

size_t ClearanceMeter::CountExceeded(std::span<const double> q,
                                     std::span<const uint32_t> levels) const {
  const std::optional<RobotImages> robot = test_.TestRobotImages(q);
  if (!robot) return 0;
  const auto first_not_below = [&](uint32_t squared) {
    return std::ranges::lower_bound(levels, squared);
  };
  if (searched_bands_ == nullptr) {
    return static_cast<size_t>(first_not_below(Squared(*robot, kInfinite)) - levels.begin());
  }
  const std::vector<uint32_t> to_planes = ToPlanes(*robot);
  // Nothing convicts before some view shows an obstacle.
  const auto first = first_not_below(std::ranges::min(to_planes));
  const auto last = first_not_below(MinViewsSmallest(to_planes));
  if (first >= last) return static_cast<size_t>(last - levels.begin());
  const std::vector<DistanceImage> from_robot(robot->begin(), robot->end());
  // The larger the robot images, the more is occupied.
  const auto not_exceeded = std::partition_point(
      first, last, [&](uint32_t level) { return !OccupiedAlongLines(from_robot, level); });
  return static_cast<size_t>(not_exceeded - levels.begin());
}

void ClearanceMeter::Narrow(const TestedPlace& place,
                            std::optional<PathClearance>& smallest) const {
  if (place.verdict.state() == State::kUnknown || (smallest && smallest->squared == 0)) return;
  uint32_t squared = 0;
  if (place.verdict.free() && !place.sampled) {
    // One that cannot be read any more may be anywhere.
    const std::optional<RobotImages> robot =
        test_.TestRobotImages(place.configuration, place.growth);
    if (robot) squared = Squared(*robot, smallest ? smallest->squared : kInfinite);
  }
  if (smallest && squared >= smallest->squared) return;
  smallest = PathClearance{squared,
                           place.segment,
                           place.fraction,
                           {place.configuration.begin(), place.configuration.end()}};
}

uint32_t ClearanceMeter::Squared(const RobotImages& robot, uint32_t limit) const {
  if (possible_space_ != nullptr) return std::min(limit, SquaredFromParts(robot));
  const std::vector<uint32_t> to_planes = ToPlanes(robot);
  limit = std::min(limit, MinViewsSmallest(to_planes));
  if (searched_bands_ == nullptr) return limit;
  // As soon as min_views views show an obstacle, no line matters.
  const uint32_t least = std::ranges::min(to_planes);
  return least < limit ? SquaredAlongLines(robot, least, limit) : limit;
}

std::vector<uint32_t> ClearanceMeter::ToPlanes(const RobotImages& robot) const {
  std::vector<uint32_t> squared(distances_.size(), 0);
  for (size_t view = 0; view < squared.size(); ++view) {
    if (distances_[view]) squared[view] = distances_[view]->LeastSquared(robot[view].words());
  }
  return squared;
}

uint32_t ClearanceMeter::MinViewsSmallest(std::vector<uint32_t> squared) const {
  const auto wanted = squared.begin() + test_.min_views() - 1;
  std::nth_element(squared.begin(), wanted, squared.end());
  return *wanted;
}

uint32_t ClearanceMeter::SquaredFromParts(const RobotImages& robot) const {
  std::vector<DistanceImage> from_robot;
  for (const Mask& image : robot) from_robot.emplace_back(image);
  uint32_t smallest = kInfinite;
  for (const PossibleSpace::Part& part : possible_space_->parts()) {
    std::vector<uint32_t> squared(robot.size(), 0);
    for (size_t view = 0; view < squared.size(); ++view) {
      // A robot that is nowhere in the image may be where the part reaches beyond it.
      const bool met_outside = part.beyond[view] && robot[view].Empty();
      if (!part.planes[view] || met_outside) continue;
      squared[view] = from_robot[view].LeastSquared(part.planes[view]->words());
    }
    smallest = std::min(smallest, MinViewsSmallest(std::move(squared)));
  }
  return smallest;
}

uint32_t ClearanceMeter::SquaredAlongLines(const RobotImages& robot, uint32_t least,
                                           uint32_t limit) const {
  std::vector<DistanceImage> from_robot;
  uint32_t whole = 0;
  for (const Mask& image : robot) {
    from_robot.emplace_back(image);
    whole = std::max(whole, WholeImage(image.size()));
  }
  uint32_t occupied = std::min(limit - 1, whole);
  if (!OccupiedAlongLines(from_robot, occupied)) return limit;
  // The larger the robot images, the more is occupied.
  while (least < occupied) {
    const uint32_t middle = least + (occupied - least) / 2;
    if (OccupiedAlongLines(from_robot, middle)) {
      occupied = middle;
    } else {
      least = middle + 1;
    }
  }
  return least;
}

bool ClearanceMeter::OccupiedAlongLines(std::span<const DistanceImage> from_robot,
                                        uint32_t squared) const {
  IntersectionImages intersections(from_robot.size());
  std::vector<SearchedImage> images(from_robot.size());
  for (size_t view = 0; view < images.size(); ++view) {
    if (!obstacle_images_[view]) continue;
    const IntersectionImage& cut =
        intersections[view].emplace(*obstacle_images_[view], from_robot[view].Within(squared));
    images[view] = {cut.obstacle().words(), cut.unknown().words(), cut.error().words()};
  }
  LineSearch search;
  search.Begin(*searched_bands_, images);
  return search.CountShowing(test_.min_views()) >= test_.min_views();
}

}  // namespace silhouette
