// SPDX-License-Identifier: Apache-2.0
// Collision images: intersection images whose unknown and error pixels are resolved to obstacle or
// background (paper §3.3). The set bits are the obstacle pixels.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "db/mask/mask.h"
#include "server/collision/epipolar_bands.h"
#include "server/collision/obstacle_image.h"

namespace silhouette {

// What unknown and error pixels are, from the epipolar lines in the other views (paper §3.3,
// Table 3).
//
// Along the band of a pixel in another view there is
//   nothing but background: then no point that the pixel shows is an obstacle, for the other view
//     would see it: the pixel is background;
//   an obstacle pixel: then the pixel may show that obstacle;
//   or only unknown and error pixels, which prove nothing.
// A pixel is an obstacle if no other view makes it background and some other view has an obstacle
// on its band (with `errors_convict`: or an error); else it is background. A view whose image is
// missing counts as full of obstacles. Without any other view nothing is resolved: the pixel counts
// as background.
// The image of one view in which lines are searched, and whose pixels are resolved: an obstacle
// image or an intersection image. The planes do not overlap; all are empty if the image is missing.
struct SearchedImage {
  MaskWords obstacle;
  MaskWords unknown;
  MaskWords error;

  bool missing() const { return obstacle.empty(); }
};

// Working memory for the search in one set of images after the other: made once, used by one thread
// at a time, and then without allocating. Refers to the bands, which must outlive it.
class LineSearch {
 public:
  // One image per view of `bands`; their words must stay as they are during the search.
  void Begin(const EpipolarBands& bands, std::span<const SearchedImage> images,
             bool errors_convict = false);

  // Whether any unknown or error pixel of `view` is an obstacle. The image is not missing.
  bool AnyObstacle(int view);

  // How many images show an obstacle once their unknown and error pixels are resolved; missing ones
  // do. Counts on only while it matters whether there are `enough`. Not with `errors_convict`.
  int CountShowing(int enough);

  // Sets, in `words`, the bits of all unknown and error pixels of `view` that are obstacles.
  void AddObstacles(int view, std::span<uint64_t> words);

 private:
  // What another view has in the bins of its pair with the view that is resolved.
  struct Line {
    bool missing = false;
    std::span<const EpipolarBands::Runs> runs;  // of the pixels to be resolved
    std::vector<uint64_t> something;            // bins of obstacle, unknown and error pixels
    std::vector<uint64_t> convicting;           // of obstacle pixels, and errors if they convict
  };

  // False if no pixel of `view` can be an obstacle.
  bool Paint(int view);
  bool IsObstacle(size_t pixel) const;

  const EpipolarBands* bands_ = nullptr;
  std::span<const SearchedImage> images_;
  bool errors_convict_ = false;
  std::vector<Line> lines_;
  size_t line_count_ = 0;
};

// Per view; nothing where the scene lacks the view.
using ObstacleImages = std::vector<std::optional<ObstacleImage>>;
using IntersectionImages = std::vector<std::optional<IntersectionImage>>;
using CollisionImages = std::vector<std::optional<Mask>>;

// Without a calibration nothing can be resolved: unknown and error become background, and the
// number of views that must show an obstacle (policy.h) makes up for it.
CollisionImages UncalibratedCollisionImages(const IntersectionImages& images);

// Preset::kCalibrated: resolved along the epipolar lines (LineSearch) in the intersection images.
// One image, or nothing, per view of `bands`, of its mask size, else std::invalid_argument.
CollisionImages CalibratedCollisionImages(const IntersectionImages& images,
                                          const EpipolarBands& bands);

// Preset::kPaperCalibrated: the same in the obstacle images, where errors convict. It does not
// depend on the test configuration: cut with the test robot image it is the collision image.
CollisionImages ResolvedObstacleImages(const ObstacleImages& images, const EpipolarBands& bands);

}  // namespace silhouette
