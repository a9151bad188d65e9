// SPDX-License-Identifier: Apache-2.0
#include "server/live/live_record.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/times/times.h"
#include "server/scene/scene.h"

namespace silhouette {

void LatencyRecord::Add(absl::Duration latency) {
  if (newest_.size() < kNewest) {
    newest_.push_back(latency);
  } else {
    newest_[count_ % kNewest] = latency;
  }
  ++count_;
  sum_ += latency;
  for (size_t i = 0; i < kBounds.size(); ++i) {
    if (latency <= absl::Seconds(kBounds[i])) ++within_[i];
  }
}

LatencyFigures LatencyRecord::Figures() const {
  LatencyFigures figures{.count = count_,
                         .sum = sum_,
                         .within = {within_.begin(), within_.end()},
                         .median = {},
                         .p99 = {},
                         .longest = {}};
  if (newest_.empty()) return figures;
  std::vector<absl::Duration> sorted = newest_;
  std::ranges::sort(sorted);
  // The least that this share of all does not exceed.
  const auto quantile = [&](size_t percent) {
    return sorted[(sorted.size() * percent + 99) / 100 - 1];
  };
  figures.median = quantile(50);
  figures.p99 = quantile(99);
  figures.longest = sorted.back();
  return figures;
}

namespace {

std::string Spoken(const LatencyFigures& figures) {
  if (figures.count == 0) return "none yet";
  return absl::StrFormat("median %.1f ms, 99 of 100 within %.1f ms",
                         absl::ToDoubleMilliseconds(figures.median),
                         absl::ToDoubleMilliseconds(figures.p99));
}

std::string Aged(absl::Duration age) { return SpokenTime(absl::Trunc(age, absl::Milliseconds(1))); }

// `view`: empty for the robot.
std::string TitleOf(const std::string& view) {
  return view.empty() ? "robot" : absl::StrCat("camera '", view, "'");
}

}  // namespace

std::string JpegOf(const CameraImage& image, int widest) {
  constexpr int kQuality = 75;
  const cv::Mat pixels(image.height, image.width, image.channels == 3 ? CV_8UC3 : CV_8UC1,
                       const_cast<uint8_t*>(image.pixels.data()));
  cv::Mat small = pixels;
  if (pixels.cols > widest) {
    const double scale = static_cast<double>(widest) / pixels.cols;
    cv::resize(pixels, small, {}, scale, scale, cv::INTER_AREA);
  }
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return {bytes.begin(), bytes.end()};
}

std::string Spoken(const LiveStatus& status) {
  std::string text = absl::StrCat(status.scenes, " scenes, ", status.lost_sets,
                                  " lost sets of images; from the last pixel to the scene: ",
                                  Spoken(status.to_scene), "; to the map: ", Spoken(status.to_map));
  if (!status.serving) absl::StrAppend(&text, "; ", FaultsOf(status));
  return text;
}

std::string FaultsOf(const LiveStatus& status) {
  const auto why = [](const DeviceStatus& device, const char* gives) {
    return !device.fault.empty() ? device.fault
           : device.age ? absl::StrCat("the last ", gives, " came ", Aged(*device.age), " ago")
                        : absl::StrCat("no ", gives, " yet");
  };
  Failing cameras;
  for (const DeviceStatus& camera : status.cameras) {
    if (!camera.serving) cameras.Add(camera.name, why(camera, "image"));
  }
  std::vector<std::string> faults;
  for (const Failing::Group& group : cameras.groups()) {
    faults.push_back(
        absl::StrCat(group.Named("camera"),
                     group.several() ? " do not serve: " : " does not serve: ", group.why));
  }
  if (!status.robot.serving) {
    faults.push_back(absl::StrCat("robot does not serve: ", why(status.robot, "joint values")));
  }
  if (!faults.empty()) return absl::StrJoin(faults, "; ");
  return status.fault.empty() ? "the next scene is not ready" : status.fault;
}

LiveRecord::LiveRecord(const std::vector<std::string>& views, absl::Duration max_age, Clock clock,
                       KnownVariant known_variant)
    : max_age_(max_age), clock_(std::move(clock)), known_variant_(std::move(known_variant)) {
  status_.started = clock_().time;
  for (const std::string& view : views) cameras_.emplace_back().status.name = view;
}

void LiveRecord::Say(StatusLog& log, const std::string& what, const absl::Status& status,
                     const Moment& now) {
  std::set<absl::StatusCode> faults;
  if (!status.ok()) faults.insert(status.code());
  switch (log.Note(faults, now.running)) {
    case StatusLog::News::kNone:
      return;
    case StatusLog::News::kFault:
      spdlog::warn("{}: {}", what, std::string(status.message()));
      return;
    case StatusLog::News::kRecovered:
      spdlog::info("{} is good again", what);
  }
}

void LiveRecord::NoteGood(Device& device, const Moment& taken, const Moment& arrived) {
  ++device.status.good;
  device.status.last = taken.time;
  device.status.fault.clear();
  // A stamp of a clock that is ahead makes nothing younger than its arrival.
  device.taken = std::min(taken.running, arrived.running);
  Say(device.log, TitleOf(device.status.name), absl::OkStatus(), arrived);
}

void LiveRecord::NoteError(Device& device, const absl::Status& error) {
  const Moment now = clock_();
  ++device.status.errors;
  device.status.fault = device.status.last_error = std::string(error.message());
  device.status.last_error_time = now.time;
  Say(device.log, TitleOf(device.status.name), error, now);
}

void LiveRecord::NoteImage(size_t view, const Moment& taken, const Moment& arrived) {
  const std::lock_guard lock(mutex_);
  NoteGood(cameras_[view], taken, arrived);
}

void LiveRecord::NoteImageError(size_t view, const absl::Status& error) {
  const std::lock_guard lock(mutex_);
  NoteError(cameras_[view], error);
}

void LiveRecord::NoteJoints(const Moment& answered) {
  const std::lock_guard lock(mutex_);
  NoteGood(robot_, answered, answered);
}

void LiveRecord::NoteJointsError(const absl::Status& error) {
  const std::lock_guard lock(mutex_);
  NoteError(robot_, error);
}

void LiveRecord::NoteJoined(const absl::Status& status) {
  const std::lock_guard lock(mutex_);
  without_joints_ = std::string(status.message());
  // A robot that moves is no fault.
  const bool moves = absl::IsAborted(status);
  Say(join_log_, "scenes without joints", moves ? absl::OkStatus() : status, clock_());
}

void LiveRecord::NoteMasks(const Moment& arrived) {
  const std::lock_guard lock(mutex_);
  to_masks_.Add(clock_().running - arrived.running);
}

void LiveRecord::NoteScene(const Moment& arrived) {
  const std::lock_guard lock(mutex_);
  const Moment now = clock_();
  to_scene_.Add(now.running - arrived.running);
  ++status_.scenes;
  status_.fault.clear();
  Say(set_log_, "acquisition", absl::OkStatus(), now);
}

void LiveRecord::NoteLostSet(const absl::Status& error) {
  const std::lock_guard lock(mutex_);
  ++status_.lost_sets;
  status_.fault = std::string(error.message());
  Say(set_log_, "acquisition", error, clock_());
}

void LiveRecord::KeepImages() {
  const std::lock_guard lock(mutex_);
  keeps_images_ = true;
}

void LiveRecord::NoteImages(LiveImages images) {
  auto kept = std::make_shared<const LiveImages>(std::move(images));
  const std::lock_guard lock(mutex_);
  if (keeps_images_) images_.swap(kept);
}

std::shared_ptr<const LiveImages> LiveRecord::images() const {
  const std::lock_guard lock(mutex_);
  return images_;
}

void LiveRecord::NoteMap(const Moment& arrived) {
  const std::lock_guard lock(mutex_);
  to_map_.Add(clock_().running - arrived.running);
}

bool LiveRecord::TellVariant(const std::string& variant, absl::Duration now) {
  const std::lock_guard lock(mutex_);
  return known_variant_.Tell(variant, now);
}

bool LiveRecord::TellVariantChanging() {
  const std::lock_guard lock(mutex_);
  return known_variant_.TellChanging();
}

void LiveRecord::NoteVariants(const std::vector<std::string>& variants) {
  const std::lock_guard lock(mutex_);
  known_variant_.NoteVariants(variants);
}

KnownVariant LiveRecord::known_variant() const {
  const std::lock_guard lock(mutex_);
  return known_variant_;
}

DeviceStatus LiveRecord::StatusOf(const Device& device, const Moment& now) const {
  DeviceStatus status = device.status;
  if (status.last) {
    status.age = now.running - device.taken;
    status.serving = *status.age <= max_age_;
  }
  return status;
}

LiveStatus LiveRecord::WithoutLatencies() const {
  const Moment now = clock_();
  LiveStatus status = status_;
  for (const Device& camera : cameras_) status.cameras.push_back(StatusOf(camera, now));
  status.robot = StatusOf(robot_, now);
  if (status.robot.fault.empty()) status.robot.fault = without_joints_;
  status.serving = status.robot.serving &&
                   std::ranges::all_of(status.cameras, [](const auto& c) { return c.serving; });
  return status;
}

LiveStatus LiveRecord::StatusOfDevices() const {
  const std::lock_guard lock(mutex_);
  return WithoutLatencies();
}

LiveStatus LiveRecord::Status() const {
  const std::lock_guard lock(mutex_);
  LiveStatus status = WithoutLatencies();
  status.to_masks = to_masks_.Figures();
  status.to_scene = to_scene_.Figures();
  status.to_map = to_map_.Figures();
  return status;
}

}  // namespace silhouette
