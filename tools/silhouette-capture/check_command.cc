// SPDX-License-Identifier: Apache-2.0
// silhouette-capture check: all that can be known of a cell before its robot moves.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"
#include "calib/camera/calibration.h"
#include "calib/files/calibration_message.h"
#include "calib/robot/drawn_cell.h"
#include "calib/robot/robot_model.h"
#include "capture/devices/camera_set.h"
#include "capture/devices/camera_settings.h"
#include "capture/devices/devices.h"
#include "capture/verification/samples.h"
#include "capture/verification/verified_robot.h"
#include "common/result/result.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/cell/robot_in_images.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/exchanged_views.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/run_plan.h"
#include "tools/silhouette-capture/skew_advice.h"

namespace silhouette {
namespace {

// An image of which more is white shows too little: obstacles before it are white, too.
constexpr double kMostWhite = 0.02;
constexpr double kLeastLevel = 20;
constexpr double kTurn = 2 * std::numbers::pi;
// Radians. Joints of robots rarely turn more than twice either way, and hardly ever more than ten
// times from limit to limit; limits in degrees look like tens of turns.
constexpr double kMostUsual = 2 * kTurn + 0.1;
constexpr double kMostPossible = 10 * kTurn;

struct Finding {
  std::string what;
  bool good = false;
  std::string text;
  bool doubtful = false;  // good, and worth a look
};
using Findings = std::vector<Finding>;

Finding OfGrid(const Cell& cell) {
  if (cell.robot.drawn) {
    const auto joints = static_cast<uint64_t>(cell.grid.dimensions());
    return {"grid", true,
            absl::StrCat("robot images are drawn; ", Counted(joints, "joint"),
                         joints == 1 ? " moves" : " move")};
  }
  std::vector<std::string> steps;
  for (const GridJoint& joint : cell.grid.joints()) {
    steps.push_back(absl::StrCat(joint.name, " ", joint.steps));
  }
  std::string text =
      absl::StrFormat("%d configurations (%s)", cell.grid.size(), absl::StrJoin(steps, ", "));
  if (cell.grid_move > 0) {
    absl::StrAppendFormat(&text, ", at most %.3g m from one to the next", cell.grid_move);
  }
  return {"grid", true, text};
}

// Of revolute joints of many turns.
Findings OfLimits(const Cell& cell) {
  Findings findings;
  if (cell.robot.model == nullptr) return findings;
  const RobotModel& robot = *cell.robot.model;
  for (const GridJoint& joint : cell.grid.joints()) {
    const auto index = robot.JointIndex(joint.name);
    if (!index || robot.joints()[*index].type != JointType::kRevolute) continue;
    const double most = std::max(std::abs(joint.lower), std::abs(joint.upper));
    if (most <= kMostUsual) continue;
    const bool degrees = joint.upper - joint.lower > kMostPossible;
    findings.push_back(
        {"joint " + joint.name, !degrees,
         absl::StrFormat(
             "its limits, %g to %g, are %.0f turns in radians; %s state radians in the "
             "URDF, or a unit in the cell file: {name: %s, lower: %g deg, upper: %g deg}",
             joint.lower, joint.upper, (joint.upper - joint.lower) / kTurn,
             degrees ? "they look like degrees:" : "if they are degrees,", joint.name, joint.lower,
             joint.upper)});
  }
  return findings;
}

// Of views whose cameras keep an exposure of their own.
Findings OfExposures(const Cell& cell) {
  Findings findings;
  for (const ViewSettings& view : cell.views) {
    const auto* genicam = std::get_if<GenicamSource>(&view.source);
    const auto* v4l2 = std::get_if<V4l2Source>(&view.source);
    if ((!genicam || genicam->exposure) && (!v4l2 || v4l2->exposure)) continue;
    findings.push_back({.what = "view " + view.name,
                        .good = true,
                        .text = "its source states no exposure: after a power failure the camera "
                                "may have another; state 'exposure' and 'gain'",
                        .doubtful = true});
  }
  return findings;
}

// Where the robot's joints stand, against the cell's file.
Findings OfRobot(const Cell& cell, Robot& robot) {
  const auto state = robot.State();
  if (!state.ok()) return {{"robot", false, std::string(state.status().message())}};
  if (state->moving) return {{"robot", false, "it moves; stop it first"}};
  Findings findings;
  const auto position = [&](const std::string& name) -> std::optional<double> {
    const auto found = std::ranges::find(robot.joints(), name);
    if (found == robot.joints().end()) return std::nullopt;
    return state->positions[static_cast<size_t>(found - robot.joints().begin())];
  };
  const auto fault = [&](const std::string& name, const std::string& text) {
    findings.push_back({"joint " + name, false, text});
  };
  for (const GridJoint& joint : cell.grid.joints()) {
    const auto value = position(joint.name);
    if (!value) {
      fault(joint.name,
            "the robot's driver does not know it; it knows " + absl::StrJoin(robot.joints(), ", "));
    } else if (!joint.continuous && (*value < joint.lower - cell.capture.joint_tolerance ||
                                     *value > joint.upper + cell.capture.joint_tolerance)) {
      fault(joint.name, absl::StrFormat("stands at %.4g, outside its range %.4g to %.4g", *value,
                                        joint.lower, joint.upper));
    }
  }
  for (const FixedJoint& joint : cell.fixed_joints) {
    const auto value = position(joint.name);
    if (!value) {
      fault(joint.name, absl::StrFormat("the robot's driver does not report it: look whether it "
                                        "stands at %.4g, as 'fixed' says",
                                        joint.position));
    } else if (std::abs(*value - joint.position) > cell.capture.joint_tolerance) {
      fault(joint.name,
            absl::StrFormat("stands at %.4g, not at %.4g as 'fixed' says", *value, joint.position));
    }
  }
  if (!findings.empty()) return findings;
  return {{"robot", true, "answers, and stands within the cell's ranges"}};
}

Finding OfImage(const ViewSettings& view, const CameraImage& image) {
  uint64_t sum = 0, white = 0;
  for (const uint8_t level : image.pixels) {
    sum += level;
    white += level == 255;
  }
  const auto count = static_cast<double>(std::max<size_t>(image.pixels.size(), 1));
  const double level = static_cast<double>(sum) / count;
  const double share = static_cast<double>(white) / count;
  std::string text =
      absl::StrFormat("%d x %d%s, mean level %.0f, %.1f %% white", image.width, image.height,
                      image.channels == 3 ? ", colour" : "", level, 100 * share);
  if (level < kLeastLevel) absl::StrAppend(&text, ": too dark; more light, or a longer exposure");
  if (share > kMostWhite) {
    absl::StrAppend(&text, ": overexposed; less light, or a shorter exposure");
  }
  const bool fits = image.width == view.image_width && image.height == view.image_height;
  if (!fits) {
    absl::StrAppendFormat(&text, ": image_size is [%d, %d]; correct it", view.image_width,
                          view.image_height);
  }
  return {"view " + view.name, fits && level >= kLeastLevel && share <= kMostWhite, text};
}

// Only if they are; what cannot be read or does not answer, others report.
Findings OfExchangedViews(const CellFile& file, const AnsweringDevices& devices) {
  if (!devices.robot.ok() || !devices.camera_errors.empty()) return {};
  const auto database = OpenDatabase(file, Database::Access::kRead);
  if (!database.ok()) return {};
  const auto exchanged = ExchangedViews(file.cell, **database, **devices.robot, *devices.cameras);
  Findings findings;
  if (!exchanged.ok()) return findings;
  for (const std::string& text : *exchanged) findings.push_back({"calibration", false, text});
  return findings;
}

// How far apart the images of a set are.
Finding OfSkew(const Cell& cell, const std::vector<CameraImage>& images) {
  const absl::Duration skew = SkewOf(images);
  const absl::Duration most = cell.server.scene.max_skew;
  const bool close = skew <= most;
  return {"cameras", close,
          absl::StrFormat("%.1f ms between the oldest and the newest image, ",
                          absl::ToDoubleMilliseconds(skew)) +
              (close ? absl::StrCat("max_skew is ", SpokenTime(most)) : SkewAdvice(most))};
}

// Of each view by itself, whatever the others' cameras do.
Findings OfCameras(const Cell& cell, AnsweringDevices& devices) {
  Findings findings;
  for (const auto& [view, why] : devices.camera_errors) {
    findings.push_back({"view " + view, false, std::string(why.message())});
  }
  std::vector<CameraImage> taken;
  std::vector<absl::StatusOr<CameraImage>> images = devices.cameras->GrabEach();
  for (size_t v = 0; v < images.size(); ++v) {
    const std::string& name = devices.cameras->views()[v];
    if (!images[v].ok()) {
      findings.push_back({"view " + name, false, std::string(images[v].status().message())});
      continue;
    }
    findings.push_back(
        OfImage(*std::ranges::find(cell.views, name, &ViewSettings::name), *images[v]));
    taken.push_back(*std::move(images[v]));
  }
  if (!taken.empty()) findings.push_back(OfSkew(cell, taken));
  return findings;
}

// Of robot and cameras, each by itself.
Findings OfDevices(const CellFile& file, const Travel& travel) {
  auto devices = OpenAnsweringDevices(file.cell, travel, file.variant);
  if (!devices.ok()) return {{"devices", false, std::string(devices.status().message())}};
  // First: a person at a manual robot is asked only when all else is known.
  const Findings cameras = OfCameras(file.cell, *devices);
  const absl::Status answers = devices->robot.status();
  Findings findings = answers.ok() ? OfRobot(file.cell, **devices->robot)
                                   : Findings{{"robot", false, std::string(answers.message())}};
  for (const Findings& more : {cameras, OfExchangedViews(file, *devices)}) {
    findings.insert(findings.end(), more.begin(), more.end());
  }
  return findings;
}

// What the cell's database has of a drawn robot; what it lacks, or cannot be read, OfCapture
// reports.
struct StoredOfDrawn {
  Calibration calibration{};
  std::vector<MaskSize> mask_sizes{};
  std::optional<storage::v1::ModelVerification> verification{};
};
StoredOfDrawn ReadStoredOfDrawn(const CellFile& file) {
  const auto database = OpenDatabase(file, Database::Access::kRead);
  if (!database.ok()) return {};
  const auto snapshot = (*database)->Read();
  if (!snapshot.ok()) return {};
  const auto stored = snapshot->Calibration();
  const auto verification = snapshot->Verification();
  if (!stored.ok() || !*stored || !verification.ok()) return {};
  auto calibration = CalibrationFrom(**stored);
  if (!calibration.ok() || calibration->cameras.empty()) return {};
  return {*std::move(calibration), (*database)->mask_sizes(), *verification};
}

// Whether the robot can be drawn, what its model cannot show, and which views do not hold it.
Findings OfDrawnImages(const CellFile& file) {
  const Cell& cell = file.cell;
  const auto drawn = DrawnCellOf(cell);
  if (!drawn.ok()) return {{"robot images", false, std::string(drawn.status().message())}};
  if (!*drawn) return {};
  const DrawnCell& of = **drawn;
  std::vector<std::string> moving;
  for (const GridJoint& joint : cell.grid.joints()) moving.push_back(joint.name);
  const StoredOfDrawn stored = ReadStoredOfDrawn(file);
  const auto robot = DrawnRobotOf(of, moving, cell.fixed_joints, stored.calibration,
                                  stored.mask_sizes, cell.calibration.margin);
  if (!robot.ok()) return {{"robot images", false, std::string(robot.status().message())}};
  Findings findings = {
      {"robot images", true, absl::StrCat("drawn, of ", robot->parts().size(), " parts")}};
  const Eigen::AlignedBox3d everywhere(Eigen::Vector3d::Constant(-1e3),
                                       Eigen::Vector3d::Constant(1e3));
  const ModelSampler sampler(*robot, cell.grid.joints(), cell.workspace.value_or(everywhere),
                             of.forbidden, {.tolerance = of.parts.tolerance}, 1);
  std::vector<std::string> links;
  for (const RobotLink& link : of.robot->links()) links.push_back(link.name);
  const std::string text = AlwaysNarrowText(sampler, links);
  const bool beyond = std::ranges::any_of(sampler.AlwaysNarrow(),
                                          [](const NarrowGap& gap) { return gap.face >= 0; });
  // Good in what it is for, but verify-model does not drive the robot so.
  if (!text.empty()) findings.push_back({"links", !beyond, text, /*doubtful=*/!beyond});
  if (stored.calibration.cameras.empty()) return findings;
  const auto verified = VerifiedRobotOf(of, *robot, cell.grid.joints(), stored.verification);
  const std::string partial =
      PartialViews(cell, verified.ok() ? verified->robot : *robot, of.forbidden);
  if (!partial.empty()) {
    findings.push_back({.what = "views", .good = true, .text = partial, .doubtful = true});
  }
  return findings;
}

// How far the robot leaves it. One whose images are drawn may: nothing is free there.
Findings OfWorkspace(const Cell& cell) {
  if (!cell.workspace) return {};
  const absl::Status holds = WorkspaceHoldsRobot(cell);
  if (!holds.ok()) {
    const bool may = cell.robot.drawn.has_value();
    return {{"workspace", may, std::string(holds.message()), may}};
  }
  if (cell.robot.model == nullptr) return {};
  return {{"workspace", true, "holds the robot at all joint values of the grid"}};
}

// The database, and what is still to be captured into it.
Findings OfCapture(const CellArguments& arguments, const CellFile& file, const Travel& travel) {
  const auto database = OpenDatabase(file, Database::Access::kRead);
  Findings findings;
  if (absl::IsNotFound(database.status())) {
    findings.push_back(
        {"database", true,
         absl::StrCat("not there yet; next: ", file.cell.robot.drawn && !HasSources(file.cell)
                                                   ? ImportCamerasCommand(file)
                                                   : arguments.Command("reference"))});
  } else if (!database.ok()) {
    return {{"database", false, std::string(database.status().message())}};
  } else {
    findings.push_back({"database", true, absl::StrCat(file.database, " is of this cell")});
    const auto misplaced = MisplacedViews(file.cell, **database);
    if (!misplaced.ok()) return {{"database", false, std::string(misplaced.status().message())}};
    if (!misplaced->empty()) findings.push_back({"calibration", false, *misplaced});
  }
  if (file.cell.robot.drawn) return findings;
  const Database* stored = database.ok() ? database->get() : nullptr;
  const auto planned = MakePlan({}, arguments, file.cell, travel, stored);
  if (!planned.ok()) {
    findings.push_back({"plan", false, std::string(planned.status().message())});
    return findings;
  }
  const CapturePlan& plan = *planned;
  const DiskRoom room = RoomFor(plan, file, stored);
  findings.push_back(
      {"disk", room.Suffices(plan),
       room.Suffices(plan) ? "there is room for the capture" : TooLittleRoom(plan, room)});
  findings.push_back({"forbidden regions", plan.parts <= 1,
                      plan.parts <= 1
                          ? absl::StrCat(plan.exclusions.size(), " configurations are forbidden")
                          : absl::StrCat("they cut the grid into ", plan.parts,
                                         " parts; the robot captures the one it stands in")});
  return findings;
}

absl::StatusOr<ExitCode> Check(const CellArguments& arguments) {
  ASSIGN_OR_RETURN(const CellFile file, OpenCellFile(arguments));
  const Travel travel(file.cell.grid, file.cell.capture.forbidden_regions);
  Findings findings = {OfGrid(file.cell)};
  const auto add = [&](const Findings& more) {
    findings.insert(findings.end(), more.begin(), more.end());
  };
  add(OfLimits(file.cell));
  add(OfExposures(file.cell));
  add(OfDrawnImages(file));
  add(OfWorkspace(file.cell));
  for (const std::string& doubt : Doubts(file.cell)) {
    add({{.what = "cell file", .good = true, .text = doubt, .doubtful = true}});
  }
  add(OfDevices(file, travel));
  add(OfCapture(arguments, file, travel));

  const bool good = std::ranges::all_of(findings, &Finding::good);
  nlohmann::ordered_json json = {{"good", good}, {"findings", nlohmann::ordered_json::array()}};
  std::string text;
  for (const Finding& finding : findings) {
    json["findings"].push_back({{"what", finding.what},
                                {"good", finding.good},
                                {"doubtful", finding.doubtful},
                                {"text", finding.text}});
    absl::StrAppendFormat(&text, "%-5s  %s: %s\n",
                          !finding.good      ? "FAULT"
                          : finding.doubtful ? "NOTE"
                                             : "ok",
                          finding.what, finding.text);
  }
  PrintResult(arguments.format, json, text);
  return good ? kDone : kNo;
}

}  // namespace

void AddCheck(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "check",
      "Shows all that can be known before the robot moves: whether it answers and where it "
      "stands,\n"
      "one image of each camera, the grid, the database, the disk, and of a robot whose images "
      "are\n"
      "drawn whether it can be, and which links always touch by its model. Moves and stores "
      "nothing.\n"
      "Exit code 0: no fault; 1: there are faults.");
  command->footer("Example:\n  silhouette-capture check --cell cell.yaml");
  const auto arguments = std::make_shared<CellArguments>();
  AddCellOptions(*command, *arguments);
  AddVariantOption(*command, *arguments);
  command->callback([arguments, &work] { work = [arguments] { return Check(*arguments); }; });
}

}  // namespace silhouette
