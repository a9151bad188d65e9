// The collision test on all configurations and with all sets of cameras at once.
//
// Table 2 cuts the obstacle image with the test robot image, and Table 3 looks along the epipolar
// lines: what is found there is a statement per configuration, hence a set of configurations. The
// sets of a few hundred pixels, joined and met, are the verdicts on the whole configuration space.
// They are those of server/collision/collision_checker.h, configuration by configuration, with the
// views of the set alone.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "server/collision/epipolar_bands.h"
#include "server/collision/obstacle_image.h"
#include "server/collision/policy.h"
#include "tools/silhouette-experiments/paper/configuration_set.h"
#include "tools/silhouette-experiments/paper/line_table.h"
#include "tools/silhouette-experiments/paper/transposed_images.h"

namespace silhouette::paper {

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
class BulkTest {
 public:
  explicit BulkTest(const LineTables& lines);

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
