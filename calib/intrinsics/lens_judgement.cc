// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/lens_stages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr double kTilted = 15;          // degrees: a board that tells something of the focal length
constexpr double kWorstFit = 2;         // rms of the residuals, pixels: more is no fit at all
constexpr double kMostOutliers = 0.25;  // the same, as a share of the corners
constexpr double kWellCovered = 0.9;
constexpr double kWellKnown = 0.98;  // share of the image
constexpr int kFieldsX = 8;          // in which coverage is counted
constexpr int kFieldsY = 6;

// What a camera saw.
struct Seen {
  std::vector<double> distances;
  std::vector<double> tilts;  // of the boards against the image plane, degrees
};

std::vector<Seen> SeenBy(const LensSolution& solution) {
  std::map<std::pair<std::string, std::string>, std::vector<const LensBoard*>> boards;
  for (const LensBoard& board : solution.boards) {
    boards[{board.frame, board.board}].push_back(&board);
  }
  std::set<std::tuple<size_t, std::string, std::string>> images;
  for (const LensResidual& r : solution.residuals) images.insert({r.camera, r.frame, r.board});
  std::vector<Seen> seen(solution.cameras.size());
  for (const auto& [camera, frame, name] : images) {
    for (const LensBoard* board : boards[{frame, name}]) {
      const SolvedCamera& solved = solution.cameras[camera];
      if (board->group != solved.group) continue;
      const Eigen::Isometry3d pose = solved.camera_from_reference * board->reference_from_board;
      seen[camera].distances.push_back(pose.translation().norm());
      const double cosine = std::min(1.0, std::abs(pose.linear()(2, 2)));
      seen[camera].tilts.push_back(std::acos(cosine) * 180 / std::numbers::pi);
      break;
    }
  }
  return seen;
}

void AddStatistics(LensSolution& solution) {
  std::vector<double> squares(solution.cameras.size(), 0);
  std::vector<std::set<std::string>> frames(solution.cameras.size());
  std::vector<std::set<int>> fields(solution.cameras.size());
  for (const LensResidual& r : solution.residuals) {
    SolvedCamera& camera = solution.cameras[r.camera];
    frames[r.camera].insert(r.frame);
    if (r.outlier) {
      ++camera.outliers;
      continue;
    }
    ++camera.corners;
    squares[r.camera] += r.residual.squaredNorm();
    const auto field = [](double at, int size, int count) {
      return std::clamp(static_cast<int>((at + 0.5) / size * count), 0, count - 1);
    };
    fields[r.camera].insert(field(r.seen.x(), camera.width, kFieldsX) +
                            kFieldsX * field(r.seen.y(), camera.height, kFieldsY));
  }
  for (size_t i = 0; i < solution.cameras.size(); ++i) {
    SolvedCamera& camera = solution.cameras[i];
    camera.images = static_cast<int>(frames[i].size());
    camera.rms = camera.corners > 0 ? std::sqrt(squares[i] / (2.0 * camera.corners)) : 0;
    camera.covered = static_cast<double>(fields[i].size()) / (kFieldsX * kFieldsY);
  }
}

// Places along the rim of a camera's image.
std::vector<Eigen::Vector2d> Rim(const SolvedCamera& camera) {
  constexpr int kSteps = 8;
  const double right = camera.width - 1;
  const double bottom = camera.height - 1;
  std::vector<Eigen::Vector2d> rim;
  for (int step = 0; step < kSteps; ++step) {
    const double x = right * step / kSteps;
    const double y = bottom * step / kSteps;
    rim.insert(rim.end(), {{x, 0}, {right - x, bottom}, {right, y}, {0, bottom - y}});
  }
  return rim;
}

