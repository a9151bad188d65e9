// SPDX-License-Identifier: Apache-2.0
#include "server/collision/collision_images.h"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <utility>

namespace silhouette {

namespace {

using Run = EpipolarBands::Run;
using Runs = EpipolarBands::Runs;

// The bits of word `word` that belong to a run which meets it.
uint64_t BitsIn(Run run, size_t word) {
  uint64_t bits = ~uint64_t{0};
  if (word == run.begin / 64u) bits &= ~uint64_t{0} << (run.begin % 64);
  if (word == (run.end - 1) / 64u) bits &= ~uint64_t{0} >> (63 - (run.end - 1) % 64);
  return bits;
}

void LineSearchSet(std::vector<uint64_t>& bins, const Runs& runs) {
  for (const Run& run : runs) {
    if (run.begin == run.end) continue;
    for (size_t word = run.begin / 64u; word <= (run.end - 1) / 64u; ++word) {
      bins[word] |= BitsIn(run, word);
    }
  }
}

bool LineSearchAnySet(const std::vector<uint64_t>& bins, const Runs& runs) {
  for (const Run& run : runs) {
    if (run.begin == run.end) continue;
    for (size_t word = run.begin / 64u; word <= (run.end - 1) / 64u; ++word) {
      if ((bins[word] & BitsIn(run, word)) != 0) return true;
    }
  }
  return false;
}

}  // namespace

void LineSearch::Begin(const EpipolarBands& bands, std::span<const SearchedImage> images,
                       bool errors_convict) {
  bands_ = &bands;
  images_ = images;
  errors_convict_ = errors_convict;
  if (lines_.size() + 1 < images.size()) lines_.resize(images.size() - 1);
}

bool LineSearch::Paint(int view) {
  line_count_ = 0;
  bool convicts = false;
  for (int other = 0; other < bands_->views(); ++other) {
    if (other == view) continue;
    Line& line = lines_[line_count_++];
    const SearchedImage& image = images_[static_cast<size_t>(other)];
    line.missing = image.missing();
    line.runs = bands_->runs(view, other);
    if (line.missing) {
      convicts = true;
      continue;
    }
    const size_t words = (static_cast<size_t>(bands_->bins(view, other)) + 63) / 64;
    line.something.assign(words, 0);
    line.convicting.assign(words, 0);
    const std::span<const Runs> runs = bands_->runs(other, view);
    bool something = false;
    for (size_t word = 0; word < image.obstacle.size(); ++word) {
      const uint64_t convicting =
          image.obstacle[word] | (errors_convict_ ? image.error[word] : uint64_t{0});
      uint64_t bits = image.obstacle[word] | image.unknown[word] | image.error[word];
      something = something || bits != 0;
      for (; bits != 0; bits &= bits - 1) {
        const auto bit = static_cast<size_t>(std::countr_zero(bits));
        const Runs& run = runs[word * 64 + bit];
        LineSearchSet(line.something, run);
        if ((convicting >> bit & 1) != 0) LineSearchSet(line.convicting, run);
      }
      convicts = convicts || convicting != 0;
    }
    if (!something) return false;  // all of its lines are background
  }
  return convicts;
}

bool LineSearch::IsObstacle(size_t pixel) const {
  bool convicted = false;
  for (size_t i = 0; i < line_count_; ++i) {
    const Line& line = lines_[i];
    if (line.missing) {
      convicted = true;
      continue;
    }
    if (!LineSearchAnySet(line.something, line.runs[pixel])) return false;
    convicted = convicted || LineSearchAnySet(line.convicting, line.runs[pixel]);
  }
  return convicted;
}

bool LineSearch::AnyObstacle(int view) {
  if (!Paint(view)) return false;
  const SearchedImage& image = images_[static_cast<size_t>(view)];
  for (size_t word = 0; word < image.unknown.size(); ++word) {
    for (uint64_t bits = image.unknown[word] | image.error[word]; bits != 0; bits &= bits - 1) {
      if (IsObstacle(word * 64 + static_cast<size_t>(std::countr_zero(bits)))) return true;
    }
  }
  return false;
}

int LineSearch::CountShowing(int enough) {
  int showing = 0;
  int undecided = 0;
  for (const SearchedImage& image : images_) {
    ++(image.missing() || !NothingSet(image.obstacle) ? showing : undecided);
  }
  // Where no view shows an obstacle, none can convict.
  if (showing == 0) return 0;
  for (size_t view = 0; view < images_.size(); ++view) {
    const SearchedImage& image = images_[view];
    if (image.missing() || !NothingSet(image.obstacle)) continue;
    if (showing >= enough || showing + undecided < enough) break;
    --undecided;
    if (AnyObstacle(static_cast<int>(view))) ++showing;
  }
  return showing;
}

void LineSearch::AddObstacles(int view, std::span<uint64_t> words) {
  if (!Paint(view)) return;
  const SearchedImage& image = images_[static_cast<size_t>(view)];
  for (size_t word = 0; word < image.unknown.size(); ++word) {
    for (uint64_t bits = image.unknown[word] | image.error[word]; bits != 0; bits &= bits - 1) {
      const auto bit = static_cast<size_t>(std::countr_zero(bits));
      if (IsObstacle(word * 64 + bit)) words[word] |= uint64_t{1} << bit;
    }
  }
}

namespace {

template <typename Image>
CollisionImages Resolve(const std::vector<std::optional<Image>>& images, const EpipolarBands& bands,
                        bool errors_convict) {
  if (images.size() != static_cast<size_t>(bands.views())) {
    throw std::invalid_argument("there must be one image per view of the calibration");
  }
  std::vector<SearchedImage> searched(images.size());
  for (size_t view = 0; view < images.size(); ++view) {
    if (!images[view]) continue;
    if (images[view]->size() != bands.mask_sizes()[view]) {
      throw std::invalid_argument("an image has not the mask size of the calibration");
    }
    searched[view] = {images[view]->obstacle().words(), images[view]->unknown().words(),
                      images[view]->error().words()};
  }
  LineSearch search;
  search.Begin(bands, searched, errors_convict);
  CollisionImages collision_images(images.size());
  for (size_t view = 0; view < images.size(); ++view) {
    if (!images[view]) continue;
    const MaskWords obstacle = searched[view].obstacle;
    std::vector<uint64_t> words(obstacle.begin(), obstacle.end());
    search.AddObstacles(static_cast<int>(view), words);
    collision_images[view] = Mask::FromWords(images[view]->size(), std::move(words));
  }
  return collision_images;
}

}  // namespace

CollisionImages UncalibratedCollisionImages(const IntersectionImages& images) {
  CollisionImages collision_images;
  for (const std::optional<IntersectionImage>& image : images) {
    collision_images.push_back(image ? std::optional<Mask>(image->obstacle()) : std::nullopt);
  }
  return collision_images;
}

CollisionImages CalibratedCollisionImages(const IntersectionImages& images,
                                          const EpipolarBands& bands) {
  return Resolve(images, bands, /*errors_convict=*/false);
}

CollisionImages ResolvedObstacleImages(const ObstacleImages& images, const EpipolarBands& bands) {
  return Resolve(images, bands, /*errors_convict=*/true);
}

}  // namespace silhouette
