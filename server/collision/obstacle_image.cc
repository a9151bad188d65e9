// SPDX-License-Identifier: Apache-2.0
#include "server/collision/obstacle_image.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

namespace silhouette {
namespace {

// Pixels that are taken out component by component.
class PixelSet {
 public:
  explicit PixelSet(const Mask& mask)
      : size_(mask.size()), words_(mask.words().begin(), mask.words().end()) {}

  bool Has(size_t pixel) const { return (words_[pixel / 64] >> (pixel % 64) & 1) != 0; }

  // Takes out all that is connected with `first`, over edges and corners. `joins`: becomes true if
  // one of these pixels touches one of `others`.
  std::vector<size_t> TakeComponent(size_t first, const Mask& others, bool& joins) {
    const auto width = static_cast<size_t>(size_.width);
    std::vector<size_t> component = {first};
    Remove(first);
    for (size_t next = 0; next < component.size(); ++next) {
      const int x = static_cast<int>(component[next] % width);
      const int y = static_cast<int>(component[next] / width);
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, size_.height - 1); ++v) {
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, size_.width - 1); ++u) {
          const size_t pixel = static_cast<size_t>(v) * width + static_cast<size_t>(u);
          joins |= others.at(u, v);
          if (!Has(pixel)) continue;
          Remove(pixel);
          component.push_back(pixel);
        }
      }
    }
    return component;
  }

 private:
  void Remove(size_t pixel) { words_[pixel / 64] &= ~(uint64_t{1} << (pixel % 64)); }

  MaskSize size_;
  std::vector<uint64_t> words_;
};

}  // namespace

ObstacleImage::ObstacleImage(Mask obstacle, Mask unknown, Mask error)
    : obstacle_(std::move(obstacle)), unknown_(std::move(unknown)), error_(std::move(error)) {}

ObstacleImage ObstacleImage::FromScene(const Mask& scene, const Mask& robot) {
  return FromScene(scene, robot, robot);
}

ObstacleImage ObstacleImage::FromScene(const Mask& scene, const Mask& anywhere,
                                       const Mask& certain) {
  if (!(certain - anywhere).Empty()) {
    throw std::invalid_argument("the corners' intersection is not within their union");
  }
  return ObstacleImage(scene - anywhere, scene & anywhere, certain - scene);
}

ObstacleImage ObstacleImage::FromObstacles(const Mask& obstacles, const Mask& anywhere) {
  return ObstacleImage(obstacles, anywhere - obstacles, Mask(obstacles.size()));
}

ObstacleImage ObstacleImage::WithoutWeakRim(const Mask& strong, const Mask& anywhere) const {
  const Mask candidates = (obstacle_ & Grown(anywhere, 1)) - strong;
  if (candidates.Empty()) return *this;
  const Mask others = obstacle_ - candidates;
  const MaskSize size = obstacle_.size();
  std::vector<uint64_t> lone(size.words());
  PixelSet left(candidates);
  for (size_t first = 0; first < size.pixels(); ++first) {
    if (!left.Has(first)) continue;
    bool joins = false;
    const std::vector<size_t> component = left.TakeComponent(first, others, joins);
    if (joins || component.size() > kMostWeakPixels) continue;
    for (const size_t pixel : component) lone[pixel / 64] |= uint64_t{1} << (pixel % 64);
  }
  const Mask weak = Mask::FromWords(size, std::move(lone));
  return ObstacleImage(obstacle_ - weak, unknown_ | weak, error_);
}

ObstacleImage ObstacleImage::Ignoring(const Mask& ignored) const {
  return ObstacleImage(obstacle_ - ignored, unknown_ | ignored, error_ - ignored);
}

ObstacleImage ObstacleImage::WithMargin(double margin) const {
  if (margin < 0) throw std::invalid_argument("a margin must not be negative");
  const Mask obstacle = Grown(obstacle_, margin);
  const Mask unknown = Grown(unknown_, margin) - error_ - obstacle;
  return ObstacleImage(obstacle, unknown, Grown(error_, margin) - unknown - obstacle);
}

Mask ObstacleImage::Background() const { return ~(obstacle_ | unknown_ | error_); }

IntersectionImage::IntersectionImage(const ObstacleImage& obstacle_image, const Mask& test_robot)
    : obstacle_(obstacle_image.obstacle() & test_robot),
      unknown_(obstacle_image.unknown() & test_robot),
      error_(obstacle_image.error() & test_robot) {}

}  // namespace silhouette
