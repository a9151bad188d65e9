// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_fit.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/poses/pose_frames.h"
#include "calib/poses/pose_network.h"
#include "calib/poses/pose_problem.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// A fit is doubted from here on, in what the sigmas explain; and is refused from the other on.
constexpr double kDoubted = 4;
constexpr double kRefused = 15;
// A guess must make the median residual this many times smaller.
constexpr double kFarBetter = 4;

struct Guess {
  std::string says;  // the end of a sentence
  std::function<std::optional<PoseProblem>(const PoseProblem&)> change;
};

using RobotChange = std::function<Eigen::Isometry3d(const Eigen::Isometry3d&)>;

Guess GuessOfPoses(std::string says, RobotChange change) {
  return {std::move(says), [change = std::move(change)](PoseProblem problem) {
            for (RobotPose& pose : problem.robot_poses) {
              pose.base_from_flange = change(pose.base_from_flange);
            }
            return std::optional(std::move(problem));
          }};
}

// Every frame has the robot's pose of the frame `by` places later.
std::optional<PoseProblem> Shifted(PoseProblem problem, int by) {
  const std::vector<RobotPose> poses = problem.robot_poses;
  problem.robot_poses.clear();
  std::set<std::string> frames;
  for (int i = 0; i < static_cast<int>(poses.size()); ++i) {
    const int other = i + by;
    if (other < 0 || other >= static_cast<int>(poses.size())) continue;
    problem.robot_poses.push_back({poses[i].frame, poses[other].base_from_flange});
    frames.insert(poses[i].frame);
  }
  std::erase_if(problem.sightings,
                [&](const TagSighting& seen) { return !frames.contains(seen.frame); });
  return problem;
}

PoseProblem Reversed(PoseProblem problem) {
  for (size_t i = 0, j = problem.robot_poses.size(); i + 1 < j--; ++i) {
    std::swap(problem.robot_poses[i].base_from_flange, problem.robot_poses[j].base_from_flange);
  }
  return problem;
}

PoseProblem Resized(PoseProblem problem, double size) {
  for (PoseBoard& board : problem.boards) {
    BoardDescription description = board.board.description();
    description.tag_size *= size;
    description.gap *= size;
    description.square *= size;
    board.board = Board(std::move(description));
  }
  return problem;
}

// With the columns of every board counted from the other side.
std::optional<PoseProblem> MirroredBoards(PoseProblem problem) {
  bool changed = false;
  for (TagSighting& seen : problem.sightings) {
    for (const PoseBoard& board : problem.boards) {
      const BoardDescription& d = board.board.description();
      if (!board.board.HasTag(seen.family, seen.tag) || d.columns == 1) continue;
      if (d.kind != BoardKind::kTags) continue;
      const int place = seen.tag - d.first_id;
      const int column = place % d.columns;
      seen.tag = d.first_id + place - column + (d.columns - 1 - column);
      changed = true;
      break;
    }
  }
  return changed ? std::optional(std::move(problem)) : std::nullopt;
}

// The pose that was meant if the four numbers of its quaternion were w, x, y, z.
Eigen::Isometry3d WithWFirst(Eigen::Isometry3d pose) {
  const Eigen::Vector4d read = Eigen::Quaterniond(pose.linear()).coeffs();  // x, y, z, w
  // A rotation has two quaternions of opposite sign; both give the same rotation here too.
  pose.linear() = Eigen::Quaterniond(read[0], read[1], read[2], read[3]).matrix();
  return pose;
}

std::optional<PoseProblem> WithSortedPoses(PoseProblem problem, bool people) {
  problem.robot_poses = SortedOtherwise(problem.robot_poses, people);
  return problem.robot_poses.empty() ? std::nullopt : std::optional(std::move(problem));
}

constexpr char kInverted[] =
    "the robot's poses are inverted (flange_from_base); give base_from_flange";
constexpr char kSortedAsText[] =
    "images and robot poses were sorted differently, one list as 1, 2, 10 and the other one as 1, "
    "10, 2; name each pose's frame";

