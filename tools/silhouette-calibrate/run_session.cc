// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/run_session.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <set>
#include <stop_token>
#include <thread>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "calib/boards/csv.h"
#include "calib/boards/sighting_file.h"
#include "calib/detection/image_tags.h"
#include "calib/poses/pose_files.h"
#include "calib/robot/floor_check.h"
#include "capture/devices/joint_deviation.h"
#include "capture/devices/running_clock.h"
#include "capture/devices/state_since.h"
#include "capture/session/cell_cameras.h"
#include "capture/session/travel.h"
#include "common/picture/files.h"
#include "common/picture/picture.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-calibrate/detect.h"
#include "tools/silhouette-calibrate/files.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

std::string PathIn(const std::string& folder, const std::string& name) {
  return (fs::path(folder) / name).string();
}

std::vector<std::string> JointColumns(const RobotModel& robot) {
  std::vector<std::string> columns{"frame"};
  for (const RobotJoint& joint : robot.joints()) columns.push_back(joint.name);
  return columns;
}

std::string JointsText(const RobotModel& robot, const SessionRecord& record) {
  std::string text = absl::StrCat(
      absl::StrJoin(JointColumns(robot), ",",
                    [](std::string* out, const std::string& s) { *out += CsvField(s); }),
      "\n");
  for (size_t f = 0; f < record.frames.size(); ++f) {
    absl::StrAppend(&text, CsvField(record.frames[f]));
    for (const double value : record.positions[f]) absl::StrAppend(&text, ",", CsvNumber(value));
    text += '\n';
  }
  return text;
}

RobotPose PoseOf(const RobotModel& robot, size_t flange, const std::string& frame,
                 const PosePlan::Positions& positions) {
  return {.frame = frame, .base_from_flange = robot.LinkPoses(positions)[flange]};
}

// Poses in vain, for each frame that is wanted, before giving up; and before the first frame.
constexpr size_t kMostInVain = 6;
constexpr size_t kMostBeforeFirst = 20;

// Longest delay until the robot receives a stop.
constexpr absl::Duration kGuardPeriod = absl::Milliseconds(10);

FloorCheck FloorOf(const Cell& cell, const RobotModel& robot, const SessionSettings& settings) {
  // Half of the board's diagonal: as far as it reaches, however it is turned, if its middle is at
  // its link's origin.
  double reach = 0;
  for (const Board& board : settings.tags.boards) {
    if (board.description().name != settings.flange_board) continue;
    reach = board.extent().norm() / 2;
  }
  return {robot, cell.sound ? cell.sound->geometry : BodyGeometry::kVisual, settings.floor,
          settings.flange, reach};
}

std::string FloorName(const SessionSettings& settings) {
  return absl::StrFormat("the floor at %g m (--floor)", settings.floor);
}

// What is in the way from one pose to another: a forbidden region of the cell, or the floor.
// Nothing: the way is free.
std::optional<std::string> InTheWay(const Cell& cell, const RobotModel& robot,
                                    const SessionSettings& settings, const FloorCheck& floor,
                                    const PosePlan::Positions& from,
                                    const PosePlan::Positions& to) {
  Configuration here;
  Configuration there;
  for (const GridJoint& joint : cell.grid.joints()) {
    const size_t index = robot.JointIndex(joint.name).value();
    here.push_back(from[index]);
    there.push_back(to[index]);
  }
  const ForbiddenRegions regions(cell.capture.forbidden_regions, cell.grid);
  if (const auto region = regions.Between(here, there)) {
    return absl::StrCat("the forbidden region '", *region, "'");
  }
  if (floor.Below(from, to)) return FloorName(settings);
  return std::nullopt;
}

// The views that see the flange's board in a frame.
std::vector<std::string> ViewsOfFlangeBoard(const SessionSettings& settings,
                                            const std::vector<TagSighting>& sightings,
                                            const std::string& frame) {
  const Board& board = *std::ranges::find_if(settings.tags.boards, [&](const Board& one) {
    return one.description().name == settings.flange_board;
  });
  std::set<std::string> views;
  for (const TagSighting& seen : sightings) {
    if (seen.frame == frame && board.HasTag(seen.family, seen.tag)) views.insert(seen.view);
  }
  return {views.begin(), views.end()};
}

