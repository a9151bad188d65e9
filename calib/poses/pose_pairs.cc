// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_pairs.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/camera/camera_model.h"
#include "calib/poses/pose_fit.h"
#include "calib/poses/pose_network.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using Isometries = std::vector<Eigen::Isometry3d>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Parameters = Eigen::Matrix<double, 13, 1>;
using Normals = Eigen::Matrix<double, 13, 13>;

constexpr size_t kLeastPairs = 5;
constexpr size_t kLeastOfHalf = 8;  // pairs by which half of a session is judged
constexpr double kPairOutlier = 5;  // sigmas per axis, of a length
constexpr double kStep = 1e-6;      // of numeric derivatives, metres and radians
// Pairs that miss each other by more, per axis, determine nothing that is of use.
constexpr double kMostPosition = 0.02;         // metres
constexpr double kMostRotation = 2 * kDegree;  // radians
// The median length of a normally distributed triple over its standard deviation per axis.
constexpr double kMedianOfThree = 1.538;
// Shares of the boards that lie in the image: of pairs that are meant so, and at least.
constexpr double kMeantSo = 0.9;
constexpr double kLeastInImage = 0.5;
// Metres from the flange to what is on it, and how many times as far as from the base to what
// stands: with both, poses were inverted.
constexpr double kFarFromFlange = 1;
constexpr double kMuchFarther = 3;

// What is to be solved: camera_pose * link_i * board_pose = seen_i, the seen translation times the
// size. One for each pose of the robot.
struct Links {
  Isometries links;
  Isometries seen;
};

// For each pair the first that the robot's pose is the same of.
std::vector<size_t> FirstsOf(std::span<const PosePair> pairs) {
  std::vector<size_t> firsts;
  for (size_t i = 0; i < pairs.size(); ++i) {
    size_t first = 0;
    while (first < i &&
           (firsts[first] != first ||
            !IsSamePose(pairs[first].base_from_flange, pairs[i].base_from_flange, RobotNoise()))) {
      ++first;
    }
    firsts.push_back(first);
  }
  return firsts;
}

// One pair for each pose of the robot, with the mean of what was seen.
std::vector<PosePair> Merged(std::span<const PosePair> pairs, const std::vector<size_t>& firsts) {
  std::vector<PosePair> merged;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (firsts[i] != i) continue;
    Isometries seen;
    for (size_t k = i; k < pairs.size(); ++k) {
      if (firsts[k] == i) seen.push_back(pairs[k].camera_from_board);
    }
    const Isometries links(seen.size(), Eigen::Isometry3d::Identity());
    merged.push_back(
        {pairs[i].base_from_flange, BoardPoseBy(Eigen::Isometry3d::Identity(), links, seen)});
  }
  return merged;
}

// Of the merged pairs: the first of each among those given, counted from 1.
std::vector<size_t> NumbersOf(const std::vector<size_t>& firsts) {
  std::vector<size_t> numbers;
  for (size_t i = 0; i < firsts.size(); ++i) {
    if (firsts[i] == i) numbers.push_back(i + 1);
  }
  return numbers;
}

// Of all given pairs, from those of the merged ones.
std::vector<PairResidual> ResidualsOf(const std::vector<PairResidual>& merged,
                                      const std::vector<size_t>& firsts,
                                      const std::vector<size_t>& numbers) {
  std::vector<PairResidual> residuals;
  for (const size_t first : firsts) {
    const auto place = std::ranges::lower_bound(numbers, first + 1) - numbers.begin();
    residuals.push_back(merged[static_cast<size_t>(place)]);
  }
  return residuals;
}

Links LinksOf(std::span<const PosePair> pairs, bool on_flange) {
  Links links;
  for (const PosePair& pair : pairs) {
    links.links.push_back(on_flange ? pair.base_from_flange.inverse() : pair.base_from_flange);
    links.seen.push_back(pair.camera_from_board);
  }
  return links;
}

Eigen::Isometry3d Moved(const Eigen::Isometry3d& pose, const Vector6& by) {
  Eigen::Isometry3d motion(Eigen::Translation3d(by.tail<3>()));
  const double angle = by.head<3>().norm();
  if (angle > 0) motion.rotate(Eigen::AngleAxisd(angle, by.head<3>() / angle));
  return pose * motion;
}

