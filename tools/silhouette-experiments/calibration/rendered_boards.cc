// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/calibration/rendered_boards.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_format.h"
#include "calib/boards/tag_family.h"
#include "calib/detection/image_tags.h"
#include "calib/intrinsics/solve_lenses.h"
#include "capture/sim/chance.h"
#include "capture/sim/tag_projection.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-experiments/calibration/against_others.h"
#include "tools/silhouette-experiments/calibration/lens_errors.h"
#include "tools/silhouette-experiments/calibration/photographer.h"
#include "tools/silhouette-experiments/calibration/rig.h"

namespace silhouette::calibration_experiment {
namespace {

constexpr double kVignetting = 0.3;  // of the light in the image's corners
constexpr double kMostTilt = 50 * std::numbers::pi / 180;
constexpr double kFalse = 1;         // pixels off: no corner of the board
constexpr double kLeastShare = 0.4;  // of a board's marks that are in the image
constexpr TagProjectionSettings kExact{.sigma = 0, .least_size = 0, .most_tilt = 1.4, .border = 5};

// A camera with a standard lens, and a box before it whose points it sees all over its image.
Rig DrawHandHeldRig(uint64_t seed) {
  Chance chance(seed);
  CameraIntrinsics lens{.width = 1280, .height = 960};
  lens.fx = chance.Uniform(1150, 1300);
  lens.fy = lens.fx * chance.Uniform(0.999, 1.001);
  lens.cx = 639.5 + chance.Uniform(-12, 12);
  lens.cy = 479.5 + chance.Uniform(-12, 12);
  lens.distortion = {chance.Uniform(-0.22, -0.14), chance.Uniform(0.06, 0.1),
                     chance.Uniform(-5e-4, 5e-4), chance.Uniform(-5e-4, 5e-4),
                     chance.Uniform(-0.02, 0)};
  const Eigen::Vector3d place(-2, 0, 1.5);
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitX();
  Rig rig;
  rig.cameras = {
      {"camera", CameraModel(lens, LookAt(place, place + ahead, Eigen::Vector3d::UnitZ()))}};
  rig.workspace = {place + Eigen::Vector3d(0.4, -0.7, -0.5),
                   place + Eigen::Vector3d(1.4, 0.7, 0.5)};
  return rig;
}

// A pose of the board at some place of the image, of some width there.
Eigen::Isometry3d DrawHeldPose(const CameraModel& camera, const Board& board, Chance& chance) {
  const CameraIntrinsics& lens = camera.intrinsics();
  const double share = std::exp(chance.Uniform(std::log(1.0 / 6), std::log(2.0 / 3)));
  const double distance = lens.fx * board.extent().x() / (share * lens.width);
  const Eigen::Vector2d pixel(chance.Uniform(0, lens.width - 1),
                              chance.Uniform(0, lens.height - 1));
  const Eigen::Vector3d ray = camera.Ray(pixel).value();
  const Eigen::Vector3d axis = ray.cross(chance.Direction()).normalized();
  const Eigen::Vector3d normal =
      Eigen::AngleAxisd(chance.Uniform(0, kMostTilt), axis) * -ray.normalized();
  return HeldAt(board, camera.Centre() + distance * ray.normalized(), normal,
                chance.Uniform(-std::numbers::pi, std::numbers::pi));
}

// Held by a hand that is not quite still: up to a pixel long.
Eigen::Isometry3d DrawMotion(const CameraModel& camera, const Board& board,
                             const Eigen::Isometry3d& world_from_board, Chance& chance) {
  const double distance = (world_from_board * MiddleOf(board) - camera.Centre()).norm();
  const double metres = chance.Uniform() * distance / camera.intrinsics().fx;
  Eigen::Isometry3d motion(Eigen::Translation3d(0.5 * metres * chance.Direction()));
  motion.rotate(Eigen::AngleAxisd(metres / board.extent().norm(), chance.Direction()));
  return motion;
}

struct HeldBoard {
  Eigen::Isometry3d world_from_board;
  Shot shot;
  std::vector<TagSighting> truth;  // what can be found in the image
};

HeldBoard DrawHeldBoard(const NamedCamera& camera, const Board& board, const std::string& frame,
                        bool whole, Chance& chance) {
  HeldBoard held;
  const double least = whole ? 1 : kLeastShare;
  do {
    held.world_from_board = DrawHeldPose(camera.model, board, chance);
    held.truth = ProjectTags(camera, frame, board, held.world_from_board, kExact, chance);
  } while (static_cast<double>(held.truth.size()) < least * board.tags());
  held.shot = {.gain = {.middle = chance.Uniform(0.5, 1.6), .slope = chance.Uniform(-0.15, 0.15)},
               .blur = chance.Uniform(0.3, 0.9),
               .vignetting = kVignetting,
               .motion = DrawMotion(camera.model, board, held.world_from_board, chance)};
  return held;
}

// The corner of the board that a pixel shows, and how far it is off; nothing near: none.
struct NearestCorner {
  int tag = 0;
  size_t corner = 0;
  double error = std::numeric_limits<double>::infinity();
};

NearestCorner NearestTo(const Eigen::Vector2d& pixel, const CameraModel& camera, const Board& board,
                        const Eigen::Isometry3d& world_from_board) {
  NearestCorner nearest;
  for (int tag = board.first_mark(); board.HasTag(tag); ++tag) {
    const MarkCorners corners = board.CornersOf(tag);
    for (size_t i = 0; i < corners.size(); ++i) {
      const auto there = camera.Project(world_from_board * corners[i]);
      const double error = there ? (*there - pixel).norm() : nearest.error;
      if (error < nearest.error) nearest = {tag, i, error};
    }
  }
  return nearest;
}

// Tells apart what is visible, found and false.
class Truth {
 public:
  Truth(const CameraModel& camera, const Board& board, const HeldBoard& held)
      : camera_(camera), board_(board), held_(held) {
    for (const TagSighting& mark : held.truth) visible_.insert(mark.tag);
  }

