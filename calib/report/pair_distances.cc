#include "calib/report/pair_distances.h"

#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/model_matrices.h"

namespace silhouette {
namespace {

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