// The largest standard deviation along the image's rim; infinity if the lens shows nothing in most
// of it.
double EdgeSigma(const LensSolution& solution, size_t i) {
  const SolvedCamera& camera = solution.cameras[i];
  const std::vector<Eigen::Vector2d> rim = Rim(camera);
  double worst = 0;
  size_t known = 0;
  for (const Eigen::Vector2d& pixel : rim) {
    const auto sigma = ProjectionSigma(solution, i, pixel, camera.distance);
    if (!sigma || !std::isfinite(*sigma)) continue;
    ++known;
    worst = std::max(worst, *sigma);
  }
  return 2 * known > rim.size() ? worst : std::numeric_limits<double>::infinity();
}

// Places of the rim in which the camera sees nothing, as the distortion folds over before them.
int PlacesBeyondTheFold(const SolvedCamera& camera) {
  if (!camera.model) return 0;
  const std::vector<Eigen::Vector2d> rim = Rim(camera);
  return static_cast<int>(std::ranges::count_if(
      rim, [&](const Eigen::Vector2d& pixel) { return !camera.model->Ray(pixel).has_value(); }));
}

LensMap MapOf(const LensSolution& solution, size_t i, double most_uncertain) {
  const SolvedCamera& camera = solution.cameras[i];
  LensMap map{.columns = 17, .rows = 13, .sigmas{}, .limit = most_uncertain * camera.width};
  for (int row = 0; row < map.rows; ++row) {
    for (int column = 0; column < map.columns; ++column) {
      const Eigen::Vector2d pixel((camera.width - 1.0) * column / (map.columns - 1),
                                  (camera.height - 1.0) * row / (map.rows - 1));
      const auto sigma = ProjectionSigma(solution, i, pixel, camera.distance);
      map.sigmas.push_back(
          sigma && std::isfinite(*sigma) ? *sigma : std::numeric_limits<double>::infinity());
    }
  }
  return map;
}

// Between the map's places.
double SigmaAt(const LensMap& map, const Eigen::Vector2d& place) {
  const int column = std::min(static_cast<int>(place.x()), map.columns - 2);
  const int row = std::min(static_cast<int>(place.y()), map.rows - 2);
  const auto along = [&](int y) {
    const auto first = static_cast<size_t>(y * map.columns + column);
    return std::lerp(map.sigmas[first], map.sigmas[first + 1], place.x() - column);
  };
  const double sigma = std::lerp(along(row), along(row + 1), place.y() - row);
  return std::isfinite(sigma) ? sigma : std::numeric_limits<double>::infinity();
}

// Around the map from its top left place, which comes last, too.
std::vector<Eigen::Vector2d> PlacesOfRim(const LensMap& map) {
  const int right = map.columns - 1;
  const int bottom = map.rows - 1;
  std::vector<Eigen::Vector2d> places;
  for (int x = 0; x < right; ++x) places.emplace_back(x, 0);
  for (int y = 0; y < bottom; ++y) places.emplace_back(right, y);
  for (int x = right; x > 0; --x) places.emplace_back(x, bottom);
  for (int y = bottom; y >= 0; --y) places.emplace_back(0, y);
  return places;
}

