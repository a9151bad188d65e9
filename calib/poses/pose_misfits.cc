// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/poses/linear_bundle.h"
#include "calib/poses/pose_fit.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Frames on each side of a motion.
constexpr size_t kLeastFrames = 3;
// Chi2 of a motion's six unknowns: worth a closer look; beyond what chance gives; and beyond what
// errors of a robot do that grow with its way, where it drives from side to side.
constexpr double kMotionLook = 15;
constexpr double kMotionChance = 60;
constexpr double kMotionCertain = 120;
// Metres, root mean square over the points that it moves: refused from here on.
constexpr double kRefusedMotion = 0.8e-3;
// A motion that leaves a sum of squares larger by less than this is as likely.
constexpr double kAsLikely = 40;

// Terms of a lens that its model may lack, and the chi2 that chance does not give them.
constexpr int kLensTerms = 4;
constexpr double kLensChance = 60;
// Missing at a corner, of the image's width: mentioned; and refused, where it moves the workspace
// by kRefusedLensShift, metres.
constexpr double kMentionedLens = 3e-4;
constexpr double kRefusedLens = 1e-3;
constexpr double kRefusedLensShift = 1e-3;

// The frames' places in time: those that the robot drove to, in its order. Others have none.
class FrameOrder {
 public:
  explicit FrameOrder(const PoseNetwork& network) : network_(network) {
    for (const RobotPose& pose : network.robot_poses) {
      places_.emplace(pose.frame, static_cast<int>(places_.size()));
    }
    if (!places_.empty()) return;
    for (const Look& look : network.looks) {
      places_.emplace(look.frame, static_cast<int>(places_.size()));
    }
  }
  // -1: none.
  int PlaceOf(const BundleCorner& corner) const {
    const auto found = places_.find(network_.looks[corner.look].frame);
    return found == places_.end() ? -1 : found->second;
  }
  std::string NameOf(int place) const {
    for (const auto& [frame, other] : places_) {
      if (other == place) return frame;
    }
    return "";
  }

 private:
  const PoseNetwork& network_;
  std::map<std::string, int> places_;
};

// Places in time of which nothing is used, at the beginning or the end: several one after the
// other are no outliers, but what a motion leaves.
std::vector<int> RunsAtTheEnds(const std::map<int, bool>& used) {
  std::vector<int> first;
  for (const auto& [place, any] : used) {
    if (any) break;
    first.push_back(place);
  }
  std::vector<int> last;
  for (auto place = used.rbegin(); place != used.rend() && !place->second; ++place) {
    last.push_back(place->first);
  }
  std::vector<int> runs;
  for (const std::vector<int>& run : {first, last}) {
    if (run.size() >= kLeastFrames) runs.insert(runs.end(), run.begin(), run.end());
  }
  return runs;
}

// The bundle, with what was left out in runs at the session's ends.
Bundle WithRuns(const FrameOrder& order, Bundle bundle) {
  for (size_t camera = 0; camera < bundle.cameras.size(); ++camera) {
    std::map<int, bool> used;
    for (const BundleCorner& corner : bundle.corners) {
      if (corner.camera != static_cast<int>(camera)) continue;
      if (const int place = order.PlaceOf(corner); place >= 0) used[place] |= corner.used;
    }
    const std::vector<int> runs = RunsAtTheEnds(used);
    for (BundleCorner& corner : bundle.corners) {
      if (corner.camera != static_cast<int>(camera) || !corner.residual.allFinite()) continue;
      if (std::ranges::count(runs, order.PlaceOf(corner)) > 0) corner.used = true;
    }
  }
  std::map<int, bool> used;
  std::map<int, int> flanges;
  for (const BundleCorner& corner : bundle.corners) {
    if (corner.flange < 0 || !corner.used) continue;
    const int place = order.PlaceOf(corner);
    used[place] = !bundle.flanges[static_cast<size_t>(corner.flange)].left_out;
    flanges[place] = corner.flange;
  }
  for (const int place : RunsAtTheEnds(used)) {
    bundle.flanges[static_cast<size_t>(flanges[place])].left_out = false;
  }
  return bundle;
}