// Rotation vector and translation between what is seen and what the poses say.
Vector6 Miss(const Links& links, size_t i, const PairSolution& poses) {
  Eigen::Isometry3d seen = links.seen[i];
  seen.translation() *= poses.size;
  const Eigen::Isometry3d off =
      seen.inverse() * poses.camera_pose * links.links[i] * poses.board_pose;
  Vector6 miss;
  miss << RotationVectorOf(off), off.translation();
  return miss;
}

PairSolution Moved(PairSolution poses, const Parameters& by) {
  poses.camera_pose = Moved(poses.camera_pose, by.head<6>());
  poses.board_pose = Moved(poses.board_pose, by.segment<6>(6));
  poses.size += by[12];
  return poses;
}

// The normal equations of the pairs that are no outliers, weighted by the sigmas.
void NormalEquationsOf(const Links& links, const PairSolution& poses, bool sized, Normals& matrix,
                       Parameters& gradient) {
  matrix.setZero();
  gradient.setZero();
  Vector6 weights;
  weights << Eigen::Vector3d::Constant(1 / poses.rotation_sigma),
      Eigen::Vector3d::Constant(1 / poses.position_sigma);
  for (size_t i = 0; i < links.links.size(); ++i) {
    if (poses.residuals[i].outlier) continue;
    Eigen::Matrix<double, 6, 13> derivative;
    for (int k = 0; k < 13; ++k) {
      const Parameters step = kStep * Parameters::Unit(k);
      derivative.col(k) =
          (Miss(links, i, Moved(poses, step)) - Miss(links, i, Moved(poses, -step))) / (2 * kStep);
    }
    if (!sized) derivative.col(12).setZero();
    derivative = weights.asDiagonal() * derivative;
    matrix += derivative.transpose() * derivative;
    gradient += derivative.transpose() * weights.asDiagonal() * Miss(links, i, poses);
  }
  if (!sized) matrix(12, 12) = 1;
}

// The residuals, and the sigmas by those that are no outliers.
void FindNoise(const Links& links, PairSolution& poses) {
  double rotation = 0;
  double position = 0;
  double count = 0;
  for (size_t i = 0; i < links.links.size(); ++i) {
    const Vector6 miss = Miss(links, i, poses);
    PairResidual& residual = poses.residuals[i];
    residual.rotation = miss.head<3>().norm();
    residual.position = miss.tail<3>().norm();
    if (residual.outlier) continue;
    rotation += miss.head<3>().squaredNorm();
    position += miss.tail<3>().squaredNorm();
    ++count;
  }
  // Each kind of residual determines about half of the twelve unknowns.
  const double freedom = std::max(1.0, 3 * count - 6);
  poses.rotation_sigma = std::max(1e-9, std::sqrt(rotation / freedom));
  poses.position_sigma = std::max(1e-9, std::sqrt(position / freedom));
}

void MarkOutliers(PairSolution& poses) {
  std::vector<double> rotations;
  std::vector<double> positions;
  for (const PairResidual& residual : poses.residuals) {
    rotations.push_back(residual.rotation);
    positions.push_back(residual.position);
  }
  const double rotation = kPairOutlier * Median(rotations) / kMedianOfThree;
  const double position = kPairOutlier * Median(positions) / kMedianOfThree;
  for (PairResidual& residual : poses.residuals) {
    residual.outlier = residual.rotation > std::max(rotation, 1e-6) ||
                       residual.position > std::max(position, 1e-6);
  }
}

constexpr int kRounds = 30;

// Outliers are marked again in the first `marking` rounds.
void Refine(const Links& links, bool sized, int marking, PairSolution& poses) {
  Normals matrix;
  Parameters gradient;
  for (int round = 0; round < kRounds; ++round) {
    NormalEquationsOf(links, poses, sized, matrix, gradient);
    const Parameters step = -matrix.ldlt().solve(gradient);
    if (!step.allFinite()) break;
    poses = Moved(poses, step);
    FindNoise(links, poses);
    if (round < marking) MarkOutliers(poses);
    if (round >= marking && step.norm() < 1e-10) break;
  }
  NormalEquationsOf(links, poses, sized, matrix, gradient);
  const Normals covariance = matrix.inverse();
  poses.covariance = covariance.topLeftCorner<6, 6>();
  if (!sized) return;
  const double variance = covariance(12, 12);
  poses.size_sigma = variance > 0 ? std::sqrt(variance) : std::numeric_limits<double>::infinity();
}

