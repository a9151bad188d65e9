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

// The bundle, with what was left out in runs at the session's ends. Nothing: there are none.
std::optional<Bundle> WithRuns(const FrameOrder& order, Bundle bundle) {
  bool any = false;
  for (size_t camera = 0; camera < bundle.cameras.size(); ++camera) {
    std::map<int, bool> used;
    for (const BundleCorner& corner : bundle.corners) {
      if (corner.camera != static_cast<int>(camera)) continue;
      if (const int place = order.PlaceOf(corner); place >= 0) used[place] |= corner.used;
    }
    const std::vector<int> runs = RunsAtTheEnds(used);
    any = any || !runs.empty();
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
    any = true;
    bundle.flanges[static_cast<size_t>(flanges[place])].left_out = false;
  }
  return any ? std::optional(std::move(bundle)) : std::nullopt;
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
  Misfits(const RobotNoise& noise, LinearBundle linear, PoseFit& fit)
      : fit_(fit),
        order_(fit.network),
        with_runs_(WithRuns(order_, fit.bundle)),
        bundle_(with_runs_ ? *with_runs_ : fit.bundle),
        boxes_(fit),
        linear_(std::move(linear)) {
    if (!bundle_.flanges.empty()) {
      least_robot_ = std::pow(noise.position_sigma / bundle_.flanges.front().position_sigma, 2);
    }
    for (const BundleCorner& corner : bundle_.corners) {
      if (corner.used) used_.push_back(&corner);
    }
  }

  absl::StatusOr<PoseMisfits> Find() {
    if (with_runs_) {
      auto linear = LinearBundle::Of(bundle_);
      if (!linear.ok()) return PoseMisfits();  // what was left out does not fit in
      linear_ = *std::move(linear);
    }
    FindLens();
    // What a lens lacks looks like motion where the robot drives from side to side.
    if (found_.doubts.empty()) {
      FindMotion();
    } else {
      found_.doubts.back() +=
          "; with such a lens, motions of cameras and boards during the session are not looked for";
    }
    return std::move(found_);
  }

 private:
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
  };

  // The variances once more, of what is left with these unknowns.
  Eigen::VectorXd VariancesWith(const FoundUnknowns& found) const {
    Eigen::VectorXd variances = linear_.errors.Variances(
        found.residuals, std::vector<std::optional<double>>(std::size(linear_.variances)));
    variances[0] = std::max(least_robot_, variances[0]);
    return variances;
  }

  // The unknowns, against errors as large as they are without them.
  FoundUnknowns FindAgain(const ErrorRows& by_unknown) const {
    const FoundUnknowns first = linear_.errors.Find(by_unknown, linear_.variances);
    return linear_.errors.Find(by_unknown, VariancesWith(first));
  }

  // Radial terms of the third and fifth order and tangential ones, as shifts in the image.
  ErrorRows LensRows() const {
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
    ErrorRows rows(linear_.errors.solved().jacobian.rows(),
                   kLensTerms * std::ssize(bundle_.cameras));
    rows.setFromTriplets(entries.begin(), entries.end());
    return rows;
  }

  void FindLens() {
    const ErrorRows by_term = LensRows();
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

  // The residuals' derivatives by a motion, of the corners that it moves at each place in time.
  std::map<int, Eigen::SparseMatrix<double>> MotionRows(const Mover& mover) const {
    const ErrorRows& jacobian = linear_.errors.solved().jacobian;
    std::map<int, std::vector<Eigen::Triplet<double>>> entries;
    for (size_t i = 0; i < used_.size(); ++i) {
      const int place = order_.PlaceOf(*used_[i]);
      if (!mover.Has(*used_[i]) || place < 0) continue;
      for (size_t row = 2 * i; row < 2 * i + 2; ++row) {
        for (ErrorRows::InnerIterator entry(jacobian, row); entry; ++entry) {
          const auto column = static_cast<int>(entry.col()) - mover.block->column;
          if (column < 0 || column >= 6) continue;
          entries[place].emplace_back(row, column, entry.value() / linear_.scale[entry.col()]);
        }
      }
    }
    std::map<int, Eigen::SparseMatrix<double>> rows;
    for (const auto& [place, of_place] : entries) {
      rows[place].resize(jacobian.rows(), 6);
      rows[place].setFromTriplets(of_place.begin(), of_place.end());
    }
    return rows;
  }

  // The likeliest place in time of a motion of each mover.
  std::vector<Motion> Motions() const {
    std::vector<Motion> motions;
    for (const Mover& mover : Movers()) {
      std::vector<int> places;
      std::vector<Eigen::SparseMatrix<double>> rows;
      for (auto& [place, of_place] : MotionRows(mover)) {
        places.push_back(place);
        rows.push_back(of_place);
      }
      const std::vector<double> chi2 = linear_.errors.Chi2FromEachOn(rows, linear_.variances);
      Motion best{.mover = mover};
      for (size_t i = kLeastFrames; i + kLeastFrames <= places.size(); ++i) {
        if (chi2[i] > best.chi2) best = {mover, places[i], chi2[i]};
      }
      if (best.chi2 > kMotionLook) motions.push_back(best);
    }
    return motions;
  }

  FoundUnknowns FindMotionAgain(const Motion& motion) const {
    Eigen::SparseMatrix<double> sum(linear_.errors.solved().jacobian.rows(), 6);
    for (const auto& [place, rows] : MotionRows(motion.mover)) {
      if (place >= motion.from) sum += rows;
    }
    return FindAgain(sum);
  }

  void FindMotion() {
    std::vector<Motion> motions = Motions();
    if (motions.empty()) return;
    std::vector<FoundUnknowns> found;
    for (Motion& motion : motions) {
      found.push_back(FindMotionAgain(motion));
      motion.chi2 = found.back().Chi2(0, 6);
    }
    const auto likeliest = std::ranges::max_element(motions, {}, &Motion::chi2);
    if (likeliest->chi2 < kMotionChance) return;
    const FoundUnknowns& motion = found[static_cast<size_t>(likeliest - motions.begin())];
    const double shift = ShiftOf(likeliest->mover, motion.values);
    std::string names = likeliest->mover.block->pose->name;
    const Eigen::VectorXd variances = VariancesWith(motion);
    for (size_t i = 0; i < motions.size(); ++i) {
      if (&motions[i] == &*likeliest) continue;
      if (LeftOf(found[i], variances) - LeftOf(motion, variances) > kAsLikely) continue;
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
  double LeftOf(const FoundUnknowns& found, const Eigen::VectorXd& variances) const {
    constexpr double kLeast = 1e-3;  // fields may have it all
    const Eigen::Index corners = 2 * std::ssize(used_);
    const double robot = std::max(kLeast, variances[0]);
    return found.residuals.head(corners).squaredNorm() / std::max(kLeast, variances[1]) +
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
  std::optional<Bundle> with_runs_;
  Bundle& bundle_;
  WorkspaceBoxes boxes_;
  double least_robot_ = 0;
  std::vector<const BundleCorner*> used_;
  LinearBundle linear_;
  PoseMisfits found_;
};

}  // namespace

absl::StatusOr<PoseMisfits> FindMisfits(const RobotNoise& noise, LinearBundle linear,
                                        PoseFit& fit) {
  return Misfits(noise, std::move(linear), fit).Find();
}

}  // namespace silhouette