// Twice the area of a triangle.
double Turn(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

double FocalLengthSigma(const LensSolution& solution, size_t i) {
  const SolvedCamera& camera = solution.cameras[i];
  const LensGroup& group = solution.groups[camera.group];
  const LensCovariance& c = group.covariance;
  const auto place =
      static_cast<size_t>(std::ranges::find(group.cameras, i) - group.cameras.begin());
  // Another parameter of this model can stand for the focal length.
  if (camera.lens_model == "LENSMODEL_CAHVOR") return 0;
  const int first = c.places.intrinsics[place];
  if (c.places.first_intrinsic != 0 || first < 0) return 0;
  double worst = 0;
  for (int axis = 0; axis < 2; ++axis) {
    const int at = first + axis;
    worst = std::max(worst, std::sqrt(std::max(0.0, c.covariance(at, at))) /
                                std::abs(camera.intrinsics[static_cast<size_t>(axis)]));
  }
  return worst;
}

std::string Percent(double share) { return absl::StrFormat("%.0f %%", 100 * share); }

// What the images of a camera lack, most telling first; empty if nothing obvious.
std::vector<std::string> Lacks(const SolvedCamera& camera, const Seen& seen,
                               double enough_covered = 0.6) {
  std::vector<std::string> lacks;
  const auto tilted = std::ranges::count_if(seen.tilts, [](double tilt) { return tilt > kTilted; });
  if (static_cast<double>(tilted) < 0.25 * static_cast<double>(seen.tilts.size())) {
    lacks.push_back(absl::StrFormat(
        "too few tilts: in only %d of %d images is the board tilted by more than %.0f degrees "
        "(tilt it by 20 to 45 degrees, in all directions)",
        tilted, seen.tilts.size(), kTilted));
  }
  if (camera.covered < enough_covered) {
    lacks.push_back(absl::StrCat("corners were seen in only ", Percent(camera.covered),
                                 " of the image (bring the board to its rim and corners)"));
  }
  if (camera.images < 15) {
    lacks.push_back(absl::StrCat("there are only ", camera.images, " images (take 20 to 40)"));
  }
  return lacks;
}

std::string Because(const std::vector<std::string>& lacks) {
  if (lacks.empty()) {
    return "; take more images, with larger and more tilted boards, up to the image's corners";
  }
  return absl::StrCat("; ", absl::StrJoin(lacks, "; "));
}

absl::Status JudgeCamera(const LensSettings& settings, const Seen& seen, SolvedCamera& camera,
                         std::vector<std::string>& warnings) {
  const std::string view = absl::StrCat("view '", camera.name, "': ");
  const int all = camera.corners + camera.outliers;
  if (!(camera.rms <= kWorstFit) || camera.outliers > kMostOutliers * all) {
    return InvalidArgument(
        absl::StrFormat("%sno lens fits its images: %d of %d corners had to be left out, the "
                        "others are off by %.2g "
                        "px; the images may be of several sizes, zoom or focus settings, blurred, "
                        "or the board is not "
                        "flat or not as described",
                        view, camera.outliers, all, camera.rms));
  }
  const std::vector<std::string> lacks = Lacks(camera, seen);
  if (!(camera.focal_length_sigma <= settings.most_uncertain_focal_length)) {
    return FailedPrecondition(absl::StrFormat("%sthe focal length is known only to %.2g %%%s", view,
                                              100 * camera.focal_length_sigma, Because(lacks)));
  }
  const double known = camera.map.KnownShare();
  if (!(known >= settings.least_known)) {
    return FailedPrecondition(absl::StrFormat(
        "%sin only %s of the image is the lens known to %.2g px (--most-uncertain, of the image's "
        "width), at least %s are needed (--least-known)%s",
        view, Percent(known), camera.map.limit, Percent(settings.least_known),
        Because(Lacks(camera, seen, kWellCovered))));
  }
  if (known < kWellKnown) {
    warnings.push_back(absl::StrFormat(
        "%sthe lens is known to %.2g px in %s of the image only, up to %.2g px at its rim; where "
        "masks need the rest, bring the board there (--draw shows where)",
        view, camera.map.limit, Percent(known), camera.edge_sigma));
  }
  if (const int folded = PlacesBeyondTheFold(camera); folded > 0) {
    warnings.push_back(absl::StrCat(view, "the lens model folds over within the image (at ", folded,
                                    " of 32 places of its rim no ray is known); corners nearer to "
                                    "the rim would help, or another --model"));
  }
  for (const std::string& lack : lacks) warnings.push_back(view + lack);
  if (camera.outliers > 0.03 * all) {
    warnings.push_back(
        absl::StrCat(view, camera.outliers, " of ", all,
                     " corners do not fit and were left out; look at the residuals"));
  }
  return absl::OkStatus();
}

}  // namespace