// A robot at work: knows its grid joints for the forbidden regions.
class Recorder {
 public:
  Recorder(const Cell& cell, const RobotModel& robot, const SessionSettings& settings,
           Robot& driver, CellCameras& cameras)
      : cell_(cell),
        robot_(robot),
        settings_(settings),
        driver_(driver),
        cameras_(cameras),
        detector_(settings.tags.boards) {}

  // Where the robot stands, in the order of the model's joints; as StateSince().
  absl::StatusOr<PosePlan::Positions> Measure(absl::Duration since = -absl::InfiniteDuration()) {
    ASSIGN_OR_RETURN(const RobotState state, StateSince(driver_, since));
    if (state.moving) return absl::AbortedError("the robot moves though it has arrived");
    return robot_.Positions(driver_.joints(), state.positions);
  }

  absl::Status MoveTo(const PosePlan::Positions& positions) {
    std::vector<double> ordered;
    for (const std::string& name : driver_.joints()) {
      const std::optional<size_t> joint = robot_.JointIndex(name);
      if (!joint) {
        return InvalidArgument("the robot's joint '", name, "' is not in its model");
      }
      ordered.push_back(positions[*joint]);
    }
    const std::jthread guard([this](const std::stop_token& arrived) { StopIfAsked(arrived); });
    absl::Status moved = driver_.MoveTo(ordered);
    absl::SleepFor(cell_.capture.settle);
    return moved;
  }

  // Takes images and finds tags. The views that see the flange's board; empty: nothing is added.
  absl::StatusOr<std::vector<std::string>> TakeFrame(const std::string& frame,
                                                     SessionRecord& record) {
    ASSIGN_OR_RETURN(const PosePlan::Positions positions, Measure());
    ASSIGN_OR_RETURN(const ImageSet set, GrabSet(cameras_));
    ASSIGN_OR_RETURN(const PosePlan::Positions after, Measure(RunningNow()));
    const JointDeviation moved = DeviationOf(positions, after);
    if (moved.deviation > cell_.capture.joint_tolerance) {
      const RobotJoint& joint = robot_.joints()[moved.joint];
      return absl::AbortedError(absl::StrFormat(
          "%s moved by %.4f %s while images were taken, more than %.4f (capture: "
          "joint_tolerance); raise capture: settle",
          joint.name, moved.deviation, joint.type == JointType::kPrismatic ? "m" : "rad",
          cell_.capture.joint_tolerance));
    }
    std::vector<TagSighting> sightings;
    for (size_t v = 0; v < set.images.size(); ++v) {
      const std::string& view = cell_.views[v].name;
      ASSIGN_OR_RETURN(const ImageTags tags,
                       Look(settings_.tags, detector_, set.images[v], view, frame));
      const std::vector<TagSighting> found = SightingsOf(tags);
      sightings.insert(sightings.end(), found.begin(), found.end());
    }
    const std::vector<std::string> views = ViewsOfFlangeBoard(settings_, sightings, frame);
    if (views.empty()) return views;
    for (size_t v = 0; v < set.images.size(); ++v) {
      const fs::path place = fs::path(settings_.folder) / "images" / cell_.views[v].name;
      RETURN_IF_ERROR(MakeFolder(place.string()));
      RETURN_IF_ERROR(WriteWholeFile((place / (frame + ".png")).string(), EncodePng(set.images[v]),
                                     Outlasts::kPowerFailure));
    }
    record.frames.push_back(frame);
    record.positions.push_back(positions);
    record.robot_poses.push_back(PoseOf(robot_, settings_.flange, frame, positions));
    record.sightings.insert(record.sightings.end(), sightings.begin(), sightings.end());
    RETURN_IF_ERROR(WriteRecord(settings_.folder, robot_, record));
    return views;
  }

 private:
  JointDeviation DeviationOf(const PosePlan::Positions& from, const PosePlan::Positions& to) const {
    std::vector<bool> continuous;
    for (const RobotJoint& joint : robot_.joints()) {
      continuous.push_back(joint.type == JointType::kContinuous);
    }
    return GreatestDeviation(from, to, continuous);
  }

  // Stops the robot if a stop signal comes before it has arrived. Repeats the stop, as the robot
  // may be about to start.
  void StopIfAsked(const std::stop_token& arrived) {
    bool complained = false;
    for (; !arrived.stop_requested(); absl::SleepFor(kGuardPeriod)) {
      const absl::Status stopped = StopRequested() ? driver_.Stop() : absl::OkStatus();
      if (stopped.ok() || complained) continue;
      std::cerr << "cannot stop the robot: " << stopped.message() << std::endl;
      complained = true;
    }
  }