double RmsShift(const std::vector<Eigen::Vector3d>& points,
                const Eigen::Ref<const Eigen::VectorXd>& motion) {
  double sum = 0;
  for (const Eigen::Vector3d& point : points) {
    sum += (DerivativeByMotion(point) * motion).squaredNorm();
  }
  return points.empty() ? 0 : std::sqrt(sum / static_cast<double>(points.size()));
}

class Misfits {
 public:
  Misfits(const RobotNoise& noise, PoseFit& fit)
      : fit_(fit), order_(fit.network), bundle_(WithRuns(order_, fit.bundle)), boxes_(fit) {
    if (!bundle_.flanges.empty()) {
      least_robot_ = std::pow(noise.position_sigma / bundle_.flanges.front().position_sigma, 2);
    }
    for (const BundleCorner& corner : bundle_.corners) {
      if (corner.used) used_.push_back(&corner);
    }
  }

  absl::StatusOr<PoseMisfits> Find() {
    auto linear = LinearBundle::Of(bundle_);
    if (!linear.ok()) return PoseMisfits();  // what was left out does not fit in
    linear_ = *std::move(linear);
    FindLens();
    // What a lens lacks looks like motion where the robot drives from side to side.
    if (found_.doubts.empty()) FindMotion();
    return std::move(found_);
  }

 private:
  using Rows = ErrorPart::Rows;

  // What moves: a pose, by the unscaled columns of its block.
  struct Mover {
    const BundleBlock* block = nullptr;
    bool camera = false;
    size_t index = 0;  // of the camera or board pose
    bool Has(const BundleCorner& corner) const {
      return static_cast<int>(index) == (camera ? corner.camera : corner.board_pose);
    }
  };

  struct Motion {
    Mover mover;
    int from = 0;  // place in time
    double chi2 = 0;
    Rows by_motion;
  };

  // The variances once more, of what is left with these unknowns.
  std::vector<ErrorPart> PartsWithout(const FoundUnknowns& found) const {
    LeastSquares rest = linear_.solved;
    rest.residuals = found.residuals;
    std::vector<ErrorPart> parts = linear_.parts;
    for (ErrorPart& part : parts) part.variance.reset();
    CovarianceByParts(rest, parts);
    parts.front().variance = std::max(least_robot_, *parts.front().variance);
    return parts;
  }

  // The unknowns, against errors as large as they are without them.
  FoundUnknowns FindAgain(const Rows& by_unknown) const {
    const FoundUnknowns first = UnknownSearch(linear_.solved, linear_.parts).Find(by_unknown);
    const std::vector<ErrorPart> parts = PartsWithout(first);
    return UnknownSearch(linear_.solved, parts).Find(by_unknown);
  }

  // Radial terms of the third and fifth order and tangential ones, as shifts in the image.
  Rows LensRows() const {
    std::vector<Eigen::Triplet<double>> entries;
    for (size_t i = 0; i < used_.size(); ++i) {
      const BundleCorner& corner = *used_[i];
      const CameraIntrinsics& lens = bundle_.lenses[static_cast<size_t>(corner.camera)];
      const double half = 0.5 * std::hypot(lens.width, lens.height);
      const Eigen::Vector2d out = (corner.pixel - Eigen::Vector2d(lens.cx, lens.cy)) / half;
      const double square = out.squaredNorm();
      Eigen::Matrix<double, 2, kLensTerms> terms;
      terms << out * square, out * square * square,
          Eigen::Vector2d(2 * out.x() * out.y(), square + 2 * out.y() * out.y()),
          Eigen::Vector2d(square + 2 * out.x() * out.x(), 2 * out.x() * out.y());
      for (int axis = 0; axis < 2; ++axis) {
        for (int k = 0; k < kLensTerms; ++k) {
          entries.emplace_back(2 * i + axis, kLensTerms * corner.camera + k,
                               terms(axis, k) / corner.sigma);
        }
      }
    }
    Rows rows(linear_.solved.jacobian.rows(), kLensTerms * std::ssize(bundle_.cameras));
    rows.setFromTriplets(entries.begin(), entries.end());
    return rows;
  }

