// SPDX-License-Identifier: Apache-2.0
// V4L2 cameras and RTSP streams: devices that send images all the time.
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <future>
#include <mutex>
#include <opencv2/videoio.hpp>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "capture/devices/lateness.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/opencv/image_stream.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "capture/drivers/opencv/rtsp_round_trip.h"
#include "capture/drivers/robots/tcp_socket.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// How much later than `latency` an image may be without being late.
constexpr absl::Duration kInTime = absl::Milliseconds(100);
// How long after its opening no image of a stream may count as in time (see Lateness).
constexpr absl::Duration kToSettle = absl::Seconds(2);
// Between two attempts to open a stream again.
constexpr std::chrono::milliseconds kReopenPause(500);
// Between two measurements of the round trip; a delay that sets in may be underestimated by a
// thousandth of it (see Lateness).
constexpr absl::Duration kMeasureAgain = absl::Seconds(30);
// An RTSP stream is opened by OPTIONS, DESCRIBE, SETUP and PLAY, one after the other's answer.
constexpr int kRoundTripsOfOpening = 4;

class StreamCamera : public CameraSource {
 public:
  // As OpenStreamCamera().
  StreamCamera(const std::string& view, std::unique_ptr<ImageStream> stream, const std::string& url,
               absl::Duration latency, absl::Duration timeout)
      : views_{view}, latency_(latency), timeout_(timeout), url_(url), stream_(std::move(stream)) {}

