// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_fit.h"
#include "calib/report/view_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "calib/fundamental/epipolar_geometry.h"
#include "calib/poses/pose_bundle.h"
#include "calib/poses/pose_network.h"

namespace silhouette {
namespace {

PoseCovariance PriorOf(const BundlePose& pose) {
  PoseCovariance prior = PoseCovariance::Zero();
  for (int i = 0; i < 6; ++i) {
    const double sigma = i < 3 ? pose.rotation_sigma : pose.position_sigma;
    prior(i, i) = sigma * sigma;
  }
  return prior;
}

// One frame of the network: the cameras stand still, what moves with the frame is sought.
class FrameBundle {
 public:
  FrameBundle(const HeldOutTask& task, const PoseNetwork& network, const std::vector<size_t>& looks)
      : task_(task), network_(network) {
    for (size_t i = 0; i < network.views.size(); ++i) {
      bundle_.lenses.push_back(network.views[i].lens);
      bundle_.cameras.push_back(
          {.name{}, .pose = task.training.views[i].camera_pose, .constant = true});
    }
    for (const PoseBoard& board : network.boards) {
      const auto solved = std::ranges::find(task.training.boards, board.board.description().name,
                                            &SolvedBoard::name);
      bundle_.sizes.push_back(solved == task.training.boards.end() ? 1 : solved->size);
      bundle_.size_sigmas.push_back(0);
    }
    for (const size_t look : looks) Add(look);
  }

  // Adds what the others say of each view's corners.
  void Predict(std::vector<HeldOutCorner>& predicted) {
    std::set<int> views;
    for (const BundleCorner& corner : bundle_.corners) views.insert(corner.camera);
    const Bundle at_first = bundle_;
    for (const int view : views) {
      bundle_ = at_first;
      PredictView(view, predicted);
    }
  }

 private:
  void Add(size_t index) {
    const Look& look = network_.looks[index];
    const int board = BoardOf(look);
    if (board < 0) return;
    const int flange = look.flange < 0 ? -1 : FlangeOf(look);
    for (size_t place = 0; place < look.corners.size(); ++place) {
      const LookCorner& corner = look.corners[place];
      if (task_.outliers.contains({task_.sightings[corner.sighting], corner.corner})) continue;
      BundleCorner& added = bundle_.corners.emplace_back(CornerOf(network_, index, place));
      added.flange = flange;
      added.board_pose = board;
      added.sigma = SigmaOf(look, corner.sigma);
    }
  }

  double SigmaOf(const Look& look, double stated) const {
    const BoardDescription& board =
        network_.boards[network_.board_poses[look.board_pose].board].board.description();
    for (const SolvedNoise& noise : task_.training.noise) {
      if (noise.view != network_.views[look.view].name || noise.board != board.name) continue;
      return CornerSigma(stated, noise.stated, noise.sigma);
    }
    return stated;
  }

  int FlangeOf(const Look& look) {
    if (!bundle_.flanges.empty()) return 0;
    const RobotPose& robot = network_.robot_poses[look.flange];
    const double factor = std::max(1.0, task_.training.robot_noise_factor);
    const auto frame = std::ranges::find(task_.full.frames, robot.frame, &SolvedFrame::name);
    const RobotNoise& noise = task_.problem.robot_noise;
    BundlePose& flange = bundle_.flanges.emplace_back(MeasuredPose(
        robot.base_from_flange, factor * noise.position_sigma, factor * noise.rotation_sigma));
    flange.left_out = frame != task_.full.frames.end() && frame->robot_outlier;
    flange.constant = task_.problem.robot_exact;
    return 0;
  }

  // Place in the bundle; -1 for a board of which nothing is known.
  int BoardOf(const Look& look) {
    const auto [place, added] =
        places_.emplace(look.board_pose, static_cast<int>(bundle_.board_poses.size()));
    if (!added) return place->second;
    const PoseBoard& board = network_.boards[network_.board_poses[look.board_pose].board];
    const auto solved = std::ranges::find(task_.training.boards, board.board.description().name,
                                          &SolvedBoard::name);
    BundlePose pose;
    if (board.place != BoardPlace::kLoose && solved != task_.training.boards.end()) {
      pose.pose = solved->pose;
      pose.constant = true;
    } else if (board.place == BoardPlace::kSurveyed) {
      const double factor = std::max(1.0, task_.training.survey_noise_factor);
      pose = MeasuredPose(board.base_from_board, factor * board.position_sigma,
                          factor * board.rotation_sigma);
    } else if (board.place != BoardPlace::kLoose) {
      return place->second = -1;
    }
    bundle_.board_poses.push_back(pose);
    return place->second;
  }