  void FindLens() {
    const Rows by_term = LensRows();
    const FoundUnknowns found = FindAgain(by_term);
    const Eigen::VectorXd state = linear_.scale.cwiseProduct(found.state);
    bool certain = false;
    for (const BundleBlock& block : linear_.blocks) {
      for (size_t camera = 0; camera < bundle_.cameras.size(); ++camera) {
        if (block.pose != &bundle_.cameras[camera]) continue;
        const Eigen::Index first = kLensTerms * static_cast<Eigen::Index>(camera);
        if (found.Chi2(first, kLensTerms) < kLensChance) continue;
        certain = true;
        Eigen::VectorXd alone = Eigen::VectorXd::Zero(found.values.size());
        alone.segment(first, kLensTerms) = found.values.segment(first, kLensTerms);
        JudgeLens(camera, by_term * alone, state.segment<6>(block.column));
      }
    }
    if (certain) CountLens(state);
  }

  // `missing`: of the corners, in sigmas. `motion`: of the camera by all lenses' missing terms.
  void JudgeLens(size_t camera, const Eigen::VectorXd& missing,
                 const Eigen::Ref<const Eigen::VectorXd>& motion) {
    double longest = 0;
    for (size_t i = 0; i < used_.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(2 * i);
      longest = std::max(longest, used_[i]->sigma * missing.segment<2>(row).norm());
    }
    const PoseView& view = fit_.network.views[camera];
    if (longest < kMentionedLens * view.lens.width) return;
    const double shift = RmsShift(boxes_.PointsFor(view.on_flange), motion);
    const bool refused = longest > kRefusedLens * view.lens.width && shift > kRefusedLensShift;
    const bool none = std::ranges::all_of(view.lens.distortion, [](double d) { return d == 0; });
    (refused ? found_.doubts : found_.warnings)
        .push_back(absl::StrFormat(
            "the lens model of view '%s' does not fit%s: what is left grows with the distance from "
            "the image's centre, to %.1f px where boards were seen, and may shift points of the "
            "workspace by %.1f mm; calibrate this lens with 'silhouette-calibrate intrinsics', at "
            "the zoom, focus and image size of these frames",
            view.name, none ? " (it states no distortion)" : "", longest, 1000 * shift));
  }

  // By how much the poses change with the missing terms, as an error of theirs.
  void CountLens(const Eigen::VectorXd& state) {
    for (const BundleBlock& block : linear_.blocks) {
      if (!block.pose) continue;
      const Eigen::VectorXd motion = state.segment<6>(block.column);
      const auto count = [&](std::vector<BundlePose>& whole, std::vector<BundlePose>& fit) {
        for (size_t i = 0; i < whole.size(); ++i) {
          if (block.pose == &whole[i]) fit[i].covariance += motion * motion.transpose();
        }
      };
      count(bundle_.cameras, fit_.bundle.cameras);
      count(bundle_.board_poses, fit_.bundle.board_poses);
    }
  }

  std::vector<Mover> Movers() const {
    std::vector<Mover> movers;
    for (const BundleBlock& block : linear_.blocks) {
      for (size_t i = 0; i < bundle_.cameras.size(); ++i) {
        if (block.pose == &bundle_.cameras[i]) movers.push_back({&block, true, i});
      }
      for (size_t i = 0; i < bundle_.board_poses.size(); ++i) {
        const int board = fit_.network.board_poses[i].board;
        if (block.pose == &bundle_.board_poses[i] &&
            fit_.network.boards[static_cast<size_t>(board)].place != BoardPlace::kLoose) {
          movers.push_back({&block, false, i});
        }
      }
    }
    return movers;
  }

  Rows MotionRows(const Mover& mover, int from) const {
    std::vector<Eigen::Triplet<double>> entries;
    for (size_t i = 0; i < used_.size(); ++i) {
      if (!mover.Has(*used_[i]) || order_.PlaceOf(*used_[i]) < from) continue;
      for (size_t row = 2 * i; row < 2 * i + 2; ++row) {
        for (Rows::InnerIterator entry(linear_.solved.jacobian, row); entry; ++entry) {
          const auto column = static_cast<int>(entry.col()) - mover.block->column;
          if (column < 0 || column >= 6) continue;
          entries.emplace_back(row, column, entry.value() / linear_.scale[entry.col()]);
        }
      }
    }
    Rows rows(linear_.solved.jacobian.rows(), 6);
    rows.setFromTriplets(entries.begin(), entries.end());
    return rows;
  }