// The same images explain inverted poses, and a camera at the other end of the robot.
std::string OtherMount(const PoseProblem& problem, const std::string& view) {
  const auto found = std::ranges::find(problem.views, view, &PoseView::name);
  if (found == problem.views.end()) return "";
  return found->on_flange
             ? ", or the camera stands still and the board is on the flange (--flange-board)"
             : absl::StrCat(
                   ", or the camera is on the flange and the board stands still "
                   "(--eye-in-hand ",
                   view, ")");
}

const std::vector<Guess>& Guesses() {
  static const std::vector<Guess> guesses = {
      {"frames and robot poses are shifted by one: with each frame's pose taken from the frame "
       "after it they fit; renumber them",
       [](const PoseProblem& problem) { return Shifted(problem, 1); }},
      {"frames and robot poses are shifted by one: with each frame's pose taken from the frame "
       "before it they fit; renumber them",
       [](const PoseProblem& problem) { return Shifted(problem, -1); }},
      {"the robot's poses are in the reverse order of the frames; reverse the list, or name each "
       "pose's frame",
       Reversed},
      GuessOfPoses("the quaternions of the robot's poses are in the order w, x, y, z; give x, y, "
                   "z, w",
                   WithWFirst),
      GuessOfPoses(kInverted, [](const Eigen::Isometry3d& pose) { return pose.inverse(); }),
      {kSortedAsText, [](const PoseProblem& problem) { return WithSortedPoses(problem, true); }},
      {kSortedAsText, [](const PoseProblem& problem) { return WithSortedPoses(problem, false); }},
      {"a board is mirrored: with its columns counted from the other side it fits; print or "
       "describe it again",
       MirroredBoards},
  };
  return guesses;
}

// The problem with one view alone, so that others neither help nor harm.
PoseProblem OfView(const PoseProblem& problem, const std::string& view) {
  PoseProblem alone = problem;
  std::erase_if(alone.views, [&](const PoseView& other) { return other.name != view; });
  std::erase_if(alone.sightings, [&](const TagSighting& seen) { return seen.view != view; });
  return alone;
}

// The median residual in pixels; nothing if there is no solution.
std::optional<double> MedianOfFit(const PoseProblem& problem) {
  const absl::StatusOr<PoseFit> fit = FitWithExactRobot(problem);
  if (!fit.ok()) return std::nullopt;
  return *std::ranges::max_element(fit->median_px);
}

// The boards' size by closed form from the robot's motion; nothing if the motion does not determine
// it.
std::optional<double> SizeByMotion(const PoseFit& fit) {
  std::vector<LinkedLook> looks;
  for (const Look& look : fit.network.looks) {
    if (look.flange >= 0 && !look.candidates.empty() &&
        look.board_pose == fit.network.looks.front().board_pose) {
      looks.push_back({&look, fit.network.LinkOf(look)});
    }
  }
  const absl::StatusOr<HandEye> solution = SolveHandEye(fit.network.lenses.front(), looks);
  if (!solution.ok() || !(solution->size > 0.02 && solution->size < 50)) return std::nullopt;
  return solution->size;
}

std::string SizeText(const BoardDescription& board, double size, double sigma) {
  const bool tags = board.kind == BoardKind::kTags;
  const double side = 1000 * (tags ? board.tag_size : board.square);
  return absl::StrFormat("the %s of board '%s' measure %.4g mm (+- %.2g mm), not %.4g mm",
                         tags                                ? "tags"
                         : board.kind == BoardKind::kCircles ? "spacings"
                                                             : "squares",
                         board.name, side * size, side * sigma, side);
}

// With the sizes found: refused as CheckSizes does, unless they are too uncertain to tell.
absl::Status CheckSizesOfView(PoseProblem alone) {
  alone.size_trust = SizeTrust::kFound;
  ASSIGN_OR_RETURN(PoseFit fit, FitWithExactRobot(alone));
  for (BundlePose& flange : fit.bundle.flanges) flange.constant = alone.robot_exact;
  if (!Adjust(fit.bundle, kRobust)) return absl::OkStatus();
  return CheckSizes(SizeTrust::kNeither, fit);
}

