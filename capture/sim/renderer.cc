// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "common/parallel/parallel.h"

namespace silhouette {
namespace {

constexpr size_t kPacket = 8;        // rays traced at once
constexpr int kRowsAtOnce = 8;       // rows that a thread takes at a time
constexpr uint8_t kBody = 1;         // a part may be seen in the pixel
constexpr uint8_t kFloorShadow = 2;  // a shadow may fall on the floor in the pixel
constexpr size_t kMostThreads = 8;

// Corners of a box and the middles of its edges, faces and itself: distortion bends edges.
std::array<Eigen::Vector3d, 27> PointsOf(const Eigen::AlignedBox3d& box) {
  std::array<Eigen::Vector3d, 27> points;
  for (int i = 0; i < 27; ++i) {
    const Eigen::Vector3d share(i % 3 / 2.0, i / 3 % 3 / 2.0, i / 9 / 2.0);
    points[static_cast<size_t>(i)] = box.min() + share.cwiseProduct(box.sizes());
  }
  return points;
}

// The image's pixels around projected points; the whole image if a point has no projection.
class PixelBounds {
 public:
  void Add(const std::optional<Eigen::Vector2d>& pixel) {
    if (pixel)
      box_.extend(*pixel);
    else
      whole_ = true;
  }
  // The bounds with a margin for what lies between the points, cut to the image.
  void Cut(int width, int height, int& left, int& right, int& top, int& bottom) const {
    left = top = 0;
    right = width;
    bottom = height;
    if (whole_) return;
    const Eigen::Vector2d margin = 0.02 * box_.sizes() + Eigen::Vector2d(2, 2);
    const Eigen::Vector2d lower = (box_.min() - margin).cwiseMax(0);
    const Eigen::Vector2d upper = (box_.max() + margin).cwiseMax(0);
    left = static_cast<int>(std::min<double>(lower.x(), width));
    top = static_cast<int>(std::min<double>(lower.y(), height));
    right = static_cast<int>(std::min<double>(upper.x() + 1, width));
    bottom = static_cast<int>(std::min<double>(upper.y() + 1, height));
  }

 private:
  Eigen::AlignedBox2d box_;
  bool whole_ = false;
};

std::vector<size_t> FramesOf(std::span<const BodyPart> parts) {
  std::vector<size_t> frames;
  for (const BodyPart& part : parts) frames.push_back(part.frame);
  return frames;
}

}  // namespace

struct Renderer::RowWork {
  // A pixel whose grey level depends on whether light reaches a point.
  struct Shaded {
    size_t x;
    Eigen::Vector3f point;
    float lit;
    float shadowed;
    bool floor;
  };

