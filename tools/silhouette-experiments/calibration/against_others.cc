// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/calibration/against_others.h"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "calib/boards/charuco.h"
#include "calib/boards/tag_family.h"
#include "calib/boards/vnl_file.h"
#include "calib/files/camera_file.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"

namespace silhouette::calibration_experiment {
namespace {

constexpr int kNoProgram = 127;  // exit code of a shell that does not find it
constexpr int kBySignal = 128;   // plus the signal: of a shell whose program a signal ended

std::string LastLine(const std::string& log) {
  const std::vector<std::string> lines = absl::StrSplit(log, '\n', absl::SkipWhitespace());
  return lines.empty() ? "it wrote nothing" : lines.back();
}

absl::StatusOr<std::vector<CameraModel>> RunMrcal(const std::filesystem::path& folder,
                                                  std::span<const NamedCamera> truth,
                                                  const Lattice& lattice) {
  const CameraIntrinsics& image = truth[0].model.intrinsics();
  std::string command = absl::StrFormat(
      "cd '%s' && mrcal-calibrate-cameras --corners-cache corners.vnl --lensmodel "
      "LENSMODEL_OPENCV8 --focal %g --object-spacing %.17g --object-width-n %d --object-height-n "
      "%d --imagersize %d %d",
      folder.string(), image.fx, lattice.spacing, lattice.width, lattice.height, image.width,
      image.height);
  for (const NamedCamera& camera : truth) absl::StrAppend(&command, " '", camera.view, "/*.png'");
  const int status = std::system(absl::StrCat(command, " > log 2>&1").c_str());
  // system() ignores these signals while it waits: what stopped the program is to stop this one.
  if (WIFSIGNALED(status) || (WIFEXITED(status) && WEXITSTATUS(status) > kBySignal)) {
    const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status) - kBySignal;
    if (signal == SIGINT || signal == SIGQUIT) {
      return absl::AbortedError("stopped; start it again to have a result");
    }
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == kNoProgram) {
    return absl::NotFoundError("there is no program mrcal-calibrate-cameras (package mrcal)");
  }
  std::vector<CameraModel> cameras;
  for (size_t i = 0; i < truth.size(); ++i) {
    const std::filesystem::path file = folder / absl::StrCat("camera-", i, ".cameramodel");
    if (status != 0 || !std::filesystem::exists(file)) {
      const auto log = ReadWholeFile((folder / "log").string());
      return absl::InternalError(absl::StrCat("mrcal-calibrate-cameras failed: ",
                                              log.ok() ? LastLine(*log) : "it wrote no log"));
    }
    ASSIGN_OR_RETURN(const auto text, ReadWholeFile(file.string()));
    ASSIGN_OR_RETURN(const auto camera, CameraFromText(text, file.string()));
    cameras.push_back(camera);
  }
  return cameras;
}

// camera_from_board of the views of one camera, by frame.
std::map<std::string, Eigen::Isometry3d> BoardsSeen(const PoseProblem& problem,
                                                    const PoseView& view) {
  struct Points {
    std::vector<cv::Point3d> board;
    std::vector<cv::Point2d> image;
  };
  std::map<std::string, Points> seen;
  for (const TagSighting& sighting : problem.sightings) {
    if (sighting.view != view.name) continue;
    const MarkCorners corners = problem.boards[0].board.CornersOf(sighting.tag);
    for (size_t i = 0; i < corners.size(); ++i) {
      seen[sighting.frame].board.emplace_back(corners[i].x(), corners[i].y(), corners[i].z());
      seen[sighting.frame].image.emplace_back(sighting.corners[i].x(), sighting.corners[i].y());
    }
  }
  const CameraIntrinsics& lens = view.lens;
  const cv::Matx33d camera(lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1);
  const std::vector<double> distortion(lens.distortion.begin(), lens.distortion.end());
  std::map<std::string, Eigen::Isometry3d> boards;
  for (const auto& [frame, points] : seen) {
    cv::Vec3d turn;
    cv::Vec3d place;
    cv::solvePnP(points.board, points.image, camera, distortion, turn, place, false,
                 cv::SOLVEPNP_IPPE);
    cv::solvePnPRefineLM(points.board, points.image, camera, distortion, turn, place);
    const Eigen::Vector3d vector(turn[0], turn[1], turn[2]);
    Eigen::Isometry3d pose(Eigen::Translation3d(place[0], place[1], place[2]));
    pose.rotate(Eigen::AngleAxisd(vector.norm(), vector.normalized()));
    boards[frame] = pose;
  }
  return boards;
}

// Poses as calibrateHandEye takes them.
struct PoseList {
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;