size_t Kept(const PairSolution& poses) {
  return static_cast<size_t>(std::ranges::count(poses.residuals, false, &PairResidual::outlier));
}

// `sized`: finds the size, too.
std::optional<PairSolution> SolveLinks(const Links& links, bool sized = false) {
  const std::optional<Eigen::Isometry3d> camera_pose = CameraPoseByPark(links.links, links.seen);
  if (!camera_pose) return std::nullopt;
  PairSolution poses;
  poses.camera_pose = *camera_pose;
  poses.board_pose = BoardPoseBy(*camera_pose, links.links, links.seen);
  poses.residuals.resize(links.links.size());
  FindNoise(links, poses);
  Refine(links, sized, kRounds / 2, poses);
  return poses;
}

// In sigmas of what is of use; infinity if there is no solution.
double Badness(const std::optional<PairSolution>& solution) {
  if (!solution || !solution->covariance.allFinite()) {
    return std::numeric_limits<double>::infinity();
  }
  return std::max(solution->position_sigma / kMostPosition,
                  solution->rotation_sigma / kMostRotation);
}

// The share of the boards whose origin lies in the image, or near it.
double ShareInImage(std::span<const PosePair> pairs, const CameraIntrinsics& lens) {
  constexpr double kMargin = 0.25;  // of the image; a board's origin is on its rim
  const CameraModel camera(lens);
  double count = 0;
  for (const PosePair& pair : pairs) {
    const auto pixel = camera.Project(pair.camera_from_board.translation());
    if (!pixel) continue;
    const double x = (pixel->x() + 0.5) / lens.width;
    const double y = (pixel->y() + 0.5) / lens.height;
    count += std::min(x, y) > -kMargin && std::max(x, y) < 1 + kMargin ? 1 : 0;
  }
  return count / static_cast<double>(pairs.size());
}

// Other things that pairs may say than what they should.
struct Reading {
  bool exchanged;
  bool robot_inverted;
  bool seen_inverted;

  std::vector<PosePair> Of(std::vector<PosePair> pairs) const {
    for (PosePair& pair : pairs) {
      if (exchanged) std::swap(pair.base_from_flange, pair.camera_from_board);
      if (robot_inverted) pair.base_from_flange = pair.base_from_flange.inverse();
      if (seen_inverted) pair.camera_from_board = pair.camera_from_board.inverse();
    }
    return pairs;
  }
  std::string InWords(bool on_flange) const {
    if (robot_inverted && !seen_inverted && !exchanged) {
      return absl::StrCat(on_flange ? "with a camera that stands still (without --eye-in-hand)"
                                    : "with the camera on the flange (--eye-in-hand)",
                          ", or with the robot's poses inverted,");
    }
    const char* inverted = robot_inverted && seen_inverted ? "with both poses inverted"
                           : robot_inverted                ? "with the robot's poses inverted"
                                                           : "with the camera's poses inverted";
    if (!exchanged) return inverted;
    return absl::StrCat(
        "with the robot's poses and the board's exchanged",
        robot_inverted || seen_inverted ? absl::StrCat(", and ", inverted, ",") : std::string());
  }
};
constexpr std::array<Reading, 7> kReadings = {{{true, false, false},
                                               {false, true, true},
                                               {false, true, false},
                                               {false, false, true},
                                               {true, true, true},
                                               {true, true, false},
                                               {true, false, true}}};

// The reading by which pairs fit and boards lie in the image; null if none is.
const Reading* OtherReading(const std::vector<PosePair>& pairs, const PoseView& view) {
  for (const Reading& reading : kReadings) {
    const std::vector<PosePair> other = reading.Of(pairs);
    if (ShareInImage(other, view.lens) >= kMeantSo &&
        Badness(SolveLinks(LinksOf(other, view.on_flange))) < 1) {
      return &reading;
    }
  }
  return nullptr;
}

// In metres: of what is on the flange from it, and of what stands from the robot's base.
struct Distances {
  double carried;
  double standing;

