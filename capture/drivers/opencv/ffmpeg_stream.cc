// SPDX-License-Identifier: Apache-2.0
extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libswscale/swscale.h>
}

#include <cmath>
#include <opencv2/core.hpp>

#include "absl/strings/str_cat.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/opencv/image_stream.h"
#include "capture/drivers/opencv/rtsp_round_trip.h"

namespace silhouette {
namespace {

// The converter may write this many pixels beyond the end of a row.
constexpr int kBeyondRow = 32;

class FfmpegStream : public ImageStream {
 public:
  // `joined`: it may begin amid images that cannot be decoded without those before.
  FfmpegStream(const std::string& url, absl::Duration timeout, bool joined)
      : url_(url), timeout_(timeout), joined_(joined) {
    av_log_set_level(AV_LOG_QUIET);  // statuses report what went wrong
  }
  ~FfmpegStream() override {
    FfmpegStream::Close();
    sws_freeContext(converter_);
    av_frame_free(&frame_);
    av_packet_free(&packet_);
  }
  FfmpegStream(const FfmpegStream&) = delete;
  FfmpegStream& operator=(const FfmpegStream&) = delete;

  absl::Status Open() override {
    Close();
    GiveUpAfterTimeout();
    const int result = OpenVideo();
    if (result >= 0) return absl::OkStatus();
    char why[AV_ERROR_MAX_STRING_SIZE] = {};
    av_strerror(result, why, sizeof why);
    return absl::UnavailableError(absl::StrCat(
        "no images come from ", WithoutPassword(url_), " (", TooLate() ? "no answer" : why,
        "); check the address, the network and the camera's user and password"));
  }

  void Close() override {
    avcodec_free_context(&decoder_);
    avformat_close_input(&input_);
    begun_ = !joined_;
    damaged_ = false;
    damaged_until_ = AV_NOPTS_VALUE;
  }

  bool Grab() override {
    if (decoder_ == nullptr) return false;
    GiveUpAfterTimeout();
    while (!TooLate()) {
      int result = avcodec_receive_frame(decoder_, frame_);
      if (result == 0) {
        NoteDamage();
        if (begun_ || !damaged_) return begun_ = true;
        continue;
      }
      if (result == AVERROR_EOF) return false;
      if (result == AVERROR(EAGAIN)) {
        if (!ReadMore()) return false;
        result = Decode();
      }
      if (result < 0 && begun_) return damaged_ = true;
    }
    return false;
  }

  bool damaged() const override { return damaged_; }

  std::optional<absl::Duration> sent() const override {
    if (frame_->best_effort_timestamp == AV_NOPTS_VALUE) return std::nullopt;
    const AVRational unit = input_->streams[video_]->time_base;
    return absl::Seconds(static_cast<double>(frame_->best_effort_timestamp) * av_q2d(unit));
  }

  cv::Mat Retrieve() override {
    const int width = frame_->width;
    const int height = frame_->height;
    converter_ = sws_getCachedContext(converter_, width, height,
                                      static_cast<AVPixelFormat>(frame_->format), width, height,
                                      AV_PIX_FMT_BGR24, SWS_BICUBIC, nullptr, nullptr, nullptr);
    if (converter_ == nullptr) return {};
    cv::Mat rows(height, width + kBeyondRow, CV_8UC3);
    const auto step = static_cast<int>(rows.step);
    const int converted =
        sws_scale(converter_, frame_->data, frame_->linesize, 0, height, &rows.data, &step);
    return converted == height ? Turned(rows.colRange(0, width)) : cv::Mat();
  }

 private:
  // As a file says that it is to be shown.
  cv::Mat Turned(const cv::Mat& image) const {
    const uint8_t* display =
        av_stream_get_side_data(input_->streams[video_], AV_PKT_DATA_DISPLAYMATRIX, nullptr);
    const double angle =
        display != nullptr ? av_display_rotation_get(reinterpret_cast<const int32_t*>(display)) : 0;
    const int quarters = std::isnan(angle) ? 0 : static_cast<int>(std::lround(angle / 90)) & 3;
    if (quarters == 0) return image.clone();
    cv::Mat turned;
    cv::rotate(image, turned, 3 - quarters);
    return turned;
  }

  void GiveUpAfterTimeout() { give_up_ = RunningNow() + timeout_; }
  bool TooLate() const { return RunningNow() > give_up_; }