  void Add(const Eigen::Isometry3d& pose) {
    cv::eigen2cv(Eigen::Matrix3d(pose.linear()), rotations.emplace_back());
    cv::eigen2cv(Eigen::Vector3d(pose.translation()), translations.emplace_back());
  }
};

// base_from_camera; nothing if it is not finite.
std::optional<Eigen::Isometry3d> HandEye(const PoseProblem& problem,
                                         const std::map<std::string, Eigen::Isometry3d>& boards,
                                         cv::HandEyeCalibrationMethod method) {
  // The camera stands: what OpenCV calls the gripper is then the base, seen from the flange.
  PoseList flange_from_base;
  PoseList camera_from_board;
  for (const RobotPose& pose : problem.robot_poses) {
    const auto board = boards.find(pose.frame);
    if (board == boards.end()) continue;
    flange_from_base.Add(pose.base_from_flange.inverse());
    camera_from_board.Add(board->second);
  }
  cv::Mat rotation;
  cv::Mat translation;
  try {
    cv::calibrateHandEye(flange_from_base.rotations, flange_from_base.translations,
                         camera_from_board.rotations, camera_from_board.translations, rotation,
                         translation, method);
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();
  Eigen::Matrix3d linear;
  Eigen::Vector3d place;
  cv::cv2eigen(rotation, linear);
  cv::cv2eigen(translation, place);
  base_from_camera.linear() = linear;
  base_from_camera.translation() = place;
  if (!base_from_camera.matrix().allFinite()) return std::nullopt;
  return base_from_camera;
}

}  // namespace

absl::StatusOr<std::vector<CameraModel>> CalibrateByMrcal(std::span<const NamedCamera> truth,
                                                          const Board& board,
                                                          std::span<const TagSighting> sightings) {
  ASSIGN_OR_RETURN(const auto corners,
                   VnlFileText(sightings, board, [](const TagSighting& sighting) {
                     return absl::StrCat(sighting.view, "/", sighting.frame, ".png");
                   }));
  std::string pattern = (std::filesystem::temp_directory_path() / "mrcal-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) return absl::InternalError("no temporary folder");
  const absl::Cleanup remove = [&] {
    std::error_code ignored;
    std::filesystem::remove_all(pattern, ignored);
  };
  RETURN_IF_ERROR(
      WriteWholeFile((std::filesystem::path(pattern) / "corners.vnl").string(), corners));
  return RunMrcal(pattern, truth, board.lattice().value());
}

namespace {

std::vector<Eigen::Vector2d> VectorsOf(std::span<const cv::Point2f> points) {
  std::vector<Eigen::Vector2d> vectors;
  for (const cv::Point2f& point : points) vectors.emplace_back(point.x, point.y);
  return vectors;
}

std::vector<Eigen::Vector2d> CharucoByOpenCv(const BoardDescription& d, const cv::Mat& image) {
  const auto board = cv::aruco::CharucoBoard::create(
      d.columns, d.rows, static_cast<float>(d.square), static_cast<float>(d.tag_size),
      ArucoDictionary(d.dictionary));
  std::vector<int> ids;
  std::vector<std::vector<cv::Point2f>> markers;
  cv::aruco::detectMarkers(image, board->dictionary, markers, ids);
  std::vector<cv::Point2f> corners;
  std::vector<int> corner_ids;
  if (!ids.empty()) {
    cv::aruco::interpolateCornersCharuco(markers, ids, image, board, corners, corner_ids);
  }
  return VectorsOf(corners);
}

std::optional<std::vector<Eigen::Vector2d>> TagsByOpenCv(const std::string& family,
                                                         const cv::Mat& image) {
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  cv::Ptr<cv::aruco::Dictionary> dictionary;
  if (family == kKalibrFamily) {
    dictionary = ArucoDictionary("DICT_APRILTAG_36h11");
    parameters->markerBorderBits = 2;
  } else if (TagFamily(family).is_dictionary()) {
    dictionary = ArucoDictionary(family);
  } else {
    return std::nullopt;
  }
  std::vector<int> ids;
  std::vector<std::vector<cv::Point2f>> markers;
  cv::aruco::detectMarkers(image, dictionary, markers, ids, parameters);
  std::vector<Eigen::Vector2d> corners;
  for (const std::vector<cv::Point2f>& marker : markers) {
    const auto of_marker = VectorsOf(marker);
    corners.insert(corners.end(), of_marker.begin(), of_marker.end());
  }
  return corners;
}

}  // namespace

std::optional<std::vector<Eigen::Vector2d>> CornersByOpenCv(const Board& board,
                                                            const cv::Mat& image) {
  const BoardDescription& d = board.description();
  if (d.kind == BoardKind::kTags) return TagsByOpenCv(d.family, image);
  if (d.kind == BoardKind::kCharuco) return CharucoByOpenCv(d, image);
  std::vector<cv::Point2f> corners;
  if (d.kind == BoardKind::kCircles) {
    const int kind = d.asymmetric ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID;
    const bool seen = cv::findCirclesGrid(image, {d.columns, d.rows}, corners, kind);
    return seen ? VectorsOf(corners) : std::vector<Eigen::Vector2d>();
  }
  const bool found = cv::findChessboardCornersSB(
      image, {d.columns, d.rows}, corners,
      cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY);
  return found ? VectorsOf(corners) : std::vector<Eigen::Vector2d>();
}

absl::StatusOr<CameraModel> LensByOpenCv(int width, int height,
                                         std::span<const SeenCorners> images) {
  constexpr size_t kLeastCorners = 8;
  std::vector<std::vector<cv::Point3f>> on_board;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const SeenCorners& image : images) {
    if (image.pixels.size() < kLeastCorners) continue;
    on_board.emplace_back();
    pixels.emplace_back();
    for (size_t i = 0; i < image.pixels.size(); ++i) {
      on_board.back().emplace_back(image.on_board[i].x(), image.on_board[i].y(), 0);
      pixels.back().emplace_back(image.pixels[i].x(), image.pixels[i].y());
    }
  }
  cv::Matx33d camera = cv::Matx33d::eye();
  cv::Mat distortion;
  try {
    cv::calibrateCamera(on_board, pixels, {width, height}, camera, distortion, cv::noArray(),
                        cv::noArray(), cv::CALIB_RATIONAL_MODEL);
  } catch (const cv::Exception& error) {
    return absl::InternalError(absl::StrCat("cv::calibrateCamera failed: ", error.what()));
  }
  CameraIntrinsics lens{.width = width, .height = height, .fx = camera(0, 0), .fy = camera(1, 1)};
  lens.cx = camera(0, 2);
  lens.cy = camera(1, 2);
  for (size_t i = 0; i < lens.distortion.size(); ++i) {
    lens.distortion[i] = distortion.at<double>(static_cast<int>(i));
  }
  return CameraModel(lens);
}

std::vector<std::vector<Eigen::Isometry3d>> CalibrateByOpenCv(const PoseProblem& problem) {
  std::vector<std::map<std::string, Eigen::Isometry3d>> boards;
  for (const PoseView& view : problem.views) boards.push_back(BoardsSeen(problem, view));
  std::vector<std::vector<Eigen::Isometry3d>> results;
  for (const auto method :
       {cv::CALIB_HAND_EYE_TSAI, cv::CALIB_HAND_EYE_PARK, cv::CALIB_HAND_EYE_HORAUD,
        cv::CALIB_HAND_EYE_ANDREFF, cv::CALIB_HAND_EYE_DANIILIDIS}) {
    std::vector<Eigen::Isometry3d> poses;
    for (const auto& seen : boards) {
      const auto pose = HandEye(problem, seen, method);
      if (pose) poses.push_back(pose->inverse());
    }
    if (poses.size() == boards.size()) results.push_back(std::move(poses));
  }
  return results;
}

}  // namespace silhouette::calibration_experiment