  std::vector<float> row;
  std::vector<Seen> seen;
  std::vector<Eigen::Vector3f> tints;
  std::vector<uint8_t> touched;
  std::vector<Shaded> shaded;
};

Renderer::Renderer(const SimulationSettings& settings, std::span<const BodyPart> robot)
    : settings_(settings), boards_(settings), robot_frames_(FramesOf(robot)) {
  for (const SimulatedCamera& camera : settings.cameras) {
    backgrounds_.push_back(MakeBackground(camera.model, settings));
  }
  scene_.Add(robot);
  scene_.Add(boards_.Plates());
}

void Renderer::SetObstacles(std::span<const BodyPart> obstacles) {
  scene_.RemoveFrom(first_obstacle());
  obstacle_frames_ = FramesOf(obstacles);
  scene_.Add(obstacles);
}

void Renderer::Place(size_t first, std::span<const size_t> frames, const Poses* poses) {
  for (size_t i = 0; i < frames.size(); ++i) {
    if (poses == nullptr) {
      scene_.Hide(first + i);
    } else {
      scene_.Place(first + i, (*poses)[frames[i]]);
    }
  }
}

void Renderer::Render(std::span<const size_t> cameras, const Poses* robot,
                      std::span<const std::optional<Eigen::Isometry3d>> boards,
                      const Poses& obstacles, const RowSink& sink) {
  Place(0, robot_frames_, robot);
  for (size_t b = 0; b < boards.size(); ++b) {
    if (boards[b]) {
      scene_.Place(first_board() + b, *boards[b]);
    } else {
      scene_.Hide(first_board() + b);
    }
  }
  Place(first_obstacle(), obstacle_frames_, &obstacles);
  scene_.Commit();

  struct Piece {
    size_t camera;
    int top;
  };
  std::vector<Piece> pieces;
  std::vector<std::vector<Rectangle>> rectangles(settings_.cameras.size());
  for (size_t camera : cameras) {
    rectangles[camera] = TouchedRectangles(camera);
    const int height = settings_.cameras[camera].model.intrinsics().height;
    for (int top = 0; top < height; top += kRowsAtOnce) pieces.push_back({camera, top});
  }

  ParallelFor(
      pieces.size(),
      [&](size_t i) {
        const auto [camera, top] = pieces[i];
        const int height = settings_.cameras[camera].model.intrinsics().height;
        RowWork work;
        for (int y = top; y < std::min(top + kRowsAtOnce, height); ++y) {
          RenderRow(camera, y, rectangles[camera], work);
          sink(camera, y, {.levels = work.row, .seen = work.seen, .tints = work.tints});
        }
      },
      kMostThreads);
}

Seen Renderer::KindOf(size_t part) const {
  if (part >= first_obstacle()) return Seen::kObstacle;
  return part >= first_board() ? Seen::kBoard : Seen::kRobot;
}

std::vector<Renderer::Rectangle> Renderer::TouchedRectangles(size_t camera) const {
  const CameraModel& model = settings_.cameras[camera].model;
  const int width = model.intrinsics().width;
  const int height = model.intrinsics().height;
  const double floor = settings_.room.lower.z();
  const Eigen::Vector3d& light = settings_.light.direction;
  std::vector<Rectangle> rectangles;
  for (size_t part = 0; part < scene_.parts(); ++part) {
    if (!scene_.visible(part)) continue;
    PixelBounds body;
    PixelBounds shadow;
    for (const Eigen::Vector3d& in_part : PointsOf(scene_.box(part))) {
      const Eigen::Vector3d point = scene_.world_from_part(part) * in_part;
      body.Add(model.Project(point));
      shadow.Add(model.Project(point - light * (std::max(point.z() - floor, 0.0) / light.z())));
    }
    for (const bool is_shadow : {false, true}) {
      Rectangle r{.shadow = is_shadow,
                  .board = !is_shadow && part >= first_board() && part < first_obstacle()};
      (is_shadow ? shadow : body).Cut(width, height, r.left, r.right, r.top, r.bottom);
      if (r.left < r.right && r.top < r.bottom) rectangles.push_back(r);
    }
  }
  return rectangles;
}

void Renderer::RenderRow(size_t camera, int y, std::span<const Rectangle> rectangles,
                         RowWork& work) const {
  const Background& background = backgrounds_[camera];
  const auto width = static_cast<size_t>(settings_.cameras[camera].model.intrinsics().width);
  const size_t first = static_cast<size_t>(y) * width;
  const auto lit = background.lit.begin() + static_cast<ptrdiff_t>(first);
  work.row.assign(lit, lit + static_cast<ptrdiff_t>(width));
  work.seen.assign(width, Seen::kRoom);
  work.tints.assign(width, settings_.room.tint.cast<float>());
  work.touched.assign(width, 0);
  work.shaded.clear();
  bool any = false;
  for (const Rectangle& r : rectangles) {
    if (y < r.top || y >= r.bottom) continue;
    any = true;
    for (int x = r.left; x < r.right; ++x) {
      work.touched[static_cast<size_t>(x)] |= r.shadow ? kFloorShadow : kBody;
    }
  }
  if (!any) return;
  TraceBodies(camera, y, work);
  TraceShadows(work);
  TraceBoards(camera, y, rectangles, work);
}

void Renderer::TraceBodies(size_t camera, int y, RowWork& work) const {
  const Background& background = backgrounds_[camera];
  const size_t width = work.row.size();
  const size_t first = static_cast<size_t>(y) * width;
  const Eigen::Vector3f centre = settings_.cameras[camera].model.Centre().cast<float>();
  const Eigen::Vector3f to_light = -settings_.light.direction.cast<float>();

  const auto shade_floor = [&](size_t x) {
    const size_t pixel = first + x;
    if ((work.touched[x] & kFloorShadow) == 0 || background.receives_shadow[pixel] == 0) return;
    const float reach = background.distance[pixel] - RayScene::kLift;
    work.shaded.push_back({x, centre + reach * background.ray[pixel], background.lit[pixel],
                           background.shadowed[pixel], true});
  };
  const auto shade_part = [&](size_t x, size_t part, Eigen::Vector3f normal, float distance) {
    const Eigen::Vector3f ray = background.ray[first + x];
    normal = (scene_.world_from_part(part).linear().cast<float>() * normal).normalized();
    if (normal.dot(ray) > 0) normal = -normal;
    const float cosine = normal.dot(to_light);
    const float brightness = 255 * scene_.brightness(part);
    const auto level = [&](bool in_shadow) {
      return brightness * static_cast<float>(Illumination(settings_.light, cosine, in_shadow));
    };
    work.seen[x] = KindOf(part);
    work.tints[x] = scene_.tint(part);
    work.row[x] = level(true);
    if (cosine <= 0) return;
    work.shaded.push_back(
        {x, centre + distance * ray + RayScene::kLift * normal, level(false), level(true), false});
  };

  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  RTCRayHit8 packet{};
  std::array<size_t, kPacket> columns{};
  alignas(32) std::array<int, kPacket> valid{};
  size_t count = 0;
  const auto trace = [&] {
    if (count == 0) return;
    for (size_t i = 0; i < kPacket; ++i) valid[i] = i < count ? -1 : 0;
    rtcIntersect8(valid.data(), scene_.scene(), &context, &packet);
    for (size_t i = 0; i < count; ++i) {
      if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) {
        shade_floor(columns[i]);
      } else {
        shade_part(columns[i], packet.hit.instID[0][i],
                   {packet.hit.Ng_x[i], packet.hit.Ng_y[i], packet.hit.Ng_z[i]},
                   packet.ray.tfar[i]);
      }
    }
    count = 0;
  };
  for (size_t x = 0; x < width; ++x) {
    if (work.touched[x] == 0) continue;
    if ((work.touched[x] & kBody) == 0) {
      shade_floor(x);
      continue;
    }
    const Eigen::Vector3f& ray = background.ray[first + x];
    columns[count] = x;
    packet.ray.org_x[count] = centre.x();
    packet.ray.org_y[count] = centre.y();
    packet.ray.org_z[count] = centre.z();
    packet.ray.dir_x[count] = ray.x();
    packet.ray.dir_y[count] = ray.y();
    packet.ray.dir_z[count] = ray.z();
    packet.ray.tnear[count] = 0;
    packet.ray.tfar[count] = background.distance[first + x];
    packet.ray.mask[count] = ~0U;
    packet.hit.geomID[count] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][count] = RTC_INVALID_GEOMETRY_ID;
    if (++count == kPacket) trace();
  }
  trace();
}

