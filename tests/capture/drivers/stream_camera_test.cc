// SPDX-License-Identifier: Apache-2.0
// A camera that sends images all the time, with a stream of the test's own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/opencv/image_stream.h"
#include "tests/capture/drivers/robot_places.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

// Its images come every few milliseconds, without times.
class FakeStream : public ImageStream {
 public:
  struct Hooks {
    std::function<bool()> grab = [] { return true; };
    std::function<cv::Mat()> retrieve = [] { return cv::Mat(1, 1, CV_8UC1, cv::Scalar(0)); };
  };
  explicit FakeStream(Hooks hooks) : hooks_(std::move(hooks)) {}

  absl::Status Open() override { return absl::OkStatus(); }
  void Close() override {}
  bool Grab() override {
    absl::SleepFor(absl::Milliseconds(2));
    return hooks_.grab();
  }
  std::optional<absl::Duration> sent() const override { return std::nullopt; }
  cv::Mat Retrieve() override { return hooks_.retrieve(); }

 private:
  const Hooks hooks_;
};

std::unique_ptr<CameraSource> Open(FakeStream::Hooks hooks,
                                   absl::Duration timeout = absl::Seconds(20)) {
  return *OpenStreamCamera("top", std::make_unique<FakeStream>(std::move(hooks)), "",
                           absl::ZeroDuration(), timeout);
}

absl::Status Take(CameraSource& camera, absl::Duration timeout) {
  if (absl::Status status = camera.Trigger(); !status.ok()) return status;
  return camera.Wait(RunningNow() + timeout).status();
}

TEST(StreamCamera, ImageThatIsDecodedWhileAnotherIsAskedForIsNotTheAnswer) {
  std::promise<void> begun;
  std::promise<void> asked_again;
  std::atomic<int> decoded = 0;
  const auto camera = Open({.retrieve = [&] {
    const int number = ++decoded;
    if (number == 1) {
      begun.set_value();
      asked_again.get_future().wait();
    }
    return cv::Mat(1, 1, CV_8UC1, cv::Scalar(number));
  }});
  EXPECT_EQ(camera->Trigger(), absl::OkStatus());
  begun.get_future().wait();
  EXPECT_TRUE(absl::IsDeadlineExceeded(camera->Wait(RunningNow()).status()));
  const absl::Time before = absl::Now();
  EXPECT_EQ(camera->Trigger(), absl::OkStatus());
  asked_again.set_value();
  auto images = camera->Wait(RunningNow() + camera->timeout());
  ASSERT_TRUE(images.ok()) << images.status();
  EXPECT_EQ(images->front()->pixels[0], 2);
  EXPECT_GE(images->front()->captured, before);
}

TEST(StreamCamera, ImagesThatCannotBeReadAreTheReason) {
  std::atomic<bool> readable = false;
  std::atomic<int> decoded = 0;
  const auto camera = Open({.retrieve = [&] {
    ++decoded;
    return readable ? cv::Mat(1, 1, CV_8UC1, cv::Scalar(0)) : cv::Mat();
  }});
  ASSERT_EQ(camera->Trigger(), absl::OkStatus());
  ASSERT_TRUE(Eventually([&] { return decoded > 1; }));
  const absl::Status status = camera->Wait(RunningNow()).status();
  EXPECT_TRUE(absl::IsDeadlineExceeded(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("no image within 20 s: those that came cannot be read"));
  readable = true;
  EXPECT_EQ(Take(*camera, camera->timeout()), absl::OkStatus());
}

TEST(StreamCamera, StreamThatStallsDoesNotEnd) {
  constexpr absl::Duration kSilence = absl::Milliseconds(100);
  for (const bool stalls : {true, false}) {
    std::atomic<bool> fails = false;
    const auto camera = Open({.grab =
                                  [&] {
                                    if (!fails) return true;
                                    if (stalls) absl::SleepFor(2 * kSilence);
                                    return false;
                                  }},
                             stalls ? kSilence : absl::Seconds(20));
    fails = true;
    absl::Status status;
    ASSERT_TRUE(Eventually([&] {
      status = Take(*camera, kSilence);
      return absl::IsUnavailable(status);
    })) << status;
    EXPECT_THAT(status.message(), HasSubstr(stalls ? "no image came in time" : "its images ended"));
  }
}

}  // namespace
}  // namespace silhouette