absl::Status TryGuesses(const PoseProblem& problem, const std::string& view, double median,
                        bool& size_explains) {
  const PoseProblem alone = OfView(problem, view);
  const absl::StatusOr<PoseFit> fit = FitWithExactRobot(alone);
  // Alone it may fit, or not be connected: then the fault is not in what it saw.
  if (fit.ok() && fit->median_px.front() < median / kFarBetter) return absl::OkStatus();
  const double alone_median = fit.ok() ? std::min(median, fit->median_px.front()) : median;
  std::optional<double> least;
  std::string says;
  for (const Guess& guess : Guesses()) {
    const std::optional<PoseProblem> changed = guess.change(alone);
    if (!changed) continue;
    const std::optional<double> guessed = MedianOfFit(*changed);
    if (guessed && (!least || *guessed < *least)) {
      least = guessed;
      says = guess.says;
      if (says == kInverted) says += OtherMount(problem, view);
    }
  }
  const bool size_doubted = problem.size_trust != SizeTrust::kFound;
  bool of_size = false;
  if (const std::optional<double> size =
          fit.ok() && size_doubted ? SizeByMotion(*fit) : std::nullopt) {
    const std::optional<double> guessed = MedianOfFit(Resized(alone, *size));
    if (guessed && (!least || *guessed < *least)) {
      least = guessed;
      of_size = true;
    }
  }
  if (!least || *least > alone_median / kFarBetter) return absl::OkStatus();
  if (of_size) {
    size_explains = true;
    const bool stated = problem.size_trust == SizeTrust::kStated;
    return stated ? absl::OkStatus() : CheckSizesOfView(alone);
  }
  return FailedPrecondition(
      absl::StrFormat("view '%s': corners are off by %.2f px (median); it looks as if %s (then "
                      "%.2f px)",
                      view, alone_median, says, *least));
}

}  // namespace

absl::Status CheckFit(const PoseProblem& problem, PoseFit& fit) {
  const auto excess = [&](size_t view) { return fit.median_px[view] / fit.expected_px[view]; };
  std::vector<size_t> doubted;
  for (size_t i = 0; i < fit.network.views.size(); ++i) {
    if (std::isfinite(fit.expected_px[i]) && !(excess(i) < kDoubted)) doubted.push_back(i);
  }
  std::ranges::sort(doubted, std::greater(), excess);
  for (const size_t view : doubted) {
    RETURN_IF_ERROR(
        TryGuesses(problem, problem.views[view].name, fit.median_px[view], fit.size_explains));
  }
  const bool refused = !doubted.empty() && excess(doubted.front()) >= kRefused;
  if (!refused || fit.size_explains) return absl::OkStatus();
  const size_t worst = doubted.front();
  return FailedPrecondition(absl::StrFormat(
      "the data contradict each other: corners of view '%s' are off by %.2f px (median) where "
      "%.2f px are expected; see whether its lens, the boards' description, the robot's poses and "
      "the frames' names belong together",
      problem.views[worst].name, fit.median_px[worst], fit.expected_px[worst]));
}

