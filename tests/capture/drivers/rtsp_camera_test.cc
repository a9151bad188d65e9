// SPDX-License-Identifier: Apache-2.0
// RTSP streams of rendered images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "capture/drivers/opencv/rtsp_round_trip.h"
#include "capture/sim/served/network_cameras.h"
#include "tests/capture/drivers/served_cell.h"
#include "tests/capture/drivers/slow_network.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

// Mean difference of the brightness, in grey levels.
double Difference(const CameraImage& image, const CameraImage& truth) {
  const std::vector<uint8_t> pixels = GreyPixels(image);
  if (pixels.size() != truth.pixels.size()) return 255;
  double sum = 0;
  for (size_t i = 0; i < pixels.size(); ++i) sum += std::abs(pixels[i] - truth.pixels[i]);
  return sum / static_cast<double>(pixels.size());
}

class RtspCamera : public ServedCell {
 protected:
  void SetUp() override { Serve(0); }

  void Serve(int port) {
    cameras_.reset();
    auto cameras = ServeRtspCameras(*views_, port);
    ASSERT_TRUE(cameras.ok()) << cameras.status();
    cameras_ = *std::move(cameras);
  }

  RtspSource Top() const {
    RtspSource source;
    source.url = cameras_->addresses()[0];
    // On a busy machine images are long under way.
    source.latency = absl::Seconds(3);
    source.timeout = absl::Seconds(60);
    return source;
  }

  int Port() const {
    const std::string url = cameras_->addresses()[0];
    return std::stoi(url.substr(url.rfind(':') + 1));
  }

  static absl::StatusOr<CameraImage> Take(CameraSource& camera) {
    if (absl::Status status = camera.Trigger(); !status.ok()) return status;
    auto images = camera.Wait(RunningNow() + camera.timeout());
    if (!images.ok()) return images.status();
    return std::move(images->front());
  }

  // The present image of the first view.
  CameraImage Now() { return views_->TakeAll()[0]; }

  std::unique_ptr<NetworkCameras> cameras_;
};

TEST_F(RtspCamera, ShowsTheCellAsItIsAndNoBufferedImage) {
  const auto camera = OpenRtspCamera("top", Top());
  ASSERT_TRUE(camera.ok()) << camera.status();
  for (int i = 0; i < 2; ++i) {
    const CameraImage old = Now();
    Turn(0.8 * (i + 1));
    const absl::Time before = absl::Now();
    const auto image = Take(**camera);
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(image->width, kWidth);
    EXPECT_EQ(image->height, kHeight);
    EXPECT_GE(image->captured, before) << "the earliest moment at which it can have been taken";
    EXPECT_LE(image->captured, absl::Now() - Top().latency);
    const CameraImage truth = Now();
    EXPECT_LT(Difference(*image, truth), 1.5) << "JPEG";
    EXPECT_LT(Difference(*image, truth), Difference(*image, old) / 2);
  }
}

TEST_F(RtspCamera, StreamThatBreaksOffIsToldAndOpenedAgain) {
  const auto camera = OpenRtspCamera("top", Top());
  ASSERT_TRUE(camera.ok()) << camera.status();
  const int port = Port();
  cameras_.reset();
  absl::Status status;
  for (int i = 0; i < 20 && status.ok(); ++i) status = Take(**camera).status();
  EXPECT_TRUE(absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status)) << status;
  Serve(port);
  Turn(1);
  absl::StatusOr<CameraImage> image;
  const absl::Time deadline = absl::Now() + absl::Minutes(3);
  while (!image.ok() && absl::Now() < deadline) {
    image = Take(**camera);
    if (!image.ok()) absl::SleepFor(absl::Milliseconds(100));
  }
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_LT(Difference(*image, Now()), 1.5);
}

TEST_F(RtspCamera, DelayThatLastsIsNotForgottenWhenTheStreamIsOpenedAgain) {
  constexpr absl::Duration kDelay = absl::Milliseconds(700);
  constexpr absl::Duration kDrift = absl::Milliseconds(50);  // the clocks might run apart
  SlowNetwork network(Port());
  RtspSource source = Top();
  source.url = absl::StrCat("rtsp://127.0.0.1:", network.port(), "/top");
  source.latency = absl::Milliseconds(100);
  source.timeout = absl::Seconds(8);
  const auto camera = OpenRtspCamera("top", source);
  ASSERT_TRUE(camera.ok()) << camera.status();
  network.Delay(kDelay);
  absl::SleepFor(absl::Milliseconds(50));
  bool opened_again = false;
  int after = 0;
  const absl::Time end = absl::Now() + absl::Minutes(2);
  while (after < 5 && absl::Now() < end) {
    const auto image = Take(**camera);
    if (!image.ok()) {
      if (absl::IsUnavailable(image.status())) opened_again = true;
      absl::SleepFor(absl::Milliseconds(20));
      continue;
    }
    EXPECT_GE(absl::Now() - image->captured, kDelay + source.latency - kDrift) << opened_again;
    if (opened_again) ++after;
  }
  EXPECT_EQ(after, 5);
}

TEST_F(RtspCamera, RoundTripIsNoLessThanTheDelay) {
  SlowNetwork network(Port());
  const std::string place = absl::StrCat("127.0.0.1:", network.port(), "/top");
  ASSERT_TRUE(RtspRoundTrip("rtsp://" + place, absl::Seconds(30)).has_value());
  network.Delay(absl::Milliseconds(300));
  for (const std::string of_user : {"", "me:secret@"}) {
    const auto measured = RtspRoundTrip("rtsp://" + of_user + place, absl::Seconds(30));
    ASSERT_TRUE(measured.has_value());
    EXPECT_GE(*measured, absl::Milliseconds(300));
  }
  EXPECT_FALSE(RtspRoundTrip("rtsp://" + place, absl::Milliseconds(100)).has_value())
      << "no answer";
  EXPECT_FALSE(RtspRoundTrip("rtsps://" + place, absl::Seconds(30)).has_value()) << "encrypted";
}

TEST_F(RtspCamera, AddressWithoutAStreamIsToldWithoutThePassword) {
  RtspSource source = Top();
  source.url = absl::StrCat("rtsp://me:secret@", source.url.substr(7), "_of_another");
  const absl::Status status = OpenRtspCamera("top", source).status();
  EXPECT_TRUE(absl::IsUnavailable(status));
  EXPECT_THAT(status.message(), HasSubstr("no images come from rtsp://127.0.0.1:"));
  EXPECT_THAT(status.message(), testing::Not(HasSubstr("secret")));
}

}  // namespace
}  // namespace silhouette