void Renderer::TraceShadows(RowWork& work) const {
  const Eigen::Vector3f to_light = -settings_.light.direction.cast<float>();
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  RTCRay8 packet{};
  alignas(32) std::array<int, kPacket> valid{};
  for (size_t first = 0; first < work.shaded.size(); first += kPacket) {
    const size_t count = std::min(kPacket, work.shaded.size() - first);
    for (size_t i = 0; i < kPacket; ++i) {
      valid[i] = i < count ? -1 : 0;
      if (i >= count) continue;
      const Eigen::Vector3f& point = work.shaded[first + i].point;
      packet.org_x[i] = point.x();
      packet.org_y[i] = point.y();
      packet.org_z[i] = point.z();
      packet.dir_x[i] = to_light.x();
      packet.dir_y[i] = to_light.y();
      packet.dir_z[i] = to_light.z();
      packet.tnear[i] = 0;
      packet.tfar[i] = std::numeric_limits<float>::infinity();
      packet.mask[i] = ~0U;
    }
    rtcOccluded8(valid.data(), scene_.scene(), &context, &packet);
    for (size_t i = 0; i < count; ++i) {
      const RowWork::Shaded& shaded = work.shaded[first + i];
      const bool in_shadow = packet.tfar[i] < 0;
      work.row[shaded.x] = in_shadow ? shaded.shadowed : shaded.lit;
      if (in_shadow && shaded.floor) work.seen[shaded.x] = Seen::kShadow;
    }
  }
}

void Renderer::TraceBoards(size_t camera, int y, std::span<const Rectangle> rectangles,
                           RowWork& work) const {
  for (const Rectangle& r : rectangles) {
    if (!r.board || y < r.top || y >= r.bottom) continue;
    boards_.Trace({.scene = &scene_,
                   .first_part = first_board(),
                   .background = &backgrounds_[camera],
                   .camera = camera,
                   .y = y,
                   .left = r.left,
                   .right = r.right},
                  work.row);
  }
}

}  // namespace silhouette
