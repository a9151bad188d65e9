// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/served/network_cameras.h"

#include <gst/rtsp-server/rtsp-server.h>

#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr absl::Duration kFramePeriod = absl::Milliseconds(100);
// JPEG images over RTP are made of blocks of colour of 8 x 8 pixels at least.
constexpr char kPipeline[] =
    "( appsrc name=images is-live=true do-timestamp=true format=time"
    " ! videoconvert ! video/x-raw,format=I420 ! jpegenc quality=97"
    " ! rtpjpegpay name=pay0 pt=26 )";

struct RtspCamerasUnref {
  void operator()(gpointer object) const { g_object_unref(object); }
};

// What the threads of a stream need; they may outlive the server for a moment.
class Stream {
 public:
  Stream(ServedViews& views, size_t view)
      : width_(views.views()[view].image_width),
        height_(views.views()[view].image_height),
        views_(&views),
        view_(view) {}

  int width() const { return width_; }
  int height() const { return height_; }

  // The next image in grey, when it is its time; nothing: the stream has ended.
  std::optional<std::vector<uint8_t>> Next() {
    const std::lock_guard lock(mutex_);
    absl::SleepFor(last_ + kFramePeriod - absl::Now());
    last_ = absl::Now();
    if (views_ == nullptr) return std::nullopt;
    return GreyPixels(views_->Take(view_));
  }

  // From now on the views are not needed any more.
  void End() {
    const std::lock_guard lock(mutex_);
    views_ = nullptr;
  }

 private:
  const int width_;
  const int height_;
  std::mutex mutex_;  // guards all below
  ServedViews* views_;
  const size_t view_;
  absl::Time last_ = absl::InfinitePast();
};

using StreamHandle = std::shared_ptr<Stream>;

// Calls `callback` with a handle of its own on the signal.
void Connect(gpointer object, const char* signal, GCallback callback, const StreamHandle& stream) {
  g_signal_connect_data(
      object, signal, callback, new StreamHandle(stream),
      [](gpointer data, GClosure*) { delete static_cast<StreamHandle*>(data); }, GConnectFlags{});
}

// Called by a thread of the stream's whenever it has room for an image.
void PushImage(GstElement* source, guint /*bytes*/, gpointer data) {
  const auto pixels = (*static_cast<StreamHandle*>(data))->Next();
  GstFlowReturn result = GST_FLOW_OK;
  if (!pixels) {
    g_signal_emit_by_name(source, "end-of-stream", &result);
    return;
  }
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, pixels->size(), nullptr);
  gst_buffer_fill(buffer, 0, pixels->data(), pixels->size());
  g_signal_emit_by_name(source, "push-buffer", buffer, &result);
  gst_buffer_unref(buffer);
}

// Called when the first client has come and the stream is made.
void ConfigureStream(GstRTSPMediaFactory* /*factory*/, GstRTSPMedia* media, gpointer data) {
  const StreamHandle& stream = *static_cast<StreamHandle*>(data);
  GstElement* element = gst_rtsp_media_get_element(media);
  GstElement* source = gst_bin_get_by_name_recurse_up(GST_BIN(element), "images");
  GstCaps* format = gst_caps_new_simple(
      "video/x-raw", "format", G_TYPE_STRING, "GRAY8", "width", G_TYPE_INT, stream->width(),
      "height", G_TYPE_INT, stream->height(), "framerate", GST_TYPE_FRACTION, 0, 1, nullptr);
  g_object_set(source, "caps", format, nullptr);
  gst_caps_unref(format);
  Connect(source, "need-data", G_CALLBACK(PushImage), stream);
  gst_object_unref(source);
  gst_object_unref(element);
}

class RtspCameras : public NetworkCameras {
 public:
  RtspCameras()
      : context_(g_main_context_new()),
        loop_(g_main_loop_new(context_, FALSE)),
        server_(gst_rtsp_server_new()) {}

  ~RtspCameras() override {
    gst_rtsp_server_client_filter(
        server_.get(),
        [](GstRTSPServer*, GstRTSPClient*, gpointer) { return GST_RTSP_FILTER_REMOVE; }, nullptr);
    GstRTSPSessionPool* sessions = gst_rtsp_server_get_session_pool(server_.get());
    g_list_free_full(
        gst_rtsp_session_pool_filter(
            sessions,
            [](GstRTSPSessionPool*, GstRTSPSession*, gpointer) { return GST_RTSP_FILTER_REMOVE; },
            nullptr),
        g_object_unref);
    g_object_unref(sessions);
    g_main_loop_quit(loop_);
    if (thread_.joinable()) thread_.join();
    for (const StreamHandle& stream : streams_) stream->End();
    server_.reset();
    g_main_loop_unref(loop_);
    g_main_context_unref(context_);
  }

  absl::Status Run(ServedViews& views, int port) {
    gst_rtsp_server_set_address(server_.get(), "127.0.0.1");
    gst_rtsp_server_set_service(server_.get(), absl::StrCat(port).c_str());
    GstRTSPMountPoints* places = gst_rtsp_server_get_mount_points(server_.get());
    for (size_t v = 0; v < views.views().size(); ++v) {
      streams_.push_back(std::make_shared<Stream>(views, v));
      GstRTSPMediaFactory* factory = gst_rtsp_media_factory_new();
      gst_rtsp_media_factory_set_launch(factory, kPipeline);
      gst_rtsp_media_factory_set_shared(factory, TRUE);
      Connect(factory, "media-configure", G_CALLBACK(ConfigureStream), streams_.back());
      gst_rtsp_mount_points_add_factory(places, absl::StrCat("/", views.views()[v].name).c_str(),
                                        factory);
    }
    g_object_unref(places);
    if (gst_rtsp_server_attach(server_.get(), context_) == 0) {
      return absl::FailedPreconditionError(
          absl::StrCat("cannot listen on 127.0.0.1:", port, "; is the port in use?"));
    }
    const int bound = gst_rtsp_server_get_bound_port(server_.get());
    for (const SimulatedView& view : views.views()) {
      addresses_.push_back(absl::StrCat("rtsp://127.0.0.1:", bound, "/", view.name));
    }
    thread_ = std::thread([this] { g_main_loop_run(loop_); });
    return absl::OkStatus();
  }

 private:
  std::vector<StreamHandle> streams_;
  GMainContext* const context_;
  GMainLoop* const loop_;
  std::unique_ptr<GstRTSPServer, RtspCamerasUnref> server_;
  std::thread thread_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<NetworkCameras>> ServeRtspCameras(ServedViews& views, int port) {
  for (const SimulatedView& view : views.views()) {
    if (view.image_width % 8 == 0 && view.image_height % 8 == 0) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("the view '", view.name, "' cannot be streamed: the sides of its images, ",
                     view.image_width, " x ", view.image_height, ", are not multiples of 8"));
  }
  gst_init(nullptr, nullptr);
  auto cameras = std::make_unique<RtspCameras>();
  RETURN_IF_ERROR(cameras->Run(views, port));
  return cameras;
}

}  // namespace silhouette