double LensMap::KnownShare() const {
  // A place at the rim stands for half a field, one at a corner for a quarter.
  const auto weight = [](int at, int count) { return at == 0 || at == count - 1 ? 0.5 : 1.0; };
  double known = 0;
  double all = 0;
  for (size_t i = 0; i < sigmas.size(); ++i) {
    const double area = weight(static_cast<int>(i) % columns, columns) *
                        weight(static_cast<int>(i) / columns, rows);
    all += area;
    known += Known(i) ? area : 0;
  }
  return all > 0 ? known / all : 0;
}

LensRegion LensMap::Region(int width, int height) const {
  LensRegion region{.sigma = limit};
  const auto best = static_cast<int>(std::ranges::min_element(sigmas) - sigmas.begin());
  if (sigmas.empty() || !Known(static_cast<size_t>(best))) return region;
  const Eigen::Vector2d from(best % columns, best / columns);
  auto& line = region.contour;
  for (const Eigen::Vector2d& to : PlacesOfRim(*this)) {
    constexpr int kSteps = 200;
    int known = 0;
    while (known < kSteps && SigmaAt(*this, from + (known + 1.0) / kSteps * (to - from)) <= limit) {
      ++known;
    }
    const Eigen::Vector2d place = from + 1.0 * known / kSteps * (to - from);
    const Eigen::Vector2d point(place.x() / (columns - 1) * width - 0.5,
                                place.y() / (rows - 1) * height - 0.5);
    // The last point is needless if it is on the way to this one.
    if (line.size() > 1 && Turn(line.end()[-2], line.back(), point) == 0) line.pop_back();
    line.push_back(point);
  }
  if (line.size() < 4) line.clear();
  return region;
}

absl::Status JudgeLenses(const std::vector<LensCamera>& cameras, const LensSettings& settings,
                         LensSolution& solution) {
  AddStatistics(solution);
  const std::vector<Seen> seen = SeenBy(solution);
  for (size_t i = 0; i < cameras.size(); ++i) {
    SolvedCamera& camera = solution.cameras[i];
    camera.distance = Median(seen[i].distances);
    if (camera.corners == 0) {
      return InvalidArgument("view '", camera.name,
                             "': none of its corners fits; the lens or the board is another");
    }
    camera.known = cameras[i].known;
    if (cameras[i].fixed) continue;
    const Eigen::Vector2d middle((camera.width - 1) / 2.0, (camera.height - 1) / 2.0);
    camera.focal_length_sigma = FocalLengthSigma(solution, i);
    camera.centre_sigma = ProjectionSigma(solution, i, middle, camera.distance)
                              .value_or(std::numeric_limits<double>::infinity());
    camera.edge_sigma = EdgeSigma(solution, i);
    camera.map = MapOf(solution, i, settings.most_uncertain);
    camera.known = camera.map.Region(camera.width, camera.height);
    RETURN_IF_ERROR(JudgeCamera(settings, seen[i], camera, solution.warnings));
  }
  for (const LensGroup& group : solution.groups) {
    if (group.noise > 2) {
      solution.warnings.push_back(
          absl::StrFormat("the corners are %.1f times as far off as their sigma says: the lens "
                          "model may not fit, the "
                          "board may not be flat or not of the size stated, or images are blurred",
                          group.noise));
    }
  }
  if (!settings.simultaneous) {
    solution.warnings.push_back(
        "each camera was solved by itself; how the cameras stand to each other is not known");
  } else if (solution.groups.size() > 1) {
    std::vector<std::string> names;
    for (const LensGroup& group : solution.groups) {
      names.push_back(absl::StrJoin(group.cameras, ", ", [&](std::string* out, size_t camera) {
        absl::StrAppend(out, "'", cameras[camera].name, "'");
      }));
    }
    solution.warnings.push_back(absl::StrCat("no board was seen at once by ",
                                             absl::StrJoin(names, " and by "),
                                             ": how these stand to each other is not known"));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
