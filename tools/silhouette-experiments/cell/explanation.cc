// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/explanation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "capture/segmentation/brightness.h"
#include "common/picture/picture.h"
#include "db/status/status_macros.h"
#include "server/collision/collision_checker.h"
#include "tools/silhouette-experiments/cell/inner_balls.h"

namespace silhouette::cell_experiment {
namespace {

// What went wrong at a place in a view; nothing if all is as in perfect images.
std::optional<Cause> FaultIn(const PlaceInView& view, bool on_grid) {
  if (!view.in_test_image) return on_grid ? Cause::kRobotImage : Cause::kTestCell;
  if (view.plane == PlaceInView::kBackground) return Cause::kContrast;
  if (view.robot_in_line || view.plane == PlaceInView::kObstacle) return std::nullopt;
  return view.cover;
}

int ViewsOpen(const Place& place) {
  return static_cast<int>(std::count_if(
      place.begin(), place.end(), [](const PlaceInView& view) { return !view.robot_in_line; }));
}

// The sound presets ask whether an obstacle could be there: all views together, seen or not. A
// place that no view takes for empty, or misses in the robot image, was opened away.
CauseFound FindSoundCause(std::span<const Place> places, bool on_grid) {
  std::optional<CauseFound> fault;
  for (size_t i = 0; i < places.size(); ++i) {
    std::optional<CauseFound> wrong;
    for (size_t view = 0; view < places[i].size() && !wrong; ++view) {
      const PlaceInView& at = places[i][view];
      if (at.in_test_image && at.plane != PlaceInView::kBackground) continue;
      wrong = CauseFound{.cause = *FaultIn(at, on_grid), .place = i, .view = view};
    }
    if (!wrong) return {.cause = Cause::kSize, .place = i, .view = 0};
    if (!fault) fault = wrong;
  }
  return *fault;
}

// Places of contact that are looked at, of every kind and pair of bodies.
constexpr size_t kMostPlaces = 40;
// Rays along each side of a mask pixel, to find the robot in it.
constexpr int kRaysPerPixel = 12;

PlaceInView::Plane PlaneAt(const ObstacleImage& image, int x, int y) {
  if (image.obstacle().at(x, y)) return PlaceInView::kObstacle;
  if (image.unknown().at(x, y)) return PlaceInView::kUnknown;
  return image.error().at(x, y) ? PlaceInView::kError : PlaceInView::kBackground;
}

int PixelOf(double coordinate) { return static_cast<int>(std::floor(coordinate + 0.5)); }

}  // namespace

std::string NameOf(Cause cause) {
  static const std::array<const char*, kCauses> names = {
      "hidden", "occluded",    "contrast",  "rim",  "robot_cell", "shadow",
      "grown",  "robot_image", "test_cell", "size", "unexplained"};
  return names[static_cast<size_t>(cause)];
}

CauseFound FindCause(std::span<const Place> places, const Policy& policy, bool on_grid) {
  if (IsSound(policy.preset)) return FindSoundCause(places, on_grid);
  const int views = static_cast<int>(places[0].size());
  const int needed = IsCalibrated(policy.preset) ? 1 : MinViews(policy, views);
  std::optional<CauseFound> fault;
  size_t fewest = places[0].size() + 1;  // faulty views of a place that should convict
  CauseFound hidden{.cause = Cause::kHidden, .place = 0, .view = 0};
  for (size_t i = 0; i < places.size(); ++i) {
    if (ViewsOpen(places[i]) > ViewsOpen(places[hidden.place])) hidden.place = i;
    if (ViewsOpen(places[i]) < needed) continue;
    size_t faults = 0;
    CauseFound found{.cause = Cause::kUnexplained, .place = i, .view = 0};
    for (size_t view = 0; view < places[i].size(); ++view) {
      const std::optional<Cause> wrong = FaultIn(places[i][view], on_grid);
      if (!wrong) continue;
      if (faults++ == 0) {
        found.cause = *wrong;
        found.view = view;
      }
    }
    if (faults >= fewest) continue;
    fewest = faults;
    fault = found;
  }
  if (ViewsOpen(places[hidden.place]) > 0) hidden.cause = Cause::kOccluded;
  return fault.value_or(hidden);
}

Explainer::Explainer(const TrialSetting& setting)
    : setting_(setting),
      cameras_(setting.workplace.TrueCalibration().cameras),
      robot_(BodyPartsOf(setting.workplace.robot())) {
  for (size_t view = 0; view < cameras_.size(); ++view) {
    const MaskSize size = setting.database.robot_images().mask_sizes()[view];
    mask_cameras_.push_back(cameras_[view].ScaledTo(size.width, size.height));
  }
}

bool Explainer::RobotInPixel(size_t view, const Eigen::Vector2d& pixel) const {
  const CameraModel& camera = mask_cameras_[view];
  // A little more than the pixel: the clean-up of the camera image rounds by one camera pixel.
  const double x_side = 1 + 2.0 * camera.intrinsics().width / cameras_[view].intrinsics().width;
  const double y_side = 1 + 2.0 * camera.intrinsics().height / cameras_[view].intrinsics().height;
  for (int i = 0; i < kRaysPerPixel * kRaysPerPixel; ++i) {
    const double across = (i % kRaysPerPixel + 0.5) / kRaysPerPixel - 0.5;
    const double down = (i / kRaysPerPixel + 0.5) / kRaysPerPixel - 0.5;
    const auto ray =
        camera.Ray({PixelOf(pixel.x()) + x_side * across, PixelOf(pixel.y()) + y_side * down});
    if (ray && robot_.Meets(camera.Centre(), *ray)) return true;
  }
  return false;
}

Cause Explainer::CoverOf(const ViewedScene& viewed, size_t view, const Eigen::Vector2d& pixel) {
  if (RobotInPixel(view, pixel)) return Cause::kRim;
  const ConfigurationGrid& grid = setting_.database.grid();
  bool at_corner = false;
  const CellCorners corners = grid.CornersAround(viewed.truth.robot);
  for (const ConfigurationNumber corner : corners.numbers()) {
    robot_.Place(setting_.workplace.LinkPoses(grid.At(corner)));
    at_corner = at_corner || RobotInPixel(view, pixel);
  }
  robot_.Place(setting_.workplace.LinkPoses(viewed.truth.robot));
  if (at_corner) return Cause::kRobotCell;
  return setting_.database.robot_images().drawn() != nullptr ? Cause::kGrown : Cause::kShadow;
}

Place Explainer::At(const ViewedScene& viewed, const std::vector<Mask>& test_images,
                    const Eigen::Vector3d& point) {
  Place place(cameras_.size());
  for (size_t view = 0; view < place.size(); ++view) {
    const Eigen::Vector3d centre = mask_cameras_[view].Centre();
    place[view].robot_in_line = robot_.Meets(centre, point - centre);
    const auto pixel = mask_cameras_[view].Project(point);
    if (!pixel || !mask_cameras_[view].Contains(*pixel)) continue;
    const MaskSize size = test_images[view].size();
    const int x = std::clamp(PixelOf(pixel->x()), 0, size.width - 1);
    const int y = std::clamp(PixelOf(pixel->y()), 0, size.height - 1);
    place[view].plane = PlaneAt(*viewed.scene.obstacle_images[view], x, y);
    place[view].in_test_image = test_images[view].at(x, y);
    const bool covered =
        place[view].plane == PlaceInView::kUnknown || place[view].plane == PlaceInView::kError;
    if (covered && !place[view].robot_in_line) place[view].cover = CoverOf(viewed, view, *pixel);
  }
  return place;
}

std::vector<Explanation> Explainer::Explain(const ViewedScene& viewed,
                                            const MissedConfiguration& missed) {
  const Poses links = setting_.workplace.LinkPoses(missed.configuration);
  const Poses obstacles = ObstaclePoses(viewed.truth.obstacles, 0);
  const ContactChecker contact(setting_.workplace.robot(), viewed.truth.obstacles);
  const std::vector<ContactPoint> points = contact.Points(links, obstacles, kMostPlaces);
  robot_.Place(setting_.workplace.LinkPoses(viewed.truth.robot));
  const CollisionChecker test(setting_.database.robot_images(), viewed.scene.obstacle_images, {});
  const std::vector<Mask> test_images = *test.TestRobotImages(missed.configuration);
  std::vector<Place> places;
  for (const ContactPoint& point : points) places.push_back(At(viewed, test_images, point.point));

  std::vector<Explanation> explanations;
  for (const size_t p : missed.policies) {
    if (places.empty()) {
      explanations.push_back({.sentence = "The bodies graze each other without a common point."});
      continue;
    }
    const Policy& policy = setting_.policies[p];
    CauseFound found = FindCause(places, policy, missed.where == kOnGrid);
    if (found.cause == Cause::kSize) found = SoundCause(viewed, points, places, found);
    const ContactPoint& point = points[found.place];
    explanations.push_back({.cause = found.cause,
                            .sentence = Sentence(viewed, found, places[found.place], point, policy),
                            .place = point.point});
  }
  return explanations;
}

std::optional<size_t> Explainer::ViewThrough(const ViewedScene& viewed,
                                             const Eigen::Vector3d& centre, double radius) const {
  for (const Eigen::Vector3d& point : PointsOfBall(centre, radius)) {
    for (size_t view = 0; view < mask_cameras_.size(); ++view) {
      const auto pixel = mask_cameras_[view].Project(point);
      if (!pixel || !mask_cameras_[view].Contains(*pixel)) continue;
      const ObstacleImage& image = *viewed.scene.obstacle_images[view];
      const int x = std::clamp(PixelOf(pixel->x()), 0, image.size().width - 1);
      const int y = std::clamp(PixelOf(pixel->y()), 0, image.size().height - 1);
      if (PlaneAt(image, x, y) == PlaceInView::kBackground) return view;
    }
  }
  return std::nullopt;
}

CauseFound Explainer::SoundCause(const ViewedScene& viewed, std::span<const ContactPoint> points,
                                 std::span<const Place> places, const CauseFound& found) const {
  const double radius = setting_.database.sound()->space().least_obstacle();
  std::optional<CauseFound> seen_through;
  for (size_t i = 0; i < points.size(); ++i) {
    const bool as_it_should_be = std::ranges::all_of(places[i], [](const PlaceInView& view) {
      return view.in_test_image && view.plane != PlaceInView::kBackground;
    });
    if (!as_it_should_be) continue;
    for (const Obstacle& obstacle : viewed.truth.obstacles) {
      for (const Eigen::Vector3d& centre : BallsWithin(obstacle, points[i].point, radius)) {
        const std::optional<size_t> view = ViewThrough(viewed, centre, radius);
        if (!view) return {.cause = Cause::kUnexplained, .place = i, .view = 0};
        seen_through = CauseFound{.cause = Cause::kContrast, .place = i, .view = *view};
      }
    }
  }
  return seen_through.value_or(found);
}

double Explainer::DifferenceAt(const ViewedScene& viewed, size_t view,
                               const Eigen::Vector3d& point) const {
  const CameraImage& image = viewed.images[view];
  const auto pixel = cameras_[view].Project(point);
  const int x = std::clamp(PixelOf(pixel->x()), 0, image.width - 1);
  const int y = std::clamp(PixelOf(pixel->y()), 0, image.height - 1);
  const Reference reference = setting_.database.reference(static_cast<int>(view)).AsGrey();
  const Picture colours = PictureOfPixels(image.width, image.height, image.channels, image.pixels);
  const cv::Mat grey = Grey(colours);
  const Brightness light = BrightnessOf(grey, reference);
  const double mean =
      static_cast<double>(reference.mean().at<uint16_t>(y, x)) / Reference::kGreyLevel;
  const double expected = light.gain * mean + light.offset;
  return grey.at<uint8_t>(y, x) - expected;
}

std::string Explainer::Hidden(const Place& place, const ContactPoint& contact) const {
  std::vector<std::string> before;
  std::vector<std::string> behind;
  for (size_t view = 0; view < place.size(); ++view) {
    if (!place[view].robot_in_line) continue;
    const Eigen::Vector3d centre = mask_cameras_[view].Centre();
    const bool in_front = robot_.FirstOn(centre, contact.point - centre) < 1;
    (in_front ? before : behind).push_back(setting_.workplace.cell().views[view].name);
  }
  std::string text;
  if (!before.empty()) absl::StrAppend(&text, "behind the robot in ", absl::StrJoin(before, ", "));
  if (!behind.empty()) {
    absl::StrAppend(&text, text.empty() ? "" : "; ", "in front of it in ",
                    absl::StrJoin(behind, ", "));
  }
  return text;
}

std::string Explainer::Sentence(const ViewedScene& viewed, const CauseFound& found,
                                const Place& place, const ContactPoint& contact,
                                const Policy& policy) const {
  const std::string where = absl::StrCat(contact.link, " meets ", contact.obstacle);
  const std::string view = setting_.workplace.cell().views[found.view].name;
  const int views = static_cast<int>(place.size());
  switch (found.cause) {
    case Cause::kHidden:
      return absl::StrCat("Hidden in all views where ", where, ": ", Hidden(place, contact), ".");
    case Cause::kOccluded: {
      const auto open = std::count_if(place.begin(), place.end(),
                                      [](const auto& each) { return !each.robot_in_line; });
      return absl::StrCat("Hidden in some views where ", where, ": ", Hidden(place, contact),
                          "; only ", open, open == 1 ? " view is" : " views are",
                          " open, the policy asks for ", MinViews(policy, views), ".");
    }
    case Cause::kContrast:
      return absl::StrFormat(
          "Background subtraction: where %s, %s shows %+.0f grey levels against the empty cell, "
          "too few.",
          where, view, DifferenceAt(viewed, found.view, contact.point));
    case Cause::kRim:
      return absl::StrCat("Discretisation: where ", where, ", ", view,
                          " sees past the robot, but within a mask pixel that the robot touches.");
    case Cause::kRobotCell:
      return absl::StrCat("Discretisation: the robot stands between grid points, and in ", view,
                          " the images of its grid cell's corners cover where ", where, ".");
    case Cause::kShadow:
      return absl::StrCat("Background subtraction: where ", where, ", the robot's image in ", view,
                          " is its shadow.");
    case Cause::kGrown:
      return absl::StrCat("Drawn image: where ", where, ", the robot's image in ", view,
                          " is larger than the robot, by tolerance, link growth and margin.");
    case Cause::kRobotImage:
      return absl::StrCat("Robot image: in ", view, " it lacks the pixel where ", where, ".");
    case Cause::kTestCell:
      return absl::StrCat("Discretisation: in ", view,
                          " no robot image at the grid cell's corners has the pixel where ", where,
                          ".");
    case Cause::kSize:
      return absl::StrCat("Size: ", where, " where no ball of the least obstacle's radius lies in ",
                          "it.");
    case Cause::kUnexplained:
      break;
  }
  return absl::StrCat("Unexplained: where ", where, ", the images are as they should be.");
}

absl::StatusOr<SceneRecord> RunScene(const TrialSetting& setting, Explainer& explainer,
                                     const SceneSource& source, int number) {
  ASSIGN_OR_RETURN(ViewedScene viewed, View(setting, source(number), number));
  TrialResult result = Judge(setting, viewed, number);
  SceneRecord record{.number = number,
                     .robot_on_grid = viewed.truth.robot_on_grid,
                     .blocked = result.blocked,
                     .tallies = std::move(result.tallies),
                     .missing = {}};
  for (MissedConfiguration& missed : result.missed) {
    std::vector<Explanation> explanations = explainer.Explain(viewed, missed);
    record.missing.push_back({std::move(missed), std::move(explanations)});
  }
  return record;
}

}  // namespace silhouette::cell_experiment
