// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/board_tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace silhouette {
namespace {

constexpr float kPaper = 0.9F;  // share of the light that is thrown back
constexpr float kInk = 0.05F;
constexpr int kNothing = -1;
constexpr size_t kRays = 64;  // through a pixel that shows more than one thing

// Points spread evenly over the unit square, no two of them in a row or column (the R2 sequence).
const std::array<Eigen::Vector2d, kRays>& SpreadPoints() {
  static const std::array<Eigen::Vector2d, kRays> points = [] {
    constexpr double kPlastic = 1.32471795724474602596;
    std::array<Eigen::Vector2d, kRays> made;
    for (size_t i = 0; i < kRays; ++i) {
      const auto n = static_cast<double>(i + 1);
      made[i] = {std::fmod(0.5 + n / kPlastic, 1), std::fmod(0.5 + n / (kPlastic * kPlastic), 1)};
    }
    return made;
  }();
  return points;
}

struct Hit {
  int part = kNothing;
  float distance = 0;                                // in units of the ray's direction
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // in the part's frame, of any length
};

}  // namespace

CornerRays::CornerRays(const CameraModel& camera)
    : camera_(camera),
      rows_(static_cast<size_t>(camera.intrinsics().height) + 1),
      made_(std::make_unique<std::once_flag[]>(rows_.size())) {}

std::span<const Eigen::Vector2d> CornerRays::Row(int y) const {
  const auto index = static_cast<size_t>(y);
  std::call_once(made_[index], [&] {
    std::vector<Eigen::Vector2d>& row = rows_[index];
    const CameraIntrinsics& image = camera_.intrinsics();
    for (int x = 0; x <= image.width; ++x) {
      auto ray = camera_.Ray({x - 0.5, y - 0.5});
      // Distortion may fold back in the outer half of the outermost pixel.
      if (!ray)
        ray = camera_.Ray({std::clamp(x, 0, image.width - 1), std::min(y, image.height - 1)});
      const Eigen::Vector3d in_camera =
          camera_.camera_from_world().linear() * ray.value_or(Eigen::Vector3d::UnitZ());
      row.push_back(in_camera.head<2>() / in_camera.z());
    }
  });
  return rows_[index];
}

// One row of one camera.
class BoardTracer::Work {
 public:
  Work(const BoardTracer& tracer, const Pixels& pixels)
      : tracer_(tracer),
        pixels_(pixels),
        light_(tracer.settings_.light),
        upper_(tracer.corners_[pixels.camera].Row(pixels.y)),
        lower_(tracer.corners_[pixels.camera].Row(pixels.y + 1)) {
    const CameraModel& model = tracer.settings_.cameras[pixels.camera].model;
    world_from_camera_ = model.camera_from_world().linear().transpose();
    centre_ = model.Centre();
    for (size_t b = 0; b < tracer.textures_.size(); ++b) {
      const size_t part = pixels.first_part + b;
      const Eigen::Isometry3d board_from_world = pixels.scene->world_from_part(part).inverse();
      board_from_camera_.push_back(board_from_world.linear() * world_from_camera_);
      centre_in_board_.push_back(board_from_world * centre_);
    }
  }

  void Run(std::span<float> row) {
    const auto left = static_cast<size_t>(pixels_.left);
    const auto right = static_cast<size_t>(pixels_.right);
    std::vector<int> above;
    std::vector<int> below;
    for (size_t x = left; x <= right; ++x) {
      above.push_back(Trace(upper_[x]).part);
      below.push_back(Trace(lower_[x]).part);
    }
    for (size_t x = left; x < right; ++x) {
      const size_t i = x - left;
      const Eigen::Vector2d middle = InPixel(x, {0.5, 0.5});
      const int centre = Trace(middle).part;
      const std::array<int, 5> parts{above[i], above[i + 1], below[i], below[i + 1], centre};
      if (std::none_of(parts.begin(), parts.end(), [&](int part) { return ShowsFront(part); })) {
        continue;
      }
      const bool one =
          std::all_of(parts.begin(), parts.end(), [&](int part) { return part == centre; });
      row[x] = one ? LevelOfBoard(x, BoardOf(centre), middle) : LevelOfMixture(x);
    }
  }

 private:
  size_t BoardOf(int part) const { return static_cast<size_t>(part) - pixels_.first_part; }

  // Whether it is a board whose front the camera sees.
  bool ShowsFront(int part) const {
    return part >= static_cast<int>(pixels_.first_part) &&
           BoardOf(part) < tracer_.textures_.size() && centre_in_board_[BoardOf(part)].z() < 0;
  }

  // A place in pixel `x`, at z = 1 of the camera; `share`: 0 to 1 across it and down.
  Eigen::Vector2d InPixel(size_t x, const Eigen::Vector2d& share) const {
    return (1 - share.y()) * ((1 - share.x()) * upper_[x] + share.x() * upper_[x + 1]) +
           share.y() * ((1 - share.x()) * lower_[x] + share.x() * lower_[x + 1]);
  }

  Eigen::Vector3f Direction(const Eigen::Vector2d& ray) const {
    return (world_from_camera_ * ray.homogeneous()).cast<float>();
  }

  Hit Trace(const Eigen::Vector2d& ray) const {
    const RTCRayHit hit = pixels_.scene->First(centre_.cast<float>(), Direction(ray));
    if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
    return {static_cast<int>(hit.hit.instID[0]),
            hit.ray.tfar,
            {hit.hit.Ng_x, hit.hit.Ng_y, hit.hit.Ng_z}};
  }

