#include "calib/report/image_map.h"

#include <algorithm>
#include <cmath>

#include "calib/report/pixel_sum.h"
#include "calib/report/projection_error.h"

namespace silhouette {
namespace {

constexpr int kColumns = 16;  // of the longer side

size_t CellOf(const ReportView& view, const Eigen::Vector2d& pixel) {
  const ImageMap& map = view.map;
  const auto place = [](double share, int count) {
    return std::clamp(static_cast<int>(std::floor(share * count)), 0, count - 1);
  };
  const int column = place((pixel.x() + 0.5) / view.width, map.columns);
  const int row = place((pixel.y() + 0.5) / view.height, map.rows);
  return static_cast<size_t>(row) * static_cast<size_t>(map.columns) + static_cast<size_t>(column);
}

// Whether a field or one beside it has corners.
bool Reached(const ImageMap& map, size_t cell) {
  const int row = static_cast<int>(cell) / map.columns;
  const int column = static_cast<int>(cell) % map.columns;
  for (int r = std::max(0, row - 1); r <= std::min(map.rows - 1, row + 1); ++r) {
    for (int c = std::max(0, column - 1); c <= std::min(map.columns - 1, column + 1); ++c) {
      if (map.cells[static_cast<size_t>(r * map.columns + c)].corners > 0) return true;
    }
  }
  return false;
}

void FillCorners(ReportView& view) {
  Eigen::AlignedBox2d box;
  std::vector<PixelSum> sums(view.map.cells.size());
  for (const ReportCorner& corner : view.points) {
    if (corner.outlier) continue;
    box.extend(corner.pixel);
    const size_t place = CellOf(view, corner.pixel);
    MapCell& cell = view.map.cells[place];
    ++cell.corners;
    cell.mean += (corner.fit - cell.mean) / cell.corners;
    sums[place].Add(corner.fit);
  }
  int covered = 0;
  for (size_t i = 0; i < sums.size(); ++i) {
    view.map.cells[i].fit_px = sums[i].Rms();
    covered += view.map.cells[i].corners > 0 ? 1 : 0;
  }
  view.coverage = static_cast<double>(covered) / static_cast<double>(sums.size());
  if (box.isEmpty()) return;
  view.span_x = box.sizes().x() / view.width;
  view.span_y = box.sizes().y() / view.height;
}

}  // namespace

void FillMap(const CameraModel& lens, const SolvedView* solved,
             const std::vector<Eigen::Vector3d>& workspace, ReportView& view) {
  const int longer = std::max(view.width, view.height);
  const auto fields = [&](int side) {
    return std::max(1, static_cast<int>(std::lround(1.0 * kColumns * side / longer)));
  };
  view.map.columns = fields(view.width);
  view.map.rows = fields(view.height);
  view.map.cells.resize(static_cast<size_t>(view.map.columns) * static_cast<size_t>(view.map.rows));
  FillCorners(view);
  if (solved == nullptr) return;
  std::vector<PixelSum> sums(view.map.cells.size());
  int reached = 0;
  for (const Eigen::Vector3d& point : workspace) {
    const auto pixel = lens.Project(solved->camera_pose * point);
    if (!pixel) continue;
    const size_t cell = CellOf(view, *pixel);
    sums[cell].Add(PixelVariance(lens, *solved, point).value_or(0));
    reached += Reached(view.map, cell) ? 1 : 0;
  }
  for (size_t i = 0; i < sums.size(); ++i) {
    view.map.cells[i].points = sums[i].count();
    view.map.cells[i].predicted_px = sums[i].Rms();
  }
  if (!workspace.empty()) {
    view.reached = static_cast<double>(reached) / static_cast<double>(workspace.size());
  }
}

}  // namespace silhouette