  Distances(const PoseView& view, const PairSolution& solution) {
    carried = solution.board_pose.translation().norm();
    standing = solution.camera_pose.translation().norm();
    if (view.on_flange) std::swap(carried, standing);
  }
  absl::Status Refusal(const PoseView& view) const {
    return FailedPrecondition(absl::StrFormat(
        "has pairs of poses by which the %s is %.1f m from the flange and the %s only %.1f m from "
        "the robot's base; it looks as if poses were inverted, or the camera %s",
        view.on_flange ? "camera" : "board", carried, view.on_flange ? "board" : "camera", standing,
        view.on_flange ? "stood still (without --eye-in-hand)"
                       : "were on the flange (--eye-in-hand)"));
  }
};

// Whether the camera can have seen what it is said to have seen.
absl::Status CheckPlaces(const std::vector<PosePair>& pairs, const PoseView& view,
                         const PairSolution& solution) {
  const double in_image = ShareInImage(pairs, view.lens);
  const Reading* other = in_image < kMeantSo ? OtherReading(pairs, view) : nullptr;
  if (other != nullptr || in_image < kLeastInImage) {
    return FailedPrecondition(
        absl::StrFormat("has pairs of poses by which only %.0f %% of the boards lie in its image; ",
                        100 * in_image),
        other ? absl::StrCat(other->InWords(view.on_flange), " they do")
              : std::string("board poses are camera_from_board, z along the view, x to the right, "
                            "y down; see whether they and the lens are right"));
  }
  const Distances d(view, solution);
  if (d.carried < kFarFromFlange || d.carried < kMuchFarther * d.standing) return absl::OkStatus();
  return d.Refusal(view);
}

// Where boards were seen: how far off these points are by the camera's pose, root mean square,
// metres.
double SigmaOf(const Links& links, const PairSolution& poses) {
  double sum = 0;
  for (const Eigen::Isometry3d& seen : links.seen) {
    const double sigma =
        PointSigma(poses.covariance, poses.camera_pose.inverse() * seen.translation());
    sum += sigma * sigma;
  }
  return std::sqrt(sum / static_cast<double>(links.seen.size()));
}

// By how much `other` has these points elsewhere, in the same way.
double ShiftOf(const Links& links, const PairSolution& poses, const PairSolution& other) {
  const Eigen::Isometry3d motion = other.camera_pose * poses.camera_pose.inverse();
  double sum = 0;
  for (const Eigen::Isometry3d& seen : links.seen) {
    sum += (motion * seen.translation() - seen.translation()).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(links.seen.size()));
}

// The solution without the pairs from `first` to before `last`.
PairSolution Without(const Links& links, const PairSolution& all, size_t first, size_t last) {
  PairSolution rest = all;
  for (size_t i = first; i < last; ++i) rest.residuals[i].outlier = true;
  Refine(links, all.size_sigma > 0, 0, rest);
  return rest;
}

// The motion does not determine the boards' size, though the pose rests on it; empty: it does.
// Judged with the size stated: where nothing determines it, a solution with the size found makes
// the boards, and with them the residuals, as small as can be.
std::string DoubtOfSize(const Links& links, const PairSolution& stated) {
  Normals matrix;
  Parameters gradient;
  NormalEquationsOf(links, stated, true, matrix, gradient);
  const Normals covariance = matrix.inverse();
  const double variance = covariance(12, 12);
  const double sigma = variance > 0 ? std::min(1.0, std::sqrt(variance)) : 1;
  if (sigma < kUncheckedSize) return "";
  PairSolution larger = stated;
  larger.size *= 1 + kRefusedSize;
  Refine(links, false, 0, larger);
  const double shift = ShiftOf(links, stated, larger);
  if (shift < kHarmlessShift) return "";
  return absl::StrFormat(
      "has boards whose size the motion of the robot does not determine (+- %.1f %%): a print %.0f "
      "%% too large shifts points of the workspace by up to %.1f mm; measure the print and vouch "
      "for "
      "it (--trust-size stated), or take more pairs, farther apart: the flange should move by 20 "
      "cm "
      "and more, and these pairs miss each other by %.1f mm",
      100 * sigma, 100 * kRefusedSize, 1000 * shift, 1000 * stated.position_sigma);
}

