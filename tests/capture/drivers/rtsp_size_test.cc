// SPDX-License-Identifier: Apache-2.0
// An RTSP camera that changes the size of its images while it streams.
#include <gmock/gmock.h>
#include <gst/rtsp-server/rtsp-server.h>
#include <gtest/gtest.h>

#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/opencv/opencv_camera.h"

namespace silhouette {
namespace {

// Five seconds of noise of 320 x 240, from then on of 160 x 120.
constexpr char kShrinking[] =
    "( concat name=all ! videoconvert ! jpegenc ! rtpjpegpay name=pay0 pt=26"
    " videotestsrc is-live=true num-buffers=50 pattern=snow"
    " ! video/x-raw,format=I420,width=320,height=240,framerate=10/1 ! all."
    " videotestsrc is-live=true pattern=snow"
    " ! video/x-raw,format=I420,width=160,height=120,framerate=10/1 ! all. )";

constexpr absl::Duration kPause = absl::Milliseconds(50);

class ShrinkingCamera {
 public:
  ShrinkingCamera() {
    gst_init(nullptr, nullptr);
    context_ = g_main_context_new();
    loop_ = g_main_loop_new(context_, FALSE);
    server_ = gst_rtsp_server_new();
    gst_rtsp_server_set_address(server_, "127.0.0.1");
    gst_rtsp_server_set_service(server_, "0");
    GstRTSPMediaFactory* factory = gst_rtsp_media_factory_new();
    gst_rtsp_media_factory_set_launch(factory, kShrinking);
    gst_rtsp_media_factory_set_shared(factory, TRUE);
    GstRTSPMountPoints* places = gst_rtsp_server_get_mount_points(server_);
    gst_rtsp_mount_points_add_factory(places, "/camera", factory);
    g_object_unref(places);
    gst_rtsp_server_attach(server_, context_);
    thread_ = std::thread([this] { g_main_loop_run(loop_); });
  }
  ~ShrinkingCamera() {
    g_main_loop_quit(loop_);
    thread_.join();
    g_object_unref(server_);
    g_main_loop_unref(loop_);
    g_main_context_unref(context_);
  }

  std::string url() const {
    return absl::StrCat("rtsp://127.0.0.1:", gst_rtsp_server_get_bound_port(server_), "/camera");
  }

 private:
  GMainContext* context_;
  GMainLoop* loop_;
  GstRTSPServer* server_;
  std::thread thread_;
};

TEST(RtspSize, ChangeBeforeTheFirstImageIsAskedForIsToldAndTheStreamOpenedAgain) {
  const ShrinkingCamera served;
  RtspSource source;
  source.url = served.url();
  source.timeout = absl::Seconds(30);
  const auto camera = OpenRtspCamera("top", source);
  ASSERT_TRUE(camera.ok()) << camera.status();
  absl::SleepFor(absl::Seconds(8));
  ASSERT_TRUE((*camera)->Trigger().ok());
  const absl::Status status = (*camera)->Wait(RunningNow() + source.timeout).status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(status.message(), testing::HasSubstr("have another size than before"));
  const absl::Duration limit = RunningNow() + absl::Minutes(2);
  while (!(*camera)->Trigger().ok() && RunningNow() < limit) absl::SleepFor(kPause);
  EXPECT_TRUE((*camera)->Wait(RunningNow() + source.timeout).ok()) << "it is opened again";
}

}  // namespace
}  // namespace silhouette