  // Once. Waits for the first image that counts, as long as it may take.
  absl::Status Start() {
    RETURN_IF_ERROR(OpenStream());
    reader_ = std::thread([this] { ReadAll(); });
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, absl::ToChronoNanoseconds(kToSettle + timeout_),
                      [&] { return settled_ || !wrong_.ok(); });
    return absl::OkStatus();
  }

  ~StreamCamera() override {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    if (reader_.joinable()) reader_.join();
  }

  const std::vector<std::string>& views() const override { return views_; }
  absl::Duration timeout() const override { return timeout_; }

  absl::Status Trigger() override {
    const std::lock_guard lock(mutex_);
    if (!wrong_.ok()) return wrong_;
    asked_ = RunningNow();
    image_.reset();
    unreadable_ = false;
    return absl::OkStatus();
  }

  absl::StatusOr<EachImage> Wait(absl::Duration deadline) override {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, absl::ToChronoNanoseconds(deadline - RunningNow()),
                      [&] { return image_.has_value() || !wrong_.ok(); });
    asked_.reset();
    if (!wrong_.ok()) return wrong_;
    if (!image_) {
      return absl::DeadlineExceededError(absl::StrCat(
          "no image within ", SpokenTime(timeout_),
          unreadable_ ? ": those that came cannot be read; set the camera to another format" : ""));
    }
    EachImage images;
    images.emplace_back(*std::exchange(image_, std::nullopt));
    return images;
  }

 private:
  void ReadAll() {
    while (!stopping()) {
      const absl::string_view wrong = Read();
      if (!wrong.empty()) Reopen(wrong);
    }
  }

  // Reads one image. Why the stream must be opened again; empty: it need not.
  absl::string_view Read() {
    if (!MeasureAgain()) return "its host does not answer";
    const absl::Duration begin = RunningNow();
    if (!stream_->Grab()) {
      return RunningNow() - begin < timeout_ ? "its images ended" : "no image came in time";
    }
    const absl::Time arrived = absl::Now();
    const absl::Duration now = RunningNow();
    if (stream_->damaged()) return now - in_time_ > timeout_ ? "its images come damaged" : "";
    const absl::Duration held_up = HeldUp(now);
    if (held_up <= latency_ + kInTime) {
      in_time_ = now;
      Settle();
    } else if (now - in_time_ > timeout_) {
      return "its images come late";
    }
    const absl::Duration age = latency_ + held_up + round_trip_;
    if (Wanted(now - age)) HandOut(stream_->Retrieve(), now - age, arrived - age);
    return "";
  }

  // If `image` is still wanted: while it was decoded another may have been asked for.
  void HandOut(const cv::Mat& image, absl::Duration taken, absl::Time captured) {
    const std::lock_guard lock(mutex_);
    if (!WantedLocked(taken)) return;
    unreadable_ = image.empty();
    if (unreadable_) return;
    image_ = CameraImageOf(image, captured);
    changed_.notify_all();
  }

  bool stopping() {
    const std::lock_guard lock(mutex_);
    return stopping_;
  }

  // How much longer than the quickest the image that was read last was held up: 0 if the stream has
  // no times, infinite if that is not known yet.
  absl::Duration HeldUp(absl::Duration now) {
    const std::optional<absl::Duration> sent = stream_->sent();
    if (!sent) return absl::ZeroDuration();
    const absl::Duration late = lateness_.Of(*sent, now);
    return lateness_.settled() ? late : absl::InfiniteDuration();
  }

  // Whether an image that was taken at `taken` or later is the one that is waited for.
  bool Wanted(absl::Duration taken) {
    const std::lock_guard lock(mutex_);
    return WantedLocked(taken);
  }
  // With mutex_ held.
  bool WantedLocked(absl::Duration taken) const { return asked_ && !image_ && taken >= *asked_; }

  void Reopen(absl::string_view why) {
    Tell(absl::UnavailableError(absl::StrCat(why, "; it is being opened again")));
    stream_->Close();
    for (;;) {
      const absl::Status status = OpenStream();
      if (status.ok()) break;
      Tell(status);
      std::unique_lock lock(mutex_);
      if (changed_.wait_for(lock, kReopenPause, [&] { return stopping_; })) return;
    }
  }

  // Its images are believed: it is open again.
  void Settle() {
    const std::lock_guard lock(mutex_);
    if (std::exchange(settled_, true)) return;
    wrong_ = absl::OkStatus();
    changed_.notify_all();
  }

  absl::Status OpenStream() {
    const absl::Duration begin = RunningNow();
    RETURN_IF_ERROR(stream_->Open());
    const absl::Duration opened = RunningNow();
    lateness_ = {};
    in_time_ = opened + kToSettle;
    measuring_ = {};
    measure_at_ = absl::InfiniteDuration();
    round_trip_ = absl::ZeroDuration();
    if (!url_.empty() && !TakeRoundTrip(RtspRoundTrip(url_, timeout_))) {
      round_trip_ = (opened - begin) / kRoundTripsOfOpening;
    }
    return absl::OkStatus();
  }

  // Lateness counts from the quickest image of this stream, which no clock tells the delay of: it
  // was no more than a round trip at a time when the stream is open.
  bool TakeRoundTrip(std::optional<absl::Duration> measured) {
    if (!measured) return false;
    round_trip_ = *measured;
    measure_at_ = RunningNow() + kMeasureAgain;
    return true;
  }

  // When it is time, while images are read. False: there was no answer.
  bool MeasureAgain() {
    if (measuring_.valid()) {
      if (measuring_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return true;
      return TakeRoundTrip(measuring_.get());
    }
    if (RunningNow() > measure_at_) {
      measuring_ = std::async(std::launch::async, RtspRoundTrip, url_, timeout_);
    }
    return true;
  }

  // Why there are no images, until one is believed again.
  void Tell(const absl::Status& status) {
    const std::lock_guard lock(mutex_);
    wrong_ = status;
    settled_ = false;
    changed_.notify_all();
  }

  const std::vector<std::string> views_;
  const absl::Duration latency_;
  const absl::Duration timeout_;
  const std::string url_;

  // Of the reader alone, once it runs.
  Lateness lateness_;
  absl::Duration round_trip_;
  std::future<std::optional<absl::Duration>> measuring_;
  absl::Duration measure_at_;              // infinite: never, it cannot be measured
  absl::Duration in_time_ = RunningNow();  // when the last image came whole and not late
  const std::unique_ptr<ImageStream> stream_;

  std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  bool stopping_ = false;
  bool settled_ = false;                 // an image came that is believed
  absl::Status wrong_;                   // why there are no images just now
  std::optional<absl::Duration> asked_;  // since when an image is waited for
  std::optional<CameraImage> image_;
  bool unreadable_ = false;  // an image that was waited for came and cannot be read

  std::thread reader_;  // last: it uses all the others
};

