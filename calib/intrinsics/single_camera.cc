#include "calib/intrinsics/single_camera.h"

#include <algorithm>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/intrinsics/lens_seeds.h"
#include "calib/intrinsics/lens_stages.h"
#include "calib/intrinsics/median.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// An image is none of the others if its residuals are this many times as long.
constexpr double kMisfit = 8;
// Shares of a camera's images that may misfit.
constexpr double kMostMisfits = 0.25;

// The corners as a lens without distortion of focal length 1 would see them.
std::vector<Eigen::Vector3d> Straightened(const std::vector<Eigen::Vector3d>& corners,
                                          const std::string& model,
                                          const std::vector<double>& intrinsics) {
  std::vector<Eigen::Vector3d> straight = corners;
  for (Eigen::Vector3d& corner : straight) {
    if (!(corner.z() > 0)) continue;
    const auto ray = UnprojectByLens(model, intrinsics, corner.head<2>());
    if (ray && ray->z() > 1e-3) {
      corner.head<2>() = ray->head<2>() / ray->z();
    } else {
      corner.z() = kNoCorner;
    }
  }
  return straight;
}

// The views that have a pose.
std::vector<PosedView> Posed(const LensCamera& camera, const std::vector<const BoardView*>& views,
                             const Lattice& lattice, const std::vector<double>& intrinsics) {
  std::vector<PosedView> posed;
  for (const BoardView* view : views) {
    std::optional<Eigen::Isometry3d> pose;
    if (camera.fixed) {
      pose = CameraFromBoard(Straightened(view->corners, "LENSMODEL_OPENCV8", intrinsics), lattice,
                             1, {0, 0});
    } else {
      pose = CameraFromBoard(view->corners, lattice, intrinsics[0], {intrinsics[2], intrinsics[3]});
    }
    if (pose) posed.push_back({view, *pose});
  }
  return posed;
}

LensProblem SingleCameraProblemOf(const LensCamera& camera, const std::vector<PosedView>& views,
                                  const Lattice& lattice, const std::vector<double>& intrinsics,
                                  const LensSettings& settings) {
  LensProblem problem;
  problem.lens_model = LensModelOf(camera, settings);
  problem.image_sizes = {{camera.width, camera.height}};
  problem.intrinsics = {intrinsics};
  problem.camera_from_reference = {Eigen::Isometry3d::Identity()};
  problem.spacing = lattice.spacing;
  problem.width = lattice.width;
  problem.height = lattice.height;
  for (const PosedView& view : views) {
    problem.observations.push_back(
        {.camera = 0, .board = static_cast<int>(problem.reference_from_board.size())});
    problem.reference_from_board.push_back(view.camera_from_board);
    for (const Eigen::Vector3d& corner : view.view->corners) {
      problem.corners.emplace_back(corner.x(), corner.y(), corner.z() > 0 ? 1 : kNoCorner);
    }
  }
  return problem;
}

absl::Status CheckCount(const LensCamera& camera, size_t images, const LensSettings& settings) {
  const auto least = static_cast<size_t>(camera.fixed ? 1 : settings.least_images);
  if (images >= least) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrFormat("view '%s': only %d images show enough of a board, at least %d are needed; "
                      "take 20 to 40, with "
                      "the board tilted and moved all over the image",
                      camera.name, images, least));
}

}  // namespace

std::string LensModelOf(const LensCamera& camera, const LensSettings& settings) {
  return camera.fixed ? "LENSMODEL_OPENCV8" : settings.lens_model;
}

absl::StatusOr<SingleCamera> SolveAlone(const LensCamera& camera,
                                        const std::vector<const BoardView*>& views,
                                        const Lattice& lattice, const LensSettings& settings) {
  SingleCamera result;
  ASSIGN_OR_RETURN(const int parameters, LensParameters(LensModelOf(camera, settings)));
  absl::Status enough = CheckCount(camera, views.size(), settings);
  if (!enough.ok()) return enough;
  if (camera.fixed) {
    const CameraIntrinsics& k = *camera.fixed;
    result.intrinsics = {k.fx, k.fy, k.cx, k.cy};
    result.intrinsics.insert(result.intrinsics.end(), k.distortion.begin(), k.distortion.end());
    result.views = Posed(camera, views, lattice, result.intrinsics);
    enough = CheckCount(camera, result.views.size(), settings);
    if (!enough.ok()) return enough;
    return result;
  }
  const double focal_length = GuessFocalLength(views, lattice, camera.width, camera.height);
  const std::vector<double> seed =
      PlainLens(parameters, focal_length, {(camera.width - 1) / 2.0, (camera.height - 1) / 2.0});
  result.views = Posed(camera, views, lattice, seed);
  const size_t all = result.views.size();
  size_t worst_count = 0;
  while (true) {
    enough = CheckCount(camera, result.views.size(), settings);
    if (!enough.ok()) return enough;
    LensProblem problem = SingleCameraProblemOf(camera, result.views, lattice, seed, settings);
    RETURN_IF_ERROR(SolveRoughly(problem));
    result.intrinsics = problem.intrinsics[0];
    const std::vector<double> medians = MedianResiduals(problem);
    const auto worst = std::max_element(medians.begin(), medians.end());
    const auto place = worst - medians.begin();
    for (size_t i = 0; i < result.views.size(); ++i) {
      result.views[i].camera_from_board = problem.reference_from_board[i];
    }
    const PosedView& view = result.views[static_cast<size_t>(place)];
    double sigma = 0;
    for (const Eigen::Vector3d& corner : view.view->corners) {
      if (corner.z() > 0) sigma = std::max(sigma, 1 / corner.z());
    }
    if (*worst <= kMisfit * std::max(sigma, Median(medians))) break;
    if (++worst_count > kMostMisfits * static_cast<double>(all)) {
      return absl::InvalidArgumentError(
          absl::StrCat("view '", camera.name,
                       "': more than a quarter of its images do not fit the others; they "
                       "may be of several sizes, zoom or focus settings, or of several cameras: "
                       "take all with one "
                       "camera that nobody touches"));
    }
    result.warnings.push_back(absl::StrFormat(
        "view '%s': the image of the frame '%s' fits far worse than the others (%.2g against %.2g "
        "px) and is left out; it may be blurred or of another size",
        camera.name, view.view->frame, *worst, Median(medians)));
    result.views.erase(result.views.begin() + place);
  }
  return result;
}

}  // namespace silhouette