// `numbers`: what messages call the pairs.
absl::Status CheckSinglePairs(const std::vector<PosePair>& pairs,
                              const std::vector<size_t>& numbers, const Links& links,
                              const PairSolution& all) {
  std::vector<size_t> kept;
  Isometries used;
  std::vector<Eigen::Matrix3d> turns;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (all.residuals[i].outlier) continue;
    kept.push_back(i);
    used.push_back(links.links[i]);
    turns.emplace_back(pairs[i].base_from_flange.linear());
  }
  RETURN_IF_ERROR(CheckTurns(used));
  const std::optional<size_t> decisive = DecisiveTurn(turns);
  const double sigma = SigmaOf(links, all);
  for (size_t i = 0; i < kept.size(); ++i) {
    if (kept.size() > kMostFramesTried && i != decisive) continue;
    Isometries others = used;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const bool turned = CheckTurns(others).ok();
    const double shift = ShiftOf(links, all, Without(links, all, kept[i], kept[i] + 1));
    if (turned && shift <= MostShift(sigma)) continue;
    return FailedPrecondition(
        "rests on pair ", numbers[kept[i]], " of its poses alone: without it ",
        turned && std::isfinite(shift)
            ? absl::StrFormat("points of the workspace are %.1f mm elsewhere, where %.1f mm (1 "
                              "sigma) are predicted",
                              1000 * shift, 1000 * sigma)
            : std::string("the camera's pose is not determined, so that a mistake in it would not "
                          "show"),
        "; see whether this pair is right, or add five or more with the flange turned about two "
        "axes, by 20 degrees and more");
  }
  return absl::OkStatus();
}

// A half of the session contradicts all of it; empty: none does. Each half by its own noise: that
// of all is larger if something moved.
std::string DoubtOfHalves(const Links& links, const PairSolution& all) {
  const size_t count = links.links.size();
  for (const bool first : {true, false}) {
    const PairSolution half = Without(links, all, first ? count / 2 : 0, first ? count : count / 2);
    Isometries used;
    for (size_t i = 0; i < count; ++i) {
      if (!half.residuals[i].outlier) used.push_back(links.links[i]);
    }
    if (used.size() < kLeastOfHalf || !CheckTurns(used).ok()) continue;
    const double sigma = SigmaOf(links, half);
    const double shift = ShiftOf(links, all, half);
    if (!(shift > MostShift(sigma))) continue;
    return absl::StrFormat(
        "has pairs of poses of which the %s half alone has points of the workspace %.1f mm "
        "elsewhere, where %.1f mm (1 sigma) are predicted; see whether the camera or the board "
        "moved meanwhile, and drive to the poses in mixed order",
        first ? "first" : "second", 1000 * shift, 1000 * sigma);
  }
  return "";
}

// The solution with the size that counts, or why there is none.
absl::StatusOr<PairSolution> ChooseSize(const Links& links,
                                        const std::optional<PairSolution>& stated,
                                        std::optional<PairSolution> sized, SizeTrust trust) {
  const bool certain =
      Badness(sized) < 1 && sized->size > 0.5 && sized->size < 2 &&
      std::abs(sized->size - 1) > std::max(kMentionedSize, kCertainSize * sized->size_sigma);
  if (!certain && Badness(stated) < 1) {
    PairSolution kept = *stated;
    std::string unchecked = DoubtOfSize(links, kept);
    if (trust == SizeTrust::kStated) {
      kept.warning = std::move(unchecked);
    } else if (!unchecked.empty()) {
      kept.doubts.push_back(std::move(unchecked));
    }
    return kept;
  }
  if (!certain) {
    return FailedPrecondition(absl::StrFormat(
        "has pairs of poses that fit only if the distances of its boards are %.3g times as large; "
        "see that all poses are in metres, and measure the print",
        sized->size));
  }
  const std::string what = absl::StrFormat(
      "has boards that measure %.2f %% (+- %.2g) of what their poses are reckoned with, by the "
      "motion of the robot: measure the print; if it is right, the robot's positions or the lens's "
      "focal length are off by this share",
      100 * sized->size, 100 * sized->size_sigma);
  const bool small = std::abs(sized->size - 1) < kRefusedSize;
  if (trust == SizeTrust::kFound || (trust == SizeTrust::kNeither && small)) {
    sized->warning = what + ", as they are here (--trust-size found)";
    return *sized;
  }
  if (trust == SizeTrust::kStated && Badness(stated) < 1) {
    PairSolution kept = *stated;
    kept.warning = what;
    return kept;
  }
  return FailedPrecondition(
      what, "; --trust-size found takes them so",
      trust == SizeTrust::kNeither ? ", --trust-size stated keeps the size stated" : "");
}

}  // namespace