  const Cell& cell_;
  const RobotModel& robot_;
  const SessionSettings& settings_;
  Robot& driver_;
  CellCameras& cameras_;
  BoardDetector detector_;
};

// Where joints stand that are not moved, if the robot stands at `here` now.
PosePlan::Positions RestOf(const Cell& cell, const RobotModel& robot, PosePlan::Positions here) {
  for (const FixedJoint& joint : cell.fixed_joints) {
    here[robot.JointIndex(joint.name).value()] = joint.position;
  }
  for (const GridJoint& joint : cell.grid.joints()) {
    if (joint.continuous) continue;  // it may stand in another turn
    double& position = here[robot.JointIndex(joint.name).value()];
    position = std::clamp(position, joint.lower, joint.upper);
  }
  return here;
}

std::string FrameName(uint32_t number) { return absl::StrFormat("%04d", number); }

// The greatest number among names; 0: there is none.
uint32_t GreatestNumber(const std::vector<std::string>& names) {
  uint32_t greatest = 0;
  for (const std::string& name : names) {
    uint32_t number = 0;
    if (absl::SimpleAtoi(name, &number)) greatest = std::max(greatest, number);
  }
  return greatest;
}

// The names of the session's images without extension, also of frames that are not in the record.
std::vector<std::string> NamesOfImages(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;  // there are none yet
  for (const auto& entry : fs::recursive_directory_iterator(PathIn(folder, "images"), error)) {
    if (entry.path().extension() == ".png") names.push_back(entry.path().stem().string());
  }
  return names;
}

// Reports to the plan which views saw the flange's board in the frames of a resumed record.
void ReportFrames(const SessionSettings& settings, const SessionRecord& record, PosePlan& plan) {
  for (size_t f = 0; f < record.frames.size(); ++f) {
    plan.Tell(record.positions[f],
              ViewsOfFlangeBoard(settings, record.sightings, record.frames[f]));
  }
}

}  // namespace

absl::Status WriteRecord(const std::string& folder, const RobotModel& robot,
                         const SessionRecord& record) {
  // Corners last: frames without a robot pose would be of no use, the other way round does no harm.
  const auto write = [&](const std::string& name, const std::string& text) {
    return WriteWholeFile(PathIn(folder, name), text, Outlasts::kPowerFailure);
  };
  RETURN_IF_ERROR(write("joints.csv", JointsText(robot, record)));
  RETURN_IF_ERROR(write("robot_poses.csv", RobotPoseFileText(record.robot_poses)));
  return write("corners.csv", SightingFileText(record.sightings));
}

absl::StatusOr<SessionRecord> ReadRecord(const std::string& folder, const RobotModel& robot,
                                         size_t flange) {
  SessionRecord record;
  const std::string corners = PathIn(folder, "corners.csv");
  const std::string joints = PathIn(folder, "joints.csv");
  if (!fs::exists(corners) && !fs::exists(joints)) return record;
  ASSIGN_OR_RETURN(const std::string joints_text, ReadWholeFile(joints));
  ASSIGN_OR_RETURN(const auto rows, CsvRows(joints_text, joints, JointColumns(robot)));
  for (const CsvRow& row : rows) {
    if (uint32_t number = 0; !absl::SimpleAtoi(row.Text(0), &number)) {
      return InvalidArgument(row.place(), ": the frame '", row.Text(0),
                             "' is not a number such as 0012; restore the line, or delete it");
    }
    record.frames.push_back(row.Text(0));
    record.positions.emplace_back();
    for (size_t j = 0; j < robot.joints().size(); ++j) {
      ASSIGN_OR_RETURN(const double value, row.Number(j + 1));
      record.positions.back().push_back(value);
    }
    record.robot_poses.push_back(PoseOf(robot, flange, row.Text(0), record.positions.back()));
  }
  if (!fs::exists(corners)) return record;
  ASSIGN_OR_RETURN(record.sightings, ReadSightings(corners));
  const std::set<std::string> frames(record.frames.begin(), record.frames.end());
  std::erase_if(record.sightings,
                [&](const TagSighting& seen) { return !frames.contains(seen.frame); });
  return record;
}