  // The first video of the stream. Returns FFmpeg's error, or 0.
  int OpenVideo() {
    input_ = avformat_alloc_context();
    input_->interrupt_callback.callback = [](void* stream) {
      return static_cast<int>(static_cast<FfmpegStream*>(stream)->TooLate());
    };
    input_->interrupt_callback.opaque = this;
    AVDictionary* options = nullptr;
    av_dict_set(&options, "rtsp_flags", "prefer_tcp", 0);
    int result = avformat_open_input(&input_, url_.c_str(), nullptr, &options);
    av_dict_free(&options);
    if (result >= 0) result = avformat_find_stream_info(input_, nullptr);
    if (result < 0) return result;
    for (video_ = 0; video_ < static_cast<int>(input_->nb_streams); ++video_) {
      const AVCodecParameters* found = input_->streams[video_]->codecpar;
      if (found->codec_type == AVMEDIA_TYPE_VIDEO) return OpenDecoder(found);
    }
    return AVERROR_STREAM_NOT_FOUND;
  }

  int OpenDecoder(const AVCodecParameters* video) {
    const AVCodec* codec = avcodec_find_decoder(video->codec_id);
    if (codec == nullptr) return AVERROR_DECODER_NOT_FOUND;
    decoder_ = avcodec_alloc_context3(codec);
    const int result = avcodec_parameters_to_context(decoder_, video);
    // A JPEG's decoder does not mark what it patches over: it must fail instead.
    if (video->codec_id == AV_CODEC_ID_MJPEG) decoder_->err_recognition |= AV_EF_EXPLODE;
    // Threads that decode one image each would hold back as many images.
    decoder_->thread_type = FF_THREAD_SLICE;
    decoder_->thread_count = 0;
    return result < 0 ? result : avcodec_open2(decoder_, codec, nullptr);
  }

  // Reads a packet of the video, or an empty one at the end. False: there is nothing more to read.
  bool ReadMore() {
    av_packet_unref(packet_);
    for (;;) {
      const int read = av_read_frame(input_, packet_);
      if (read == AVERROR_EOF) return true;
      if (read < 0 && read != AVERROR(EAGAIN)) return false;
      if (read >= 0 && packet_->stream_index == video_) return true;
      av_packet_unref(packet_);
      if (TooLate()) return false;
    }
  }

  // Decodes the packet. Returns FFmpeg's error, or 0.
  int Decode() {
    if (packet_->size > 0 && (packet_->flags & AV_PKT_FLAG_CORRUPT) != 0) {
      damaged_ = true;
      damaged_until_ = packet_->pts;
    }
    return avcodec_send_packet(decoder_, packet_);
  }

  // A damaged image damages those that are coded as changes of it: all until a later key image.
  void NoteDamage() {
    if (frame_->decode_error_flags != 0 || (frame_->flags & AV_FRAME_FLAG_CORRUPT) != 0) {
      damaged_ = true;
    } else if (frame_->key_frame != 0 && (damaged_until_ == AV_NOPTS_VALUE ||
                                          frame_->best_effort_timestamp > damaged_until_)) {
      damaged_ = false;
      damaged_until_ = AV_NOPTS_VALUE;
    }
  }

  const std::string url_;
  const absl::Duration timeout_;
  const bool joined_;
  absl::Duration give_up_;  // when what is going on now ends without success
  AVFormatContext* input_ = nullptr;
  AVCodecContext* decoder_ = nullptr;
  SwsContext* converter_ = nullptr;
  AVFrame* frame_ = av_frame_alloc();
  AVPacket* packet_ = av_packet_alloc();
  int video_ = 0;       // its place among the streams of input_
  bool begun_ = false;  // images that are damaged count, too
  bool damaged_ = false;
  int64_t damaged_until_ = AV_NOPTS_VALUE;  // when the last damaged packet is shown, if known
};

}  // namespace

std::unique_ptr<ImageStream> NetworkStream(const std::string& url, absl::Duration timeout) {
  return std::make_unique<FfmpegStream>(url, timeout, /*joined=*/true);
}

std::unique_ptr<ImageStream> FileStream(const std::string& file) {
  return std::make_unique<FfmpegStream>("file:" + file, absl::InfiniteDuration(), /*joined=*/false);
}

}  // namespace silhouette