  size_t corners() const {
    return visible_.size() * static_cast<size_t>(board_.corners_per_mark());
  }
  bool Visible(int tag) const { return visible_.contains(tag); }

  void Count(const std::vector<TagSighting>& found, BoardResult& result) const {
    result.corners.AddImage(corners());
    for (const TagSighting& mark : found) {
      const MarkCorners on_board = board_.CornersOf(mark.tag);
      for (size_t i = 0; i < on_board.size(); ++i) {
        const auto there = camera_.Project(held_.world_from_board * on_board[i]);
        const double error = there ? (mark.corners[i] - *there).norm() : 2 * kFalse;
        if (error > kFalse) {
          result.corners.AddFalse();
        } else if (Visible(mark.tag)) {
          result.corners.AddFound(error);
          result.stated.Add({.squares = error * error / (mark.sigma * mark.sigma), .freedom = 2});
        }
      }
    }
  }

  SeenCorners Count(const std::vector<Eigen::Vector2d>& found, CornerCount& count) const {
    SeenCorners seen;
    count.AddImage(corners());
    for (const Eigen::Vector2d& pixel : found) {
      const NearestCorner nearest = NearestTo(pixel, camera_, board_, held_.world_from_board);
      if (nearest.error > kFalse) {
        count.AddFalse();
        continue;
      }
      if (Visible(nearest.tag)) count.AddFound(nearest.error);
      seen.on_board.push_back(board_.CornersOf(nearest.tag)[nearest.corner]);
      seen.pixels.push_back(pixel);
    }
    return seen;
  }