absl::StatusOr<std::vector<TagSighting>> DetectAgain(const std::string& folder,
                                                     const std::vector<std::string>& frames,
                                                     const std::vector<std::string>& views,
                                                     const DetectSettings& settings) {
  std::vector<ListedImage> images;
  for (const std::string& frame : frames) {
    for (const std::string& view : views) {
      const fs::path file = fs::path(folder) / "images" / view / (frame + ".png");
      images.push_back({view, frame, file.string()});
    }
  }
  std::vector<std::vector<TagSighting>> found(images.size());
  ASSIGN_OR_RETURN(const size_t done, DetectAll(images, settings, [&](size_t i, ImageTags tags) {
                     found[i] = SightingsOf(tags);
                     return absl::OkStatus();
                   }));
  if (done < images.size()) {
    return absl::CancelledError(
        "stopped; the session is kept: go on with the same command and --resume");
  }
  std::vector<TagSighting> sightings;
  for (const std::vector<TagSighting>& of_image : found) {
    sightings.insert(sightings.end(), of_image.begin(), of_image.end());
  }
  return sightings;
}

absl::Status RecordSession(const Cell& cell, const RobotModel& robot,
                           const SessionSettings& settings, Robot& driver, CameraRig& cameras,
                           SessionRecord& record) {
  ASSIGN_OR_RETURN(CellCameras of_cell, CamerasOfViews(cell, cameras));
  Recorder recorder(cell, robot, settings, driver, of_cell);
  ASSIGN_OR_RETURN(PosePlan::Positions start, recorder.Measure());
  PosePlan plan(robot, settings.flange, RestOf(cell, robot, std::move(start)), settings.joints,
                settings.seed);
  ReportFrames(settings, record, plan);
  const bool listed = !settings.given.empty();
  const size_t wanted = listed ? settings.given.size() : settings.frames;
  Progress progress("taking images", wanted, listed ? "poses" : "frames");
  size_t in_vain = 0;
  const FloorCheck floor = FloorOf(cell, robot, settings);
  uint32_t last = GreatestNumber(record.frames);
  // Listed poses keep their numbers: a frame is the line of the list.
  if (!listed) last = std::max(last, GreatestNumber(NamesOfImages(settings.folder)));
  bool moved_yet = false;
  while (listed ? last < wanted : record.frames.size() < wanted) {
    if (StopRequested()) return absl::CancelledError("stopped");
    ASSIGN_OR_RETURN(const PosePlan::Positions here, recorder.Measure());
    if (const auto low = floor.Below(here, here); low && !moved_yet) {
      return FailedPrecondition("the robot's link '", robot.links()[*low].name,
                                "' or what it carries is below ", FloorName(settings),
                                " already; move the robot up, or lower the floor");
    }
    std::optional<PosePlan::Positions> goal;
    if (listed) {
      goal = settings.given[last];
      if (const auto obstacle = InTheWay(cell, robot, settings, floor, here, *goal)) {
        return FailedPrecondition("pose ", last + 1, " of the list: ", *obstacle, " is in the way");
      }
    } else {
      std::map<std::string, int> refusals;  // by what is in the way
      goal = plan.Next([&](const PosePlan::Positions& to) {
        const auto obstacle = InTheWay(cell, robot, settings, floor, here, to);
        if (obstacle) ++refusals[*obstacle];
        return !obstacle;
      });
      if (!goal) {
        const auto most = std::ranges::max_element(
            refusals, {}, [](const auto& refusal) { return refusal.second; });
        return FailedPrecondition(
            "there is no pose that the robot may be driven to: most often ",
            refusals.empty() ? "something" : most->first,
            " is in the way; change that, or give other joint ranges (--joint) or poses (--poses)");
      }
    }
    moved_yet = true;
    if (absl::Status moved = recorder.MoveTo(*goal); !moved.ok()) {
      return StopRequested() ? absl::CancelledError("stopped") : moved;
    }
    ASSIGN_OR_RETURN(const auto views, recorder.TakeFrame(FrameName(last + 1), record));
    if (listed || !views.empty()) ++last;
    plan.Tell(*goal, views);
    in_vain += views.empty() ? 1 : 0;
    const bool none = record.frames.empty() && in_vain >= kMostBeforeFirst;
    if (!listed && (none || in_vain > kMostInVain * wanted)) {
      return FailedPrecondition(
          "the board '", settings.flange_board, "' was seen in ", record.frames.size(), " of ",
          record.frames.size() + in_vain,
          " poses only; is it on the flange, and large enough in the images?");
    }
    progress.Update(listed ? last : record.frames.size());
  }
  return absl::OkStatus();
}

}  // namespace silhouette