absl::StatusOr<PairSolution> SolvePosePairs(std::span<const PosePair> given, const PoseView& view,
                                            SizeTrust trust) {
  const std::vector<size_t> firsts = FirstsOf(given);
  const std::vector<PosePair> pairs = Merged(given, firsts);
  if (pairs.size() < kLeastPairs) {
    return FailedPrecondition(
        "has only ", pairs.size(), " pairs of poses",
        pairs.size() < given.size()
            ? absl::StrCat(" at different poses of the robot, of ", given.size(), " in all")
            : std::string(),
        "; ", kLeastPairs, " are the least, twenty are good");
  }
  const Links links = LinksOf(pairs, view.on_flange);
  RETURN_IF_ERROR(CheckTurns(links.links));
  const std::optional<PairSolution> stated = SolveLinks(links);
  std::optional<PairSolution> sized = SolveLinks(links, true);
  if (Badness(stated) >= 1 && Badness(sized) >= 1) {
    const Reading* other = OtherReading(pairs, view);
    return FailedPrecondition(
        std::isfinite(Badness(stated))
            ? absl::StrFormat("has pairs of poses that miss each other by %.0f mm and %.1f deg; ",
                              1000 * stated->position_sigma, stated->rotation_sigma / kDegree)
            : "has pairs of poses that no pose of the camera explains; ",
        other ? absl::StrCat(other->InWords(view.on_flange), " they fit")
              : std::string("see whether each board pose belongs to its robot pose, and all are in "
                            "metres"));
  }
  RETURN_IF_ERROR(CheckPlaces(pairs, view, Badness(stated) < 1 ? *stated : *sized));
  ASSIGN_OR_RETURN(PairSolution solution, ChooseSize(links, stated, std::move(sized), trust));
  if (Kept(solution) < kLeastPairs) {
    return FailedPrecondition("has only ", Kept(solution), " of ", pairs.size(),
                              " pairs of poses that agree with each other; ", kLeastPairs,
                              " are the least, twenty are good");
  }
  const std::vector<size_t> numbers = NumbersOf(firsts);
  RETURN_IF_ERROR(CheckSinglePairs(pairs, numbers, links, solution));
  std::string halves = DoubtOfHalves(links, solution);
  if (!halves.empty()) solution.doubts.push_back(std::move(halves));
  solution.robot_poses = pairs.size();
  solution.residuals = ResidualsOf(solution.residuals, firsts, numbers);
  return solution;
}

namespace {

// easy_handeye's pairs of a camera on the flange, and of one that stands, fit the other one as
// well.
absl::Status CheckMount(const PoseView& view, const PairSolution& solution) {
  const Distances d(view, solution);
  return d.carried <= d.standing ? absl::OkStatus() : d.Refusal(view);
}

}  // namespace

absl::StatusOr<PairSolution> SolvePairFile(const PairFile& file, const PoseView& view,
                                           SizeTrust trust) {
  if (!file.easy_handeye) return SolvePosePairs(file.pairs, view, trust);
  std::vector<PosePair> inverted = file.pairs;
  for (PosePair& pair : inverted) pair.base_from_flange = pair.base_from_flange.inverse();
  absl::StatusOr<PairSolution> solution =
      SolvePosePairs(view.on_flange ? file.pairs : inverted, view, trust);
  if (solution.ok()) {
    RETURN_IF_ERROR(CheckMount(view, *solution));
    return solution;
  }
  absl::StatusOr<PairSolution> other =
      SolvePosePairs(view.on_flange ? inverted : file.pairs, view, trust);
  if (!other.ok() || !CheckMount(view, *other).ok()) return solution;
  absl::StrAppend(&other->warning, other->warning.empty() ? "" : "; it ",
                  "has robot poses that are the inverse of those that easy_handeye stores of such "
                  "a camera; they are taken as they fit");
  return other;
}

}  // namespace silhouette