  // First values of loose boards: the candidate that fits best.
  void SeedLooseBoards() {
    for (const auto& [of_network, place] : places_) {
      if (place < 0) continue;
      BundlePose& board = bundle_.board_poses[place];
      if (board.constant || board.has_prior) continue;
      double least = std::numeric_limits<double>::infinity();
      std::optional<Eigen::Isometry3d> best;
      for (const Eigen::Isometry3d& proposed : Proposals(of_network)) {
        board.pose = proposed;
        FindResiduals(bundle_);
        double sum = 0;
        for (const BundleCorner& corner : bundle_.corners) {
          if (corner.board_pose == place) sum += std::min(1e4, corner.residual.norm());
        }
        if (sum < least) {
          least = sum;
          best = proposed;
        }
      }
      if (best) board.pose = *best;
    }
  }

  // base_from_board by the looks that take part.
  std::vector<Eigen::Isometry3d> Proposals(int board_pose) const {
    std::vector<Eigen::Isometry3d> proposals;
    std::set<size_t> looks;
    for (const BundleCorner& corner : bundle_.corners) {
      if (corner.used) looks.insert(corner.look);
    }
    for (const size_t index : looks) {
      const Look& look = network_.looks[index];
      if (look.board_pose != board_pose) continue;
      for (const Eigen::Isometry3d& seen : look.candidates) {
        proposals.push_back((bundle_.cameras[look.view].pose * network_.LinkOf(look)).inverse() *
                            seen);
      }
    }
    return proposals;
  }

  void PredictView(int view, std::vector<HeldOutCorner>& predicted) {
    for (BundleCorner& corner : bundle_.corners) corner.used = corner.camera != view;
    SeedLooseBoards();
    const bool others = std::ranges::any_of(bundle_.corners, &BundleCorner::used);
    if (others) {
      Adjust(bundle_, 0);
      FindCovariances(bundle_);
    }
    FindResiduals(bundle_);
    for (const BundleCorner& corner : bundle_.corners) {
      if (corner.camera != view || (corner.flange >= 0 && bundle_.flanges[0].left_out)) continue;
      const std::optional<double> variance = VarianceOf(corner);
      if (!variance || !corner.residual.allFinite()) continue;
      const LookCorner& seen = network_.looks[corner.look].corners[corner.place];
      predicted.push_back({.sighting = task_.sightings[seen.sighting],
                           .corner = seen.corner,
                           .residual = corner.residual,
                           .expected = *variance});
    }
  }

  // Of a pose that others or a measurement determine; nothing if neither does.
  static std::optional<PoseCovariance> Known(const BundlePose& pose) {
    if (pose.constant || !pose.covariance.isZero(0)) return pose.covariance;
    if (pose.has_prior) return PriorOf(pose);
    return std::nullopt;
  }

  // What the corner's, its camera's, flange's and board's errors explain, per axis.
  std::optional<double> VarianceOf(const BundleCorner& corner) const {
    const CameraModel& lens = network_.lenses[corner.camera];
    const Eigen::Isometry3d& camera = bundle_.cameras[corner.camera].pose;
    const BundlePose& board = bundle_.board_poses[corner.board_pose];
    const Eigen::Isometry3d link = bundle_.LinkOf(corner);
    double sum = 2 * corner.sigma * corner.sigma;
    const auto add = [&](const std::optional<Eigen::Matrix<double, 2, 6>>& by,
                         const std::optional<PoseCovariance>& covariance) {
      if (!by || !covariance) return false;
      sum += (*by * *covariance * by->transpose()).trace();
      return true;
    };
    const Eigen::Vector3d in_world = link * board.pose * corner.point;
    const Eigen::Isometry3d none = Eigen::Isometry3d::Identity();
    bool known = add(PixelByMotion(lens, none, camera, in_world),
                     task_.training.views[corner.camera].covariance);
    known =
        known && add(PixelByMotion(lens, camera * link, board.pose, corner.point), Known(board));
    if (known && corner.flange >= 0) {
      const BundlePose& flange = bundle_.flanges[corner.flange];
      // A motion of the flange seen from a camera on it is the world's motion the other way.
      const Eigen::Vector3d in_flange =
          corner.camera_on_flange ? in_world : Eigen::Vector3d(board.pose * corner.point);
      known = add(corner.camera_on_flange ? PixelByMotion(lens, none, camera, in_flange)
                                          : PixelByMotion(lens, camera, flange.pose, in_flange),
                  Known(flange));
    }
    if (!known) return std::nullopt;
    return sum / 2;
  }