  std::vector<int> PlacesOf(const Mover& mover) const {
    std::vector<int> places;
    for (const BundleCorner* corner : used_) {
      const int place = order_.PlaceOf(*corner);
      if (mover.Has(*corner) && place >= 0) places.push_back(place);
    }
    std::ranges::sort(places);
    places.erase(std::unique(places.begin(), places.end()), places.end());
    return places;
  }

  // The likeliest place in time of a motion of each mover.
  std::vector<Motion> Motions() const {
    const UnknownSearch search(linear_.solved, linear_.parts);
    std::vector<Motion> motions;
    for (const Mover& mover : Movers()) {
      Motion best{.mover = mover, .from = 0, .chi2 = 0, .by_motion{}};
      const std::vector<int> places = PlacesOf(mover);
      for (size_t i = kLeastFrames; i + kLeastFrames <= places.size(); ++i) {
        Rows rows = MotionRows(mover, places[i]);
        const double chi2 = search.Find(rows).Chi2(0, 6);
        if (chi2 > best.chi2) best = {mover, places[i], chi2, std::move(rows)};
      }
      if (best.chi2 > kMotionLook) motions.push_back(std::move(best));
    }
    return motions;
  }

  void FindMotion() {
    std::vector<Motion> motions = Motions();
    if (motions.empty()) return;
    std::vector<FoundUnknowns> found;
    for (Motion& motion : motions) {
      found.push_back(FindAgain(motion.by_motion));
      motion.chi2 = found.back().Chi2(0, 6);
    }
    const auto likeliest = std::ranges::max_element(motions, {}, &Motion::chi2);
    if (likeliest->chi2 < kMotionChance) return;
    const FoundUnknowns& motion = found[static_cast<size_t>(likeliest - motions.begin())];
    const double shift = ShiftOf(likeliest->mover, motion.values);
    std::string names = likeliest->mover.block->pose->name;
    const std::vector<ErrorPart> parts = PartsWithout(motion);
    for (size_t i = 0; i < motions.size(); ++i) {
      if (&motions[i] == &*likeliest) continue;
      if (LeftOf(found[i], parts) - LeftOf(motion, parts) > kAsLikely) continue;
      absl::StrAppend(&names, " or ", motions[i].mover.block->pose->name);
    }
    const bool refused = likeliest->chi2 > kMotionCertain && shift > kRefusedMotion;
    (refused ? found_.doubts : found_.warnings)
        .push_back(absl::StrFormat(
            "%s %s: from the frame '%s' on it is elsewhere, by %.1f mm (where boards were seen) "
            "and %.2f deg; fasten it and take the frames again, or use only those before or after",
            names, refused ? "moved" : "may have moved", order_.NameOf(likeliest->from),
            1000 * shift, motion.values.head<3>().norm() / kDegree));
  }

  // The sum of squares that is left with these unknowns, by the parts' variances.
  double LeftOf(const FoundUnknowns& found, const std::vector<ErrorPart>& parts) const {
    constexpr double kLeast = 1e-3;  // fields may have it all
    const Eigen::Index corners = 2 * std::ssize(used_);
    const double robot = std::max(kLeast, *parts[0].variance);
    return found.residuals.head(corners).squaredNorm() / std::max(kLeast, *parts[1].variance) +
           found.residuals.tail(found.residuals.size() - corners).squaredNorm() / robot;
  }

  // Root mean square over the points that the mover moves.
  double ShiftOf(const Mover& mover, const Eigen::VectorXd& motion) const {
    if (mover.camera) {
      return RmsShift(boxes_.PointsFor(fit_.network.views[mover.index].on_flange), motion);
    }
    std::vector<Eigen::Vector3d> points;
    for (const BundleCorner* corner : used_) {
      if (mover.Has(*corner)) points.push_back(corner->point);
    }
    return RmsShift(points, motion);
  }

  PoseFit& fit_;
  FrameOrder order_;
  Bundle bundle_;
  WorkspaceBoxes boxes_;
  double least_robot_ = 0;
  std::vector<const BundleCorner*> used_;
  LinearBundle linear_;
  PoseMisfits found_;
};

}  // namespace

absl::StatusOr<PoseMisfits> FindMisfits(const RobotNoise& noise, PoseFit& fit) {
  return Misfits(noise, fit).Find();
}

}  // namespace silhouette
