// SPDX-License-Identifier: Apache-2.0
// Collision checking of all configurations, and with all sets of cameras, at once.
//
// Table 2 cuts the obstacle image with the test robot image, and Table 3 searches the epipolar
// lines. What is found there holds for a set of configurations. The verdicts on the whole
// configuration space are unions and intersections of such sets, a few hundred pixels' worth. They
// are those of server/collision/collision_checker.h with the views of the set alone; a test
// compares every configuration.
//
// The product's checker does not serve here: it checks one set of cameras at a time, and the
// experiment asks for 15 sets in 40,000 scenes. Its whole-space check (space_checker.h) takes 13 ms
// for `calibrated` with four cameras, because the planes leave 4187 of 5184 configurations open;
// this takes 0.1 ms. For `sound` it takes 33 ms, bulk_sound_checker.h takes 2.5 ms. The default run
// would take an estimated 45 minutes on two cores instead of 3.5.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "db/mask/mask.h"
#include "server/collision/epipolar_bands.h"
#include "server/collision/obstacle_image.h"
#include "server/collision/policy.h"

namespace silhouette::paper {

// Sets of configurations as bits, one per configuration: bit i % 64 of word i / 64 is configuration
// i; unused bits are zero.
using ConfigurationSet = std::vector<uint64_t>;
using ConfigurationWords = std::span<const uint64_t>;

inline size_t WordsFor(size_t configurations) { return (configurations + 63) / 64; }

inline bool Contains(ConfigurationWords set, size_t configuration) {
  return (set[configuration / 64] >> (configuration % 64) & 1) != 0;
}

inline void Insert(ConfigurationSet& set, size_t configuration) {
  set[configuration / 64] |= uint64_t{1} << (configuration % 64);
}

inline void Add(ConfigurationSet& set, ConfigurationWords other) {
  for (size_t i = 0; i < set.size(); ++i) set[i] |= other[i];
}

inline int64_t Count(ConfigurationWords set) {
  int64_t count = 0;
  for (uint64_t word : set) count += std::popcount(word);
  return count;
}

// How many are in `a` and not in `b`.
inline int64_t CountWithout(ConfigurationWords a, ConfigurationWords b) {
  int64_t count = 0;
  for (size_t i = 0; i < a.size(); ++i) count += std::popcount(a[i] & ~b[i]);
  return count;
}

// The robot images of a view transposed: per pixel, the configurations in which the robot covers
// it. The verdict on all configurations is then the union of a few sets.
class TransposedImages {
 public:
  // One image per configuration, at least one, all of one size; else std::invalid_argument.
  explicit TransposedImages(std::span<const Mask> images);

  size_t configurations() const { return configurations_; }
  size_t words() const { return WordsFor(configurations_); }
  MaskSize mask_size() const { return mask_size_; }

  // The configurations whose image has the pixel.
  ConfigurationWords Covering(size_t pixel) const {
    return {bits_.data() + pixel * words(), words()};
  }

 private:
  size_t configurations_;
  MaskSize mask_size_;
  std::vector<uint64_t> bits_;
};

// Calls visit(pixel) for every set pixel.
template <typename Visit>
void ForEachPixel(MaskWords words, Visit visit) {
  for (size_t word = 0; word < words.size(); ++word) {
    for (uint64_t bits = words[word]; bits != 0; bits &= bits - 1) {
      visit(word * 64 + static_cast<size_t>(std::countr_zero(bits)));
    }
  }
}

// The epipolar bands from one view into another, as masks: which pixels of the other view may show
// the same point as a pixel of this one. Pixels with the same band share it.
class LineTable {
 public:
  // From `view` into `other`, another view of `bands`.
  LineTable(const EpipolarBands& bands, int view, int other);

  size_t lines() const { return masks_.size() / words_; }
  // The line of a pixel of the view.
  size_t LineOf(size_t pixel) const { return line_of_[pixel]; }
  // The pixels of the other view on a line.
  MaskWords Band(size_t line) const { return {masks_.data() + line * words_, words_}; }

 private:
  size_t words_;
  std::vector<uint16_t> line_of_;
  std::vector<uint64_t> masks_;
};

// Some of the views: bit i is view i.
using ViewSet = unsigned;

inline constexpr int kMostViews = 4;

// The lines between all views.
class LineTables {
 public:
  explicit LineTables(const EpipolarBands& bands);

  int views() const { return views_; }
  const LineTable& Between(int view, int other) const {
    return *tables_[static_cast<size_t>(view * views_ + other)];
  }

 private:
  int views_;
  std::vector<std::unique_ptr<const LineTable>> tables_;  // none where view and other are the same
};

// Used by one thread at a time; refers to `lines`, which must outlive it.
class BulkChecker {
 public:
  explicit BulkChecker(const LineTables& lines);

  // Looks at a scene: one obstacle image per view, and per view the images of the configurations
  // to test. Both are needed during the call only. Throws std::invalid_argument if there are more
  // or fewer than views.
  void Look(std::span<const ObstacleImage> images, std::span<const TransposedImages> robot);

  // The occupied configurations of that scene with the views of `views`, at least one, if
  // `min_views` of them must show an obstacle. `preset` is none of the sound ones.
  ConfigurationSet Occupied(Preset preset, ViewSet views, int min_views) const;

  // The configurations in which `view` shows an obstacle when the views of `views` look.
  ConfigurationWords Showing(Preset preset, int view, ViewSet views) const;

 private:
  // Per configuration, what is on one line of the intersection image: anything but background; an
  // obstacle.
  struct Line {
    ConfigurationSet something;
    ConfigurationSet convicting;
  };
  enum Domain { kIntersection, kObstacle };

  ConfigurationSet& ShowingIn(Domain domain, int view, ViewSet views) {
    return showing_[domain][static_cast<size_t>(view)][views];
  }
  const Line& LineIn(int view, int other, size_t pixel);
  void ResolveInIntersections(int view, size_t pixel, ConfigurationWords covering);
  void ResolveInObstacleImages(int view, size_t pixel, ConfigurationWords covering);

  const LineTables& lines_;
  std::span<const ObstacleImage> images_;
  std::span<const TransposedImages> robot_;
  std::vector<std::vector<uint64_t>> somethings_;   // obstacle, unknown and error pixels per view
  std::vector<std::vector<uint64_t>> convictions_;  // obstacle and error pixels per view

  // Lines looked at in this scene: places in line_memory_, -1: not yet.
  std::vector<std::vector<int>> line_places_;  // by view * views + other
  std::vector<Line> line_memory_;
  size_t lines_used_ = 0;

  std::vector<ConfigurationSet> direct_;  // per view, by its obstacle pixels
  // By view and set of views.
  std::array<std::vector<std::vector<ConfigurationSet>>, 2> showing_;
  std::vector<ConfigurationSet> all_something_;   // by set of views: on the lines in all of them
  std::vector<ConfigurationSet> any_convicting_;  // on the line in any of them
};

// The sets of `count` of the first `views` views.
std::vector<ViewSet> SetsOf(int count, int views);

// The configurations that are in at least `least` of the sets.
ConfigurationSet AtLeast(int least, std::span<const ConfigurationWords> sets);

}  // namespace silhouette::paper