// OpenCV does not know this control; a camera may lack it.
void SwitchAutomaticGainOff(const std::string& device) {
  const FileDescriptor file(open(device.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  v4l2_control automatic{.id = V4L2_CID_AUTOGAIN, .value = 0};
  ioctl(file.get(), VIDIOC_S_CTRL, &automatic);
}

// Fixes exposure, gain and what else a camera may change by itself. Units: Linux, V4L2 controls;
// the exposure counts 100 us.
absl::Status FixExposure(cv::VideoCapture& camera, const V4l2Source& source) {
  const auto refused = [&](const auto&... what) {
    return absl::FailedPreconditionError(
        absl::StrCat(source.device, " ", what..., "; see v4l2-ctl --list-ctrls"));
  };
  camera.set(cv::CAP_PROP_AUTOFOCUS, 0);
  camera.set(cv::CAP_PROP_AUTO_WB, 0);
  SwitchAutomaticGainOff(source.device);
  camera.set(cv::CAP_PROP_AUTO_EXPOSURE, V4L2_EXPOSURE_MANUAL);
  const auto mode = static_cast<int>(camera.get(cv::CAP_PROP_AUTO_EXPOSURE));  // -1: it has none
  if (mode == V4L2_EXPOSURE_AUTO || mode == V4L2_EXPOSURE_APERTURE_PRIORITY) {
    return refused("does not switch its automatic exposure off");
  }
  if (source.exposure) {
    const double wanted = absl::ToDoubleMicroseconds(*source.exposure) / 100;
    if (!camera.set(cv::CAP_PROP_EXPOSURE, wanted)) {
      return refused("does not take the exposure ", SpokenTime(*source.exposure));
    }
    // A driver takes the nearest that is possible.
    const double taken = camera.get(cv::CAP_PROP_EXPOSURE);
    if (taken > 0 && std::abs(taken - wanted) > std::max(1.0, 0.1 * wanted)) {
      return refused("takes the exposure ", SpokenTime(absl::Microseconds(100 * taken)),
                     " instead of ", SpokenTime(*source.exposure));
    }
  }
  if (source.gain && !camera.set(cv::CAP_PROP_GAIN, *source.gain)) {
    return refused("does not take the gain ", *source.gain);
  }
  return absl::OkStatus();
}

absl::Status OpenDevice(cv::VideoCapture& camera, int width, int height, const V4l2Source& source) {
  if (!std::filesystem::exists(source.device)) {
    return absl::NotFoundError(absl::StrCat("there is no device ", source.device,
                                            "; 'ls /dev/video*' lists those there are"));
  }
  if (!camera.open(source.device, cv::CAP_V4L2)) {
    return absl::UnavailableError(absl::StrCat(
        source.device, " cannot be opened; does another program use it, and may you read it?"));
  }
  camera.set(cv::CAP_PROP_FRAME_WIDTH, width);
  camera.set(cv::CAP_PROP_FRAME_HEIGHT, height);
  const auto has_width = static_cast<int>(camera.get(cv::CAP_PROP_FRAME_WIDTH));
  const auto has_height = static_cast<int>(camera.get(cv::CAP_PROP_FRAME_HEIGHT));
  if (has_width != width || has_height != height) {
    return absl::FailedPreconditionError(absl::StrCat(source.device, " has no images of ", width,
                                                      " x ", height, "; it offers ", has_width,
                                                      " x ", has_height, " instead"));
  }
  return FixExposure(camera, source);
}

class V4l2Stream : public ImageStream {
 public:
  V4l2Stream(int width, int height, const V4l2Source& source)
      : width_(width), height_(height), source_(source) {}

  absl::Status Open() override { return OpenDevice(device_, width_, height_, source_); }
  void Close() override { device_.release(); }
  bool Grab() override { return device_.grab(); }

  std::optional<absl::Duration> sent() const override {
    const double sent = device_.get(cv::CAP_PROP_POS_MSEC);
    return sent > 0 ? std::optional(absl::Milliseconds(sent)) : std::nullopt;
  }

  cv::Mat Retrieve() override {
    try {
      cv::Mat image;
      if (device_.retrieve(image) && image.depth() == CV_8U) return image;
    } catch (const cv::Exception&) {  // of a damaged image
    }
    return {};
  }

 private:
  const int width_;
  const int height_;
  const V4l2Source source_;
  cv::VideoCapture device_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CameraSource>> OpenStreamCamera(const std::string& view,
                                                               std::unique_ptr<ImageStream> stream,
                                                               const std::string& url,
                                                               absl::Duration latency,
                                                               absl::Duration timeout) {
  auto camera = std::make_unique<StreamCamera>(view, std::move(stream), url, latency, timeout);
  RETURN_IF_ERROR(camera->Start());
  return camera;
}

absl::StatusOr<std::unique_ptr<CameraSource>> OpenV4l2Camera(const std::string& view, int width,
                                                             int height, const V4l2Source& source) {
  return OpenStreamCamera(view, std::make_unique<V4l2Stream>(width, height, source), "",
                          source.latency, source.timeout);
}

absl::StatusOr<std::unique_ptr<CameraSource>> OpenRtspCamera(const std::string& view,
                                                             const RtspSource& source) {
  return OpenStreamCamera(view, NetworkStream(source.url, source.timeout), source.url,
                          source.latency, source.timeout);
}

std::vector<V4l2Device> FindV4l2Devices() {
  namespace fs = std::filesystem;
  std::vector<V4l2Device> found;
  std::error_code error;
  for (fs::directory_iterator at("/sys/class/video4linux", error), end; !error && at != end;
       at.increment(error)) {
    const std::string node = at->path().filename().string();
    if (!node.starts_with("video")) continue;
    V4l2Device device{.device = "/dev/" + node, .name = ""};
    std::ifstream in(at->path() / "name");
    std::getline(in, device.name);
    found.push_back(std::move(device));
  }
  std::sort(found.begin(), found.end(), [](const V4l2Device& a, const V4l2Device& b) {
    return std::pair(a.device.size(), a.device) < std::pair(b.device.size(), b.device);
  });
  return found;
}

}  // namespace silhouette
