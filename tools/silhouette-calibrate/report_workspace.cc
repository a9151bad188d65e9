#include "tools/silhouette-calibrate/report_workspace.h"

#include <Eigen/Geometry>
#include <random>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "calib/robot/robot_model.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

constexpr int kConfigurations = 300;

WorkspacePoints PointsOfBox(const Eigen::AlignedBox3d& box, const std::string& name) {
  constexpr int kSteps = 8;
  WorkspacePoints result{.points{}, .name = name};
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      for (int k = 0; k <= kSteps; ++k) {
        const Eigen::Vector3d share = Eigen::Vector3d(i, j, k) / kSteps;
        result.points.push_back(box.min() + share.cwiseProduct(box.sizes()));
      }
    }
  }
  return result;
}

absl::StatusOr<Eigen::AlignedBox3d> BoxFrom(const std::string& text) {
  const auto wrong = [&] {
    return absl::InvalidArgumentError(absl::StrCat(
        "--workspace '", text, "' is not like -0.5:0.5,-0.4:0.4,0:1.2 (metres, x, y and z)"));
  };
  const std::vector<std::string> ranges = absl::StrSplit(text, ',');
  if (ranges.size() != 3) return wrong();
  Eigen::AlignedBox3d box;
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<std::string> ends = absl::StrSplit(ranges[static_cast<size_t>(axis)], ':');
    if (ends.size() != 2 || !absl::SimpleAtod(ends[0], &box.min()[axis]) ||
        !absl::SimpleAtod(ends[1], &box.max()[axis]) || !(box.min()[axis] < box.max()[axis])) {
      return wrong();
    }
  }
  return box;
}

// The origins of all links in configurations by chance, the same ones each time.
WorkspacePoints PointsOfRobot(const RobotModel& robot, const Cell* cell) {
  std::vector<double> lower;
  std::vector<double> upper;
  for (const RobotJoint& joint : robot.joints()) {
    lower.push_back(joint.lower);
    upper.push_back(joint.upper);
  }
  const auto set = [&](const std::string& name, double from, double to) {
    if (const auto joint = robot.JointIndex(name)) {
      lower[*joint] = from;
      upper[*joint] = to;
    }
  };
  if (cell != nullptr) {
    for (const FixedJoint& joint : cell->fixed_joints) {
      set(joint.name, joint.position, joint.position);
    }
    for (const GridJoint& joint : cell->grid.joints()) set(joint.name, joint.lower, joint.upper);
  }
  WorkspacePoints result{
      .points{}, .name = absl::StrCat("where the links of '", robot.name(), "' get by its model")};
  std::mt19937_64 random(1);
  for (int i = 0; i < kConfigurations; ++i) {
    std::vector<double> positions;
    for (size_t joint = 0; joint < lower.size(); ++joint) {
      const double share = static_cast<double>(random() >> 11) * 0x1p-53;
      positions.push_back(lower[joint] + share * (upper[joint] - lower[joint]));
    }
    const std::vector<Eigen::Isometry3d> links = robot.LinkPoses(positions);
    for (size_t link = 1; link < links.size(); ++link) {
      result.points.emplace_back(links[link].translation());
    }
  }
  return result;
}

}  // namespace

absl::StatusOr<WorkspacePoints> WorkspacePointsOf(const PoseSources& sources,
                                                  const std::string& box) {
  if (!box.empty()) {
    ASSIGN_OR_RETURN(const Eigen::AlignedBox3d given, BoxFrom(box));
    return PointsOfBox(given, absl::StrCat("the box ", box, " (metres)"));
  }
  std::optional<Cell> cell;
  std::string urdf = sources.urdf;
  if (!sources.cell.empty()) {
    ASSIGN_OR_RETURN(Cell loaded, LoadCell(sources.cell));
    cell = std::move(loaded);
    urdf = cell->robot.urdf;
  }
  if (urdf.empty()) {
    if (!cell || !cell->workspace) return WorkspacePoints{};
    return PointsOfBox(*cell->workspace, "the cell's workspace");
  }
  ASSIGN_OR_RETURN(
      const RobotModel robot,
      RobotModel::FromUrdf(urdf, cell ? cell->robot.package_paths : std::vector<std::string>()));
  return PointsOfRobot(robot, cell ? &*cell : nullptr);
}

}  // namespace silhouette