 private:
  const CameraModel& camera_;
  const Board& board_;
  const HeldBoard& held_;
  std::set<int> visible_;
};

RootMeanSquare PixelErrorsOf(const Aligned& aligned) {
  RootMeanSquare errors;
  errors.Add(aligned.errors.squaredNorm(), static_cast<int>(aligned.errors.size() / 2));
  return errors;
}

absl::Status MeasureLens(const Rig& rig, const Board& board,
                         const std::vector<TagSighting>& sightings,
                         const std::vector<SeenCorners>& of_opencv, LineResult& result) {
  const CameraIntrinsics& truth = rig.cameras[0].model.intrinsics();
  const std::vector<SeenPoint> points = SeenPoints(rig, {});
  ++result.runs;
  RootMeanSquare others;
  if (!of_opencv.empty()) {
    const auto lens = LensByOpenCv(truth.width, truth.height, of_opencv);
    if (lens.ok()) {
      others = PixelErrorsOf(Align(points, {*lens}, rig));
    } else {
      ++result.others_failed;
      result.others_failure = std::string(lens.status().message());
    }
  }
  const std::vector<LensCamera> cameras{
      {.name = rig.cameras[0].view, .width = truth.width, .height = truth.height}};
  const auto solution = SolveLenses(cameras, {board}, sightings);
  if (!solution.ok()) {
    return IsRefusal(solution.status(), result) ? absl::OkStatus() : solution.status();
  }
  const Aligned aligned = Align(points, {*solution->cameras[0].model}, rig);
  result.predicted.Add(Predicted(points, *solution, aligned));
  AddRun(PixelErrorsOf(aligned), others, result);
  return absl::OkStatus();
}

}  // namespace

const std::vector<BoardLine>& BoardLines() {
  static const std::vector<BoardLine> lines = {
      {"tags", "4 x 6 tags of tagStandard41h12, gap as wide as a tag",
       Board({.name = "tags", .rows = 4, .columns = 6, .tag_size = 0.03, .gap = 0.03})},
      {"aruco", "OpenCV's GridBoard of 5 x 7 markers, DICT_5X5_100",
       Board({.name = "aruco",
              .family = "DICT_5X5_100",
              .rows = 5,
              .columns = 7,
              .tag_size = 0.04,
              .gap = 0.01})},
      {"aprilgrid", "Kalibr's AprilGrid of 6 x 6 tags, gap 0.3 of a tag",
       Board({.name = "aprilgrid",
              .family = kKalibrFamily,
              .rows = 6,
              .columns = 6,
              .tag_size = 0.04,
              .gap = 0.012,
              .from_bottom = true})},
      {"chessboard", "9 x 6 inner corners",
       Board({.name = "chessboard",
              .kind = BoardKind::kChessboard,
              .rows = 6,
              .columns = 9,
              .square = 0.025})},
      {"charuco", "7 x 5 squares, DICT_4X4_50",
       Board({.name = "charuco",
              .kind = BoardKind::kCharuco,
              .rows = 5,
              .columns = 7,
              .tag_size = 0.03,
              .square = 0.04})},
      {"circles", "an asymmetric board of 6 x 9 circles",
       Board({.name = "circles",
              .kind = BoardKind::kCircles,
              .rows = 9,
              .columns = 6,
              .square = 0.02,
              .asymmetric = true})},
  };
  return lines;
}

double CornerCount::ShareFound() const {
  return visible_ == 0 ? 0 : static_cast<double>(found()) / static_cast<double>(visible_);
}

double CornerCount::Rms() const {
  RootMeanSquare errors;
  for (const double error : errors_) errors.Add(error * error, 2);
  return errors.Result();
}

double CornerCount::Percentile(int per_cent) const {
  if (errors_.empty()) return 0;
  std::vector<double> sorted = errors_;
  std::ranges::sort(sorted);
  return sorted[(sorted.size() - 1) * static_cast<size_t>(per_cent) / 100];
}

absl::Status MeasureBoardLine(const BoardLine& line, int images, uint64_t seed,
                              BoardResult& result) {
  const Rig rig = DrawHandHeldRig(seed);
  const NamedCamera& camera = rig.cameras[0];
  Chance chance(seed);
  Photographer photographer(camera, line.board, seed);
  BoardDetector detector({line.board});
  std::vector<TagSighting> sightings;
  std::vector<SeenCorners> of_opencv;
  for (int i = 0; i < images; ++i) {
    const std::string frame = absl::StrFormat("%04d", i + 1);
    const BoardKind kind = line.board.description().kind;
    const bool whole = i % 3 != 0 || kind == BoardKind::kChessboard || kind == BoardKind::kCircles;
    const HeldBoard held = DrawHeldBoard(camera, line.board, frame, whole, chance);
    const cv::Mat image = photographer.Take(held.world_from_board, held.shot);
    ImageTags tags = FindTags(detector, image, std::nullopt);
    tags.frame = frame;
    tags.view = camera.view;
    const Truth truth(camera.model, line.board, held);
    const std::vector<TagSighting> found = SightingsOf(tags);
    truth.Count(found, result);
    sightings.insert(sightings.end(), found.begin(), found.end());
    if (const auto others = CornersByOpenCv(line.board, image)) {
      of_opencv.push_back(truth.Count(*others, result.of_opencv));
    }
  }
  return MeasureLens(rig, line.board, sightings, of_opencv, result.lens);
}

}  // namespace silhouette::calibration_experiment
