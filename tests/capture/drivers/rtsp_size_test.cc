// SPDX-License-Identifier: Apache-2.0
// An RTSP camera whose images change their size or come damaged while it streams.
#include <gmock/gmock.h>
#include <gst/rtsp-server/rtsp-server.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/opencv/opencv_camera.h"

namespace silhouette {
namespace {

// White, red and blue images of three sizes.
constexpr char kThreeSizes[] =
    "( input-selector name=size sync-streams=false ! videoconvert ! jpegenc name=coder"
    " ! rtpjpegpay name=pay0 pt=26"
    " videotestsrc is-live=true pattern=white"
    " ! video/x-raw,format=I420,width=320,height=240,framerate=10/1 ! size.sink_0"
    " videotestsrc is-live=true pattern=red"
    " ! video/x-raw,format=I420,width=160,height=120,framerate=10/1 ! size.sink_1"
    " videotestsrc is-live=true pattern=blue"
    " ! video/x-raw,format=I420,width=480,height=240,framerate=10/1 ! size.sink_2 )";
constexpr std::array<int, 3> kWidths = {320, 160, 480};
constexpr std::array<int, 3> kHeights = {240, 120, 240};
constexpr std::array<std::array<int, 3>, 3> kColours = {
    {{255, 255, 255}, {0, 0, 255}, {255, 0, 0}}};

class ChangingCamera {
 public:
  ChangingCamera() {
    gst_init(nullptr, nullptr);
    context_ = g_main_context_new();
    loop_ = g_main_loop_new(context_, FALSE);
    server_ = gst_rtsp_server_new();
    gst_rtsp_server_set_address(server_, "127.0.0.1");
    gst_rtsp_server_set_service(server_, "0");
    GstRTSPMediaFactory* factory = gst_rtsp_media_factory_new();
    gst_rtsp_media_factory_set_launch(factory, kThreeSizes);
    gst_rtsp_media_factory_set_shared(factory, TRUE);
    g_signal_connect(factory, "media-configure", G_CALLBACK(Configured), this);
    GstRTSPMountPoints* places = gst_rtsp_server_get_mount_points(server_);
    gst_rtsp_mount_points_add_factory(places, "/camera", factory);
    g_object_unref(places);
    gst_rtsp_server_attach(server_, context_);
    thread_ = std::thread([this] { g_main_loop_run(loop_); });
  }
  ~ChangingCamera() {
    g_main_loop_quit(loop_);
    thread_.join();
    if (GstElement* selector = selector_) gst_object_unref(selector);
    g_object_unref(server_);
    g_main_loop_unref(loop_);
    g_main_context_unref(context_);
  }
  ChangingCamera(const ChangingCamera&) = delete;
  ChangingCamera& operator=(const ChangingCamera&) = delete;

  std::string url() const {
    return absl::StrCat("rtsp://127.0.0.1:", gst_rtsp_server_get_bound_port(server_), "/camera");
  }

  // Once it streams.
  void Show(int size) {
    GstPad* pad = gst_element_get_static_pad(selector_, absl::StrCat("sink_", size).c_str());
    g_object_set(selector_, "active-pad", pad, nullptr);
    gst_object_unref(pad);
  }

  // From now on images lack their lower half, or no more.
  void Damage(bool damage) { damage_ = damage; }

 private:
  static void Configured(GstRTSPMediaFactory*, GstRTSPMedia* media, gpointer data) {
    GstElement* element = gst_rtsp_media_get_element(media);
    auto* camera = static_cast<ChangingCamera*>(data);
    camera->selector_ = gst_bin_get_by_name_recurse_up(GST_BIN(element), "size");
    GstElement* coder = gst_bin_get_by_name_recurse_up(GST_BIN(element), "coder");
    GstPad* coded = gst_element_get_static_pad(coder, "src");
    gst_pad_add_probe(coded, GST_PAD_PROBE_TYPE_BUFFER, CutOff, camera, nullptr);
    gst_object_unref(coded);
    gst_object_unref(coder);
    gst_object_unref(element);
  }

  static GstPadProbeReturn CutOff(GstPad*, GstPadProbeInfo* info, gpointer data) {
    if (static_cast<ChangingCamera*>(data)->damage_) {
      GstBuffer* image = gst_buffer_make_writable(GST_PAD_PROBE_INFO_BUFFER(info));
      constexpr gsize kHeader = 623;
      gst_buffer_set_size(image, static_cast<gssize>((kHeader + gst_buffer_get_size(image)) / 2));
      GST_PAD_PROBE_INFO_DATA(info) = image;
    }
    return GST_PAD_PROBE_OK;
  }

  GMainContext* context_;
  GMainLoop* loop_;
  GstRTSPServer* server_;
  std::atomic<GstElement*> selector_ = nullptr;
  std::atomic<bool> damage_ = false;
  std::thread thread_;
};

absl::StatusOr<CameraImage> TakeOne(CameraSource& camera) {
  if (const absl::Status status = camera.Trigger(); !status.ok()) return status;
  auto images = camera.Wait(RunningNow() + camera.timeout());
  if (!images.ok()) return images.status();
  return std::move(images->front());
}

// All of it is the image, and nothing of others.
void ExpectColour(const CameraImage& image, int size) {
  int most_off = 0;
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    most_off = std::max(most_off, std::abs(image.pixels[i] - kColours[size][i % 3]));
  }
  EXPECT_LT(most_off, 60) << "JPEG and the reduced range of video";
}

TEST(RtspSize, ImagesHaveTheSizeThatTheCameraSends) {
  ChangingCamera served;
  RtspSource source;
  source.url = served.url();
  source.timeout = absl::Seconds(60);
  const auto camera = OpenRtspCamera("top", source);
  ASSERT_TRUE(camera.ok()) << camera.status();
  for (const int size : {0, 1, 0, 2, 1, 2, 0}) {
    SCOPED_TRACE(size);
    served.Show(size);
    absl::StatusOr<CameraImage> image;
    const absl::Duration limit = RunningNow() + absl::Minutes(2);
    do {
      image = TakeOne(**camera);
      ASSERT_TRUE(image.ok()) << image.status() << ": the stream goes on";
    } while (image->width != kWidths[size] && RunningNow() < limit);
    ASSERT_EQ(image->width, kWidths[size]);
    ASSERT_EQ(image->height, kHeights[size]);
    ASSERT_EQ(image->pixels.size(), 3u * image->width * image->height);
    ExpectColour(*image, size);
  }
}

TEST(RtspDamage, DamagedImagesAreNotTakenAndWholeOnesComeAgain) {
  ChangingCamera served;
  RtspSource source;
  source.url = served.url();
  source.timeout = absl::Seconds(5);
  const auto camera = OpenRtspCamera("top", source);
  ASSERT_TRUE(camera.ok()) << camera.status();
  served.Show(1);
  absl::StatusOr<CameraImage> image;
  for (const bool damage : {false, true, false}) {
    SCOPED_TRACE(damage);
    served.Damage(damage);
    const absl::Duration limit = RunningNow() + absl::Minutes(2);
    do {
      image = TakeOne(**camera);
      if (image.ok() && image->width == kWidths[1]) ExpectColour(*image, 1);
    } while (image.ok() == damage && RunningNow() < limit);
    ASSERT_EQ(image.ok(), !damage) << image.status();
  }
}

}  // namespace
}  // namespace silhouette
