#include "tools/silhouette-experiments/hidden/picture.h"

#include <algorithm>
#include <vector>

#include "capture/sim/obstacles.h"
#include "common/picture/sheet.h"
#include "server/collision/possible_space.h"

namespace silhouette::hidden_experiment {
namespace {

constexpr int kFactor = 4;        // of enlargement
constexpr double kOpacity = 0.8;  // of what is laid over

// The pixels of a view that show the ball, if nothing were before it.
Mask PixelsOf(const HiddenCell& cell, const HiddenBall& ball, size_t view) {
  const CameraModel& camera = cell.cameras()[view];
  const CameraIntrinsics& image = camera.intrinsics();
  std::vector<uint64_t> words(MaskSize{image.width, image.height}.words(), 0);
  for (const double share : {0.25, 0.5, 0.75, 1.0}) {
    for (const Eigen::Vector3d& vertex : SphereMesh(share * ball.radius).vertices) {
      const auto pixel = camera.Project(ball.centre + vertex);
      if (!pixel || !camera.Contains(*pixel)) continue;
      const auto bit =
          static_cast<size_t>(std::lround(pixel->y()) * image.width + std::lround(pixel->x()));
      words[bit / 64] |= uint64_t{1} << (bit % 64);
    }
  }
  return Mask::FromWords({image.width, image.height}, std::move(words));
}

}  // namespace

Picture PictureOf(const HiddenCell& cell, const HiddenBall& ball, const Served& served) {
  const ServedDatabase& database = cell.database();
  const PossibleSpace& possible = served.scene->possible_space.Get(
      database.sound(), served.scene->obstacle_images, served.scene->joints, {});
  std::vector<CaptionedPicture> above;
  std::vector<CaptionedPicture> below;
  for (int view = 0; view < database.views(); ++view) {
    const auto i = static_cast<size_t>(view);
    const ObstacleImage& image = *served.scene->obstacle_images[i];
    const Picture planes = PictureOfPlanes(image.obstacle(), image.unknown(), image.error());
    Mask may_hold(image.size());
    for (const PossibleSpace::Part& part : possible.parts()) {
      may_hold = may_hold | *part.planes[i];
    }
    const auto with = [&](const Mask& mask, Colour colour) {
      return Enlarged(WithVeil(planes, mask, colour, kOpacity), kFactor);
    };
    above.push_back({with(PixelsOf(cell, ball, i), palette::kObstacle), database.view_name(view)});
    below.push_back({with(may_hold, palette::kGoal), database.view_name(view)});
  }
  above.insert(above.end(), below.begin(), below.end());
  return ContactSheet(above,
                      {.title = "A ball under the hood; where the sound test says one may be",
                       .columns = database.views(),
                       .legend = {{palette::kUnknown, "unknown: the robot"},
                                  {palette::kObstacle, "the ball, in truth"},
                                  {palette::kGoal, "an obstacle may be here"}}});
}

}  // namespace silhouette::hidden_experiment