  const HeldOutTask& task_;
  const PoseNetwork& network_;
  Bundle bundle_;
  std::map<int, int> places_;  // of board poses, from the network's
};

std::vector<std::pair<size_t, size_t>> PairsOf(const PoseProblem& problem) {
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t a = 0; a < problem.views.size(); ++a) {
    for (size_t b = a + 1; b < problem.views.size(); ++b) {
      if (!problem.views[a].on_flange && !problem.views[b].on_flange) pairs.emplace_back(a, b);
    }
  }
  return pairs;
}

std::vector<TagSighting> GoodSightings(const HeldOutTask& task) {
  std::vector<TagSighting> good;
  for (const size_t sighting : task.sightings) {
    bool fits = true;
    for (int corner = 0; corner < 4; ++corner) {
      fits = fits && !task.outliers.contains({sighting, corner});
    }
    if (fits) good.push_back(task.problem.sightings[sighting]);
  }
  return good;
}

}  // namespace

std::vector<HeldOutCorner> PredictHeldOut(const HeldOutTask& task) {
  std::vector<HeldOutCorner> predicted;
  PoseProblem part = task.problem;
  part.sightings.clear();
  for (const size_t sighting : task.sightings) {
    part.sightings.push_back(task.problem.sightings[sighting]);
  }
  absl::StatusOr<PoseNetwork> network = NetworkOf(part);
  if (!network.ok()) return predicted;
  FindCandidates(*network);
  std::map<std::string, std::vector<size_t>> looks;
  for (size_t i = 0; i < network->looks.size(); ++i) looks[network->looks[i].frame].push_back(i);
  for (const auto& [frame, of_frame] : looks) {
    FrameBundle(task, *network, of_frame).Predict(predicted);
  }
  return predicted;
}

void PairDistances::Add(const HeldOutTask& task) {
  const std::vector<TagSighting> good = GoodSightings(task);
  for (const auto& [a, b] : PairsOf(problem_)) {
    const CameraModel camera_a(problem_.views[a].lens, task.training.views[a].camera_pose);
    const CameraModel camera_b(problem_.views[b].lens, task.training.views[b].camera_pose);
    const Eigen::Matrix3d f = FundamentalBetween(camera_a, camera_b);
    const ViewPair seen = CornersOfPair(good, problem_.views[a].name, problem_.views[b].name);
    LineDistanceSum& sum = SumOf(a, b);
    for (const Correspondence& corner : seen.corners) {
      const auto undistorted = Undistorted(camera_a, camera_b, corner);
      if (undistorted) sum.Add(f, *undistorted);
    }
  }
}

std::vector<ReportPair> PairDistances::Result() const {
  std::vector<ReportPair> pairs;
  for (const auto& [a, b] : PairsOf(problem_)) {
    ReportPair pair{.view_a = problem_.views[a].name, .view_b = problem_.views[b].name};
    pair.seen = static_cast<int>(
        CornersOfPair(problem_.sightings, pair.view_a, pair.view_b).corners.size());
    if (const auto sum = sums_.find({a, b}); sum != sums_.end()) {
      const LineDistances distances = sum->second.Result();
      pair.corners = distances.corners;
      pair.px = distances.rms;
      pair.median_px = distances.median;
      pair.worst_px = distances.worst;
    }
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

LineDistanceSum& PairDistances::SumOf(size_t a, size_t b) {
  const auto sizes = [&](size_t view) {
    const CameraIntrinsics& lens = problem_.views[view].lens;
    const PixelSize size{lens.width, lens.height};
    return ViewSizes{.image = size, .mask = size};
  };
  return sums_.try_emplace({a, b}, sizes(a), sizes(b)).first->second;
}

}  // namespace silhouette
