#include "tools/silhouette-calibrate/run_session.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <opencv2/core/mat.hpp>
#include <set>
#include <stop_token>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "capture/session/forbidden_regions.h"
#include "common/picture/files.h"
#include "common/picture/picture.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-calibrate/run_tags.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// Poses in vain, for each frame that is wanted, before giving up.
constexpr size_t kMostInVain = 6;

// So much later at most the robot is told to stop.
constexpr absl::Duration kGuardPeriod = absl::Milliseconds(10);

absl::Status WriteImages(const std::string& folder, const std::string& frame,
                         const std::vector<std::string>& views,
                         const std::vector<CameraImage>& images) {
  for (size_t v = 0; v < views.size(); ++v) {
    const fs::path place = fs::path(folder) / "images" / views[v];
    std::error_code error;
    fs::create_directories(place, error);
    const CameraImage& image = images[v];
    RETURN_IF_ERROR(
        WritePng((place / (frame + ".png")).string(),
                 PictureOfPixels(image.width, image.height, image.channels, image.pixels)));
  }
  return absl::OkStatus();
}

cv::Mat RunSessionMatOf(CameraImage& image) {
  return {image.height, image.width, image.channels == 1 ? CV_8UC1 : CV_8UC3, image.pixels.data()};
}

// A robot at work: knows its grid joints for the forbidden regions.
class Recorder {
 public:
  Recorder(const Cell& cell, const RobotModel& robot, const SessionSettings& settings,
           Robot& driver, CameraRig& cameras)
      : cell_(cell),
        robot_(robot),
        settings_(settings),
        driver_(driver),
        cameras_(cameras),
        detector_(FamiliesOf(settings.boards)),
        flange_board_(
            std::find_if(settings.boards.begin(), settings.boards.end(), [&](const Board& board) {
              return board.description().name == settings.flange_board;
            })) {}

  // Where the robot stands, in the order of the model's joints.
  absl::StatusOr<PosePlan::Positions> Measure() {
    ASSIGN_OR_RETURN(const RobotState state, driver_.State());
    if (state.moving) return absl::AbortedError("the robot moves though it has arrived");
    return robot_.Positions(driver_.joints(), state.positions);
  }

  absl::Status MoveTo(const PosePlan::Positions& positions) {
    std::vector<double> ordered;
    for (const std::string& name : driver_.joints()) {
      const std::optional<size_t> joint = robot_.JointIndex(name);
      if (!joint) {
        return absl::InvalidArgumentError(
            absl::StrCat("the robot's joint '", name, "' is not in its model"));
      }
      ordered.push_back(positions[*joint]);
    }
    const std::jthread guard([this](const std::stop_token& arrived) { StopIfAsked(arrived); });
    absl::Status moved = driver_.MoveTo(ordered);
    absl::SleepFor(cell_.capture.settle);
    return moved;
  }

  // Takes images and finds tags. The views that see the flange's board; empty: nothing is added.
  absl::StatusOr<std::vector<std::string>> Look(const std::string& frame, SessionRecord& record) {
    ASSIGN_OR_RETURN(const PosePlan::Positions positions, Measure());
    ASSIGN_OR_RETURN(std::vector<CameraImage> images, cameras_.Grab());
    std::vector<TagSighting> sightings;
    std::vector<std::string> views;
    for (size_t v = 0; v < images.size(); ++v) {
      const std::string& view = cameras_.views()[v];
      const Lens lens = settings_.lenses.empty() ? Lens() : Lens(settings_.lenses[v]);
      const std::vector<TagSighting> found =
          TagsIn(RunSessionMatOf(images[v]), view, frame, settings_.boards, lens, detector_);
      sightings.insert(sightings.end(), found.begin(), found.end());
      const bool seen = std::any_of(found.begin(), found.end(), [&](const TagSighting& tag) {
        return flange_board_->description().family == tag.family && flange_board_->HasTag(tag.tag);
      });
      if (seen) views.push_back(view);
    }
    if (views.empty()) return views;
    absl::Status written = WriteImages(settings_.folder, frame, cameras_.views(), images);
    if (!written.ok()) return written;
    record.frames.push_back(frame);
    record.positions.push_back(positions);
    record.robot_poses.push_back(
        {.frame = frame, .base_from_flange = robot_.LinkPoses(positions)[settings_.flange]});
    record.sightings.insert(record.sightings.end(), sightings.begin(), sightings.end());
    written = WriteRecord(settings_.folder, robot_, record);
    if (!written.ok()) return written;
    return views;
  }