  bool InShadow(const Eigen::Vector3f& point) const {
    return pixels_.scene->Meets(point, -light_.direction.cast<float>());
  }

  // The share of the light that a surface at `point` gets; `normal` towards the camera.
  float LightAt(const Eigen::Vector3f& point, const Eigen::Vector3f& normal) {
    const double cosine = -normal.dot(light_.direction.cast<float>());
    const bool shadow = cosine <= 0 || InShadow(point + RayScene::kLift * normal);
    return static_cast<float>(Illumination(light_, cosine, shadow));
  }

  // The ray's point on the board's plane, in the board's frame.
  Eigen::Vector2d OnBoard(size_t board, const Eigen::Vector2d& ray) const {
    const Eigen::Vector3d direction = board_from_camera_[board] * ray.homogeneous();
    const Eigen::Vector3d& centre = centre_in_board_[board];
    return centre.head<2>() - centre.z() / direction.z() * direction.head<2>();
  }

  float LightOnBoard(size_t board, const Eigen::Vector2d& ray) {
    const Eigen::Isometry3d& world_from_board =
        pixels_.scene->world_from_part(pixels_.first_part + board);
    const Eigen::Vector2d point = OnBoard(board, ray);
    return LightAt((world_from_board * Eigen::Vector3d(point.x(), point.y(), 0)).cast<float>(),
                   -world_from_board.linear().col(2).cast<float>());
  }

  float LevelOfBoard(size_t x, size_t board, const Eigen::Vector2d& middle) {
    const auto black = static_cast<float>(tracer_.textures_[board].BlackShare(
        {OnBoard(board, upper_[x]), OnBoard(board, upper_[x + 1]), OnBoard(board, lower_[x + 1]),
         OnBoard(board, lower_[x])}));
    return 255 * (kPaper + black * (kInk - kPaper)) * LightOnBoard(board, middle);
  }

  float LevelOfMixture(size_t x) {
    std::optional<float> room;
    float sum = 0;
    for (const Eigen::Vector2d& share : SpreadPoints()) {
      const Eigen::Vector2d ray = InPixel(x, share);
      const Hit hit = Trace(ray);
      if (hit.part == kNothing) {
        if (!room) room = LevelOfRoom(x);
        sum += *room;
      } else if (ShowsFront(hit.part)) {
        const size_t board = BoardOf(hit.part);
        const bool black = tracer_.textures_[board].IsBlack(OnBoard(board, ray));
        sum += 255 * (black ? kInk : kPaper) * LightOnBoard(board, ray);
      } else {
        sum += LevelOfPart(hit, Direction(ray));
      }
    }
    return sum / static_cast<float>(kRays);
  }

  float LevelOfRoom(size_t x) {
    const Background& background = *pixels_.background;
    const auto width =
        static_cast<size_t>(tracer_.settings_.cameras[pixels_.camera].model.intrinsics().width);
    const size_t pixel = static_cast<size_t>(pixels_.y) * width + x;
    if (background.receives_shadow[pixel] == 0) return background.lit[pixel];
    const float reach = background.distance[pixel] - RayScene::kLift;
    const bool shadow = InShadow(centre_.cast<float>() + reach * background.ray[pixel]);
    return shadow ? background.shadowed[pixel] : background.lit[pixel];
  }

  float LevelOfPart(const Hit& hit, const Eigen::Vector3f& direction) {
    const auto part = static_cast<size_t>(hit.part);
    Eigen::Vector3f normal =
        (pixels_.scene->world_from_part(part).linear().cast<float>() * hit.normal).normalized();
    if (normal.dot(direction) > 0) normal = -normal;
    return 255 * pixels_.scene->brightness(part) *
           LightAt(centre_.cast<float>() + hit.distance * direction, normal);
  }

  const BoardTracer& tracer_;
  const Pixels& pixels_;
  const Light& light_;
  std::span<const Eigen::Vector2d> upper_;
  std::span<const Eigen::Vector2d> lower_;
  Eigen::Matrix3d world_from_camera_;
  Eigen::Vector3d centre_;
  std::vector<Eigen::Matrix3d> board_from_camera_;
  std::vector<Eigen::Vector3d> centre_in_board_;
};

BoardTracer::BoardTracer(const SimulationSettings& settings) : settings_(settings) {
  if (settings.boards.empty()) return;
  for (const SimulatedBoard& board : settings.boards) {
    textures_.emplace_back(board.board, board.margin);
  }
  for (const SimulatedCamera& camera : settings.cameras) corners_.emplace_back(camera.model);
}

std::vector<BodyPart> BoardTracer::Plates() const {
  std::vector<BodyPart> plates;
  for (size_t b = 0; b < textures_.size(); ++b) {
    const Eigen::AlignedBox2d& paper = textures_[b].extent();
    BodyPart plate;
    plate.name = settings_.boards[b].board.description().name;
    plate.frame = b;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector2d corner = paper.corner(static_cast<Eigen::AlignedBox2d::CornerType>(i));
      plate.mesh.vertices.emplace_back(corner.x(), corner.y(), 0);
    }
    plate.mesh.triangles = {{0, 1, 3}, {0, 3, 2}};
    plate.brightness = kPaper;
    plates.push_back(std::move(plate));
  }
  return plates;
}

void BoardTracer::Trace(const Pixels& pixels, std::span<float> row) const {
  Work(*this, pixels).Run(row);
}

}  // namespace silhouette
