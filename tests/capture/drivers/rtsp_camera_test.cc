// SPDX-License-Identifier: Apache-2.0
// RTSP streams of rendered images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "capture/sim/served/network_cameras.h"
#include "tests/capture/drivers/served_cell.h"

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
  const std::string url = cameras_->addresses()[0];
  const int port = std::stoi(url.substr(url.rfind(':') + 1));
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