namespace {

constexpr char kMendOfSize[] =
    "; 'silhouette-calibrate poses --trust-size found' takes them so, '--trust-size stated' keeps "
    "the description's";

// Sizes of boards that the bundle found beside those stated.
struct OtherSize {
  size_t board = 0;
  double size = 1;   // of what was stated
  double sigma = 0;  // its standard deviation
};

std::vector<OtherSize> OtherSizes(const Bundle& sized) {
  std::vector<OtherSize> others;
  for (size_t i = 0; i < sized.sizes.size(); ++i) {
    const double off = std::abs(sized.sizes[i] - 1);
    const double sigma = sized.size_sigmas[i];
    if (sigma > 0 && off >= kMentionedSize && off >= kCertainSize * sigma) {
      others.push_back({i, sized.sizes[i], sigma});
    }
  }
  return others;
}

// Which of several things is off: one board's print, or what all boards are measured by.
std::string TextOfSizes(const PoseFit& fit, const std::vector<OtherSize>& others, double shift) {
  std::vector<std::string> boards;
  double least = others.front().size;
  double most = least;
  double sigma = 0;
  for (const OtherSize& other : others) {
    const BoardDescription& d = fit.network.boards[other.board].board.description();
    boards.push_back(SizeText(d, other.size, other.sigma));
    least = std::min(least, other.size);
    most = std::max(most, other.size);
    sigma = std::max(sigma, other.sigma);
  }
  const bool alike = others.size() > 1 && most - least < 3 * sigma;
  return absl::StrFormat(
      "by the motion of the robot or the survey %s; %s; with these sizes points of the workspace "
      "are up to %.1f mm elsewhere",
      FewOf(boards),
      alike ? "all are off by the same share, so that rather the robot's positions or the lenses' "
              "focal lengths are"
            : "measure the print; if it is right, the robot's positions or the lens's focal "
              "length are off by this share",
      1000 * shift);
}

// Names the boards whose size is not checked though the poses rest on it; empty: none. `sized`:
// with the sizes by motion and survey.
std::string TextOfUncheckedSizes(const PoseFit& fit, const Bundle& sized) {
  std::vector<std::string> boards;
  Bundle larger = fit.bundle;
  larger.free_sizes = false;
  for (size_t i = 0; i < sized.sizes.size(); ++i) {
    const double sigma = sized.size_sigmas[i];
    const bool certain = std::abs(sized.sizes[i] - 1) >= kCertainSize * sigma;
    if (sigma < kUncheckedSize || certain) continue;
    larger.sizes[i] *= 1 + kRefusedSize;
    boards.push_back(absl::StrFormat("'%s' (+- %.1f %%)",
                                     fit.network.boards[i].board.description().name, 100 * sigma));
  }
  if (boards.empty() || !Adjust(larger, 0)) return "";
  const double shift = std::ranges::max(ShiftsOf(fit, larger));
  if (shift < kHarmlessShift) return "";
  return absl::StrFormat(
      "neither the motion of the robot nor a survey determines the size of board %s: a print %.0f "
      "%% "
      "too large shifts points of the workspace by up to %.1f mm; move the flange by 20 cm and "
      "more, or measure the print and vouch for it ('silhouette-calibrate poses --trust-size "
      "stated')",
      FewOf(boards), 100 * kRefusedSize, 1000 * shift);
}

}  // namespace

absl::Status CheckSizes(SizeTrust trust, PoseFit& fit) {
  // The other answer: with the sizes found, or with those stated.
  Bundle other = fit.bundle;
  other.free_sizes = !fit.bundle.free_sizes;
  if (!other.free_sizes) other.sizes.assign(other.sizes.size(), 1);
  if (!Adjust(other, 0)) return absl::OkStatus();
  Bundle& sized = other.free_sizes ? other : fit.bundle;
  const BundleStatistics statistics = FindCovariances(sized);
  if (!statistics.undetermined.empty() || statistics.dof <= 0) return absl::OkStatus();
  if (std::string text = TextOfUncheckedSizes(fit, sized); !text.empty()) {
    (trust == SizeTrust::kStated ? fit.network.warnings : fit.doubts).push_back(std::move(text));
  }
  const std::vector<OtherSize> others = OtherSizes(sized);
  if (others.empty()) return absl::OkStatus();
  std::string text = TextOfSizes(fit, others, std::ranges::max(ShiftsOf(fit, other)));
  const bool refused = std::ranges::any_of(
      others, [](const OtherSize& board) { return std::abs(board.size - 1) > kRefusedSize; });
  fit.size_explains = trust == SizeTrust::kStated;
  if (trust == SizeTrust::kFound) {
    text += ", as they are here (--trust-size found)";
  } else if (refused && trust == SizeTrust::kNeither) {
    return FailedPrecondition(text, kMendOfSize);
  } else if (trust == SizeTrust::kNeither) {
    text +=
        ", as they are here; 'silhouette-calibrate poses --trust-size stated' keeps the "
        "description's";
    fit.bundle = std::move(other);
  } else {
    text += ", not as they are here (--trust-size stated)";
  }
  fit.network.warnings.push_back(std::move(text));
  return absl::OkStatus();
}

absl::Status CheckFinalSizes(SizeTrust trust, const PoseFit& fit) {
  if (trust != SizeTrust::kNeither) return absl::OkStatus();
  for (const OtherSize& board : OtherSizes(fit.bundle)) {
    if (std::abs(board.size - 1) <= kRefusedSize) continue;
    const BoardDescription& d = fit.network.boards[board.board].board.description();
    return FailedPrecondition("by the motion of the robot or the survey ",
                              SizeText(d, board.size, board.sigma),
                              "; measure the print, and see whether the robot's positions are in "
                              "metres",
                              kMendOfSize);
  }
  return absl::OkStatus();
}

}  // namespace silhouette
