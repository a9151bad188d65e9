// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/robot_in_reference.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <variant>

#include "capture/session/cell_robot.h"
#include "capture/session/robot_outline.h"
#include "db/status/status_macros.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/cell/expected_robot.h"

namespace silhouette {
namespace {

constexpr char kWhetherRobotIsThere[] = "whether the robot is in a reference image";
constexpr int kLongestSide = 640;  // of the images that it is looked for in

// Whether the robot is asked where it is, and no operator.
bool Reports(const RobotDriver& driver) {
  if (const auto* manual = std::get_if<ManualRobotSettings>(&driver)) {
    return !std::holds_alternative<std::monostate>(manual->read);
  }
  return !std::holds_alternative<std::monostate>(driver);
}

// Where the robot says that it is, as CellRobot has it.
absl::StatusOr<std::vector<double>> ReportedJoints(const Cell& cell, const Database& database) {
  ASSIGN_OR_RETURN(const auto robot, OpenRobotAlone(cell));
  ASSIGN_OR_RETURN(CellRobot cell_robot, CellRobot::Create(database.cell(), *robot));
  return cell_robot.Measure();
}

// Why ExpectedRobotOf() has none.
absl::StatusOr<std::string> WhyNotExpected(const Cell& cell, const Database& database) {
  if (cell.robot.model == nullptr) return "the cell file names no urdf";
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto calibration, snapshot.Calibration());
  return calibration && !calibration->cameras().empty()
             ? "its model cannot be drawn"
             : "the database has no calibration with camera models yet";
}

MaskSize SizeToLookIn(cv::Size image) {
  const int scale = std::max(1, (std::max(image.width, image.height) - 1) / kLongestSide + 1);
  return {image.width / scale, image.height / scale};
}

}  // namespace

absl::StatusOr<RobotInReference> FindRobot(const Cell& cell, const Database& database,
                                           const storage::v1::References& taken) {
  RobotInReference found;
  if (std::holds_alternative<SimulatedRobotDriver>(cell.robot.driver)) return found;
  ASSIGN_OR_RETURN(const auto references, ReferencesIn(taken, database.cell()));
  std::vector<MaskSize> sizes;
  for (const Reference& reference : references) sizes.push_back(SizeToLookIn(reference.size()));
  ASSIGN_OR_RETURN(const auto robot, ExpectedRobotOf(cell, database, sizes, kWhetherRobotIsThere));
  if (!robot) {
    ASSIGN_OR_RETURN(found.not_looked_for, WhyNotExpected(cell, database));
    return found;
  }
  if (!Reports(cell.robot.driver)) {
    found.not_looked_for = "it does not report its joint values";
    return found;
  }
  const auto joints = ReportedJoints(cell, database);
  if (!joints.ok()) {
    found.not_looked_for = std::string(joints.status().message());
    return found;
  }
  const std::vector<Mask> masks = robot->Touched(*joints);
  for (size_t view = 0; view < masks.size(); ++view) {
    cv::Mat image;
    references[view].AsGrey().mean().convertTo(image, CV_8U, 1.0 / Reference::kGreyLevel);
    const auto outline = FindOutline(image, masks[view]);
    if (!outline || !outline->Seen()) continue;
    cv::Mat marked;
    cv::resize(OutlineOf(masks[view]), marked, image.size(), 0, 0, cv::INTER_NEAREST);
    found.views.push_back({view, image, marked});
  }
  return found;
}

}  // namespace silhouette
