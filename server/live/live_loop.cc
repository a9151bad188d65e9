// SPDX-License-Identifier: Apache-2.0
#include "server/live/live_loop.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "capture/session/cell_robot.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Whether asking again may help.
bool MayRecover(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status);
}

absl::StatusOr<std::vector<size_t>> PlacesOf(const storage::v1::CellDescription& cell,
                                             const std::vector<std::string>& known) {
  std::vector<size_t> places;
  for (const storage::v1::View& view : cell.views()) {
    const auto place = std::ranges::find(known, view.name());
    if (place == known.end()) {
      return absl::InvalidArgumentError(absl::StrCat("there is no camera for the view '",
                                                     view.name(), "'; there are ",
                                                     absl::StrJoin(known, ", ")));
    }
    places.push_back(static_cast<size_t>(place - known.begin()));
  }
  return places;
}

absl::Status CheckVariant(const ServedDatabase& database, const std::string& variant) {
  if (variant.empty() || database.Variant(variant) != nullptr) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("server: live: variant: the database has no variant '", variant, "'; it has ",
                   absl::StrJoin(database.variants(), ", ")));
}

}  // namespace

LiveLoop::LiveLoop(const LiveConfig& config, LiveScenes scenes, std::shared_ptr<LiveRecord> record,
                   const storage::v1::CellDescription& cell)
    : config_(config),
      record_(record),
      cell_(cell),
      acquisition_(
          config, std::move(scenes),
          [this](absl::Duration first, absl::Duration last) {
            return joints_->Between(first, last);
          },
          std::move(record), cell) {}

absl::StatusOr<std::unique_ptr<LiveLoop>> LiveLoop::Start(const LiveConfig& config,
                                                          LiveDevices devices, LiveScenes scenes,
                                                          std::shared_ptr<LiveRecord> record) {
  const std::shared_ptr<const ServedDatabase> database = scenes.database();
  if (!database->has_references()) {
    return absl::FailedPreconditionError(
        "the database has no reference images to difference camera images with; take them with "
        "'silhouette-capture reference'");
  }
  RETURN_IF_ERROR(CheckVariant(*database, config.live.variant));
  std::unique_ptr<LiveLoop> loop(
      new LiveLoop(config, std::move(scenes), std::move(record), database->cell()));
  loop->open_cameras_ = std::move(devices.open_cameras);
  if (absl::Status opened = loop->OpenCameras(); !opened.ok()) {
    if (!MayRecover(opened)) return opened;
    loop->record_->NoteLostSet(opened);
  }
  absl::StatusOr<std::unique_ptr<Robot>> robot = devices.open_robot();
  if (robot.ok()) {
    RETURN_IF_ERROR(CellRobot::Create(loop->cell_, **robot).status());
  } else if (MayRecover(robot.status())) {
    loop->record_->NoteJointsError(robot.status());
    robot = nullptr;
  } else {
    return robot.status();
  }
  loop->joints_.emplace(loop->cell_, config.live, config.clock, std::move(devices.open_robot),
                        *std::move(robot), *loop->record_);
  loop->thread_ = std::jthread([&live = *loop](const std::stop_token& stop) { live.Run(stop); });
  return loop;
}

LiveLoop::~LiveLoop() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  thread_.join();
  spdlog::info("acquisition stopped: {}", Spoken(record_->Status()));
}

absl::Status LiveLoop::OpenCameras() {
  ASSIGN_OR_RETURN(std::unique_ptr<CameraRig> opened, open_cameras_());
  ASSIGN_OR_RETURN(std::vector<size_t> places, PlacesOf(cell_, opened->views()));
  cameras_ = std::move(opened);
  places_ = std::move(places);
  return absl::OkStatus();
}

void LiveLoop::Run(const std::stop_token& stop) {
  absl::Duration last_report = config_.clock().running;
  const auto take_set = [&] {
    const absl::Duration now = config_.clock().running;
    if (now - last_report >= config_.live.report_interval) {
      spdlog::info("acquisition: {}", Spoken(record_->Status()));
      last_report = now;
    }
    return TakeSet();
  };
  AskAgainAndAgain(
      stop, config_.clock, config_.live, config_.live.interval, take_set,
      [this](const absl::Status& error) { record_->NoteLostSet(error); },
      [this] { cameras_.reset(); });
}

absl::Status LiveLoop::TakeSet() {
  if (cameras_ == nullptr) {
    RETURN_IF_ERROR(OpenCameras());
  }
  GrabbedImages set{.images = {}, .asked = config_.clock(), .arrived = {}};
  std::vector<absl::StatusOr<CameraImage>> grabbed = cameras_->GrabEach();
  set.arrived = config_.clock();
  if (grabbed.size() != cameras_->views().size()) {
    return absl::InternalError(absl::StrCat("the cameras gave ", grabbed.size(), " images for ",
                                            cameras_->views().size(), " views"));
  }
  for (const size_t place : places_) set.images.push_back(std::move(grabbed[place]));
  return acquisition_.Take(std::move(set));
}

}  // namespace silhouette