 private:
  // Stops the robot if the user asks for it before it has arrived. Tells it again and again, as it
  // may just be about to set off.
  void StopIfAsked(const std::stop_token& arrived) {
    bool complained = false;
    for (; !arrived.stop_requested(); absl::SleepFor(kGuardPeriod)) {
      const absl::Status stopped = StopRequested() ? driver_.Stop() : absl::OkStatus();
      if (stopped.ok() || complained) continue;
      std::cerr << "the robot could not be told to stop: " << stopped.message() << std::endl;
      complained = true;
    }
  }

  const Cell& cell_;
  const RobotModel& robot_;
  const SessionSettings& settings_;
  Robot& driver_;
  CameraRig& cameras_;
  TagDetector detector_;
  const std::vector<Board>::const_iterator flange_board_;
};

std::string FrameName(size_t number) { return absl::StrFormat("%04d", number); }

// Which views saw the flange's board in the frames of a record that is gone on with.
void TellPlan(const SessionRecord& record, PosePlan& plan) {
  for (size_t f = 0; f < record.frames.size(); ++f) {
    std::set<std::string> views;
    for (const TagSighting& sighting : record.sightings) {
      if (sighting.frame == record.frames[f]) views.insert(sighting.view);
    }
    plan.Tell(record.positions[f], std::vector<std::string>(views.begin(), views.end()));
  }
}

}  // namespace

std::optional<std::string> InTheWay(const Cell& cell, const RobotModel& robot,
                                    const SessionSettings& settings,
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
  // Half of the board's diagonal: however it is mounted, it does not reach farther down.
  double reach = 0;
  for (const Board& board : settings.boards) {
    if (board.description().name != settings.flange_board) continue;
    const int last = board.description().first_id + board.tags() - 1;
    reach =
        (board.CornersOf(last)[1] - board.CornersOf(board.description().first_id)[3]).norm() / 2;
  }
  const std::vector<Eigen::Isometry3d> links = robot.LinkPoses(to);
  for (size_t i = 0; i < links.size(); ++i) {
    if (robot.links()[i].parent < 0) continue;
    const double below = links[i].translation().z() - (i == settings.flange ? reach : 0);
    if (below < settings.floor) return "the floor";
  }
  return std::nullopt;
}

absl::Status RecordSession(const Cell& cell, const RobotModel& robot,
                           const SessionSettings& settings, Robot& driver, CameraRig& cameras,
                           SessionRecord& record) {
  Recorder recorder(cell, robot, settings, driver, cameras);
  PosePlan plan(robot, settings.flange, settings.rest, settings.joints, settings.seed);
  TellPlan(record, plan);
  const bool listed = !settings.given.empty();
  const size_t wanted = listed ? settings.given.size() : settings.frames;
  Progress progress("taking images", wanted, listed ? "poses" : "frames");
  std::map<std::string, int> seen;
  size_t in_vain = 0;
  // Listed poses keep their numbers: a frame is the line of the list.
  size_t next = listed && !record.frames.empty() ? std::stoul(record.frames.back()) : 0;
  while (listed ? next < wanted : record.frames.size() < wanted) {
    if (StopRequested()) return absl::CancelledError("stopped");
    ASSIGN_OR_RETURN(const PosePlan::Positions here, recorder.Measure());
    std::optional<PosePlan::Positions> goal;
    if (listed) {
      goal = settings.given[next];
      if (const auto obstacle = InTheWay(cell, robot, settings, here, *goal)) {
        return absl::FailedPreconditionError(
            absl::StrCat("pose ", next + 1, " of the list: ", *obstacle, " is in the way"));
      }
    } else {
      goal = plan.Next([&](const PosePlan::Positions& to) {
        return !InTheWay(cell, robot, settings, here, to);
      });
      if (!goal) {
        return absl::FailedPreconditionError(
            "there is no pose that the robot may be driven to; give its joints more room "
            "(--joint), or the poses (--poses)");
      }
    }
    ++next;
    if (absl::Status moved = recorder.MoveTo(*goal); !moved.ok()) {
      return StopRequested() ? absl::CancelledError("stopped") : moved;
    }
    const std::string frame = FrameName(listed ? next : record.frames.size() + 1);
    ASSIGN_OR_RETURN(const auto views, recorder.Look(frame, record));
    plan.Tell(*goal, views);
    for (const std::string& view : views) ++seen[view];
    in_vain += views.empty() ? 1 : 0;
    if (!listed && in_vain > kMostInVain * wanted) {
      return absl::FailedPreconditionError(
          absl::StrCat("the board '", settings.flange_board, "' was seen in ", record.frames.size(),
                       " of ", record.frames.size() + in_vain,
                       " poses only; is it on the flange, and large enough in the images?"));
    }
    progress.Update(listed ? next : record.frames.size());
  }
  return absl::OkStatus();
}

}  // namespace silhouette
