// SPDX-License-Identifier: Apache-2.0
// The key `source` of a view in cell.yaml: where its images come from.
#include <utility>

#include "capture/devices/camera_settings.h"
#include "tools/cell/sections.h"

namespace silhouette {
namespace {

constexpr char kKinds[] =
    "'sim', or what it is with its settings: gige, usb3, v4l2, rtsp, video, folder or grpc, as in "
    "{gige: {serial: \"12345\"}}";

// Above 0, at most 10 minutes.
absl::Duration Timeout(const YamlNode& node) {
  const absl::Duration timeout = node.AsTime();
  if (timeout <= absl::ZeroDuration() || timeout > absl::Minutes(10)) {
    node.Fail("a time above 0, of at most 10 minutes, is expected");
  }
  return timeout;
}

// Of a source whose images are not there yet when they are asked for.
template <typename Source>
void ReadTimes(YamlMap& map, Source& source) {
  map.Read("latency", source.latency, &YamlNode::AsTime);
  map.Read("timeout", source.timeout, Timeout);
  if (source.latency >= source.timeout) {
    map.node().Fail("its 'timeout' must be longer than its 'latency'");
  }
}

template <typename Source>
void ReadExposure(YamlMap& map, Source& source) {
  map.Read("exposure", source.exposure, &YamlNode::AsPositiveTime);
  map.Read("gain", source.gain, &YamlNode::As<double>);
}

std::string NotEmpty(const YamlNode& node) {
  std::string text = node.As<std::string>();
  if (text.empty()) node.Fail("a text that is not empty is expected");
  return text;
}

// A source in short, as in {v4l2: /dev/video0}, or with its settings, of which `key` is the main
// one: then `read` reads the rest.
template <typename Read>
std::string ReadMain(const YamlNode& node, const std::string& key, const Read& read) {
  if (node.IsScalar()) return NotEmpty(node);
  YamlMap map(node);
  std::string main = NotEmpty(map.Required(key));
  read(map);
  map.Finish();
  return main;
}

GenicamSource ReadGenicam(const YamlNode& node, GenicamSource::Bus bus) {
  YamlMap map(node);
  GenicamSource source;
  source.bus = bus;
  const bool gige = bus == GenicamSource::Bus::kGigE;
  map.Read("serial", source.serial, NotEmpty);
  if (gige) {
    map.Read("address", source.address, NotEmpty);
    if (const auto size = map.Optional("packet_size")) {
      source.packet_size = size->As<int>();
      if (*source.packet_size < 576 || *source.packet_size > 16384) {
        size->Fail("576 to 16384 bytes are expected");
      }
    }
  }
  map.Read("trigger", source.trigger, [](const YamlNode& trigger) {
    constexpr CameraTrigger kTriggers[] = {CameraTrigger::kSoftware, CameraTrigger::kHardware,
                                           CameraTrigger::kFree};
    return kTriggers[trigger.AsWordOf({"software", "hardware", "free"})];
  });
  if (source.trigger == CameraTrigger::kHardware) map.Read("line", source.line, NotEmpty);
  ReadExposure(map, source);
  source.colour = map.Get<bool>("colour", source.colour);
  if (const auto offset = map.Optional("offset")) {
    const std::vector<int> pixel = offset->Values<int>(2);
    if (pixel[0] < 0 || pixel[1] < 0) offset->Fail("pixels of the sensor from 0 are expected");
    source.offset_x = pixel[0];
    source.offset_y = pixel[1];
  }
  if (source.trigger == CameraTrigger::kSoftware) {
    map.Read("timeout", source.timeout, Timeout);
  } else {
    ReadTimes(map, source);
  }
  map.Finish();
  if (source.serial.empty() == source.address.empty()) {
    node.Fail(gige ? "either its 'serial' or its 'address' is expected"
                   : "the key 'serial' is missing");
  }
  return source;
}

V4l2Source ReadV4l2(const YamlNode& node) {
  V4l2Source source;
  source.device = ReadMain(node, "device", [&](YamlMap& map) {
    ReadExposure(map, source);
    ReadTimes(map, source);
  });
  return source;
}

RtspSource ReadRtsp(const YamlNode& node) {
  RtspSource source;
  source.url = ReadMain(node, "url", [&](YamlMap& map) { ReadTimes(map, source); });
  if (!source.url.starts_with("rtsp://") && !source.url.starts_with("rtsps://")) {
    node.Fail("an address that begins with 'rtsp://' is expected");
  }
  return source;
}

VideoSource ReadVideo(const YamlNode& node, const std::filesystem::path& folder) {
  VideoSource source;
  source.file = ResolvePath(folder, ReadMain(node, "file", [&](YamlMap& map) {
                              source.repeat = map.Get<bool>("repeat", false);
                            }));
  return source;
}

FolderSource ReadFolder(const YamlNode& node, const std::filesystem::path& folder) {
  FolderSource source;
  source.folder = ResolvePath(folder, ReadMain(node, "path", [&](YamlMap& map) {
                                source.repeat = map.Get<bool>("repeat", false);
                              }));
  return source;
}

GrpcSource ImageSourceReadGrpc(const YamlNode& node, const std::string& view,
                               const std::filesystem::path& folder) {
  GrpcSource source;
  source.camera = view;
  source.address = ReadMain(node, "address", [&](YamlMap& map) {
    map.Read("camera", source.camera, NotEmpty);
    map.Read("timeout", source.timeout, Timeout);
    if (const auto tls = map.Optional("tls")) source.tls = ReadClientTls(*tls, folder);
  });
  return source;
}

}  // namespace

ImageSource ReadImageSource(const YamlNode& node, const std::string& view,
                            const std::filesystem::path& folder) {
  if (node.IsScalar()) {
    const std::string word = node.As<std::string>();
    if (word == "sim") return SimulatedSource{};
    node.Fail("the source '" + word + "' is not known; a source is " + kKinds);
  }
  YamlMap map(node);
  std::vector<ImageSource> sources;
  if (const auto at = map.Optional("gige")) {
    sources.emplace_back(ReadGenicam(*at, GenicamSource::Bus::kGigE));
  }
  if (const auto at = map.Optional("usb3")) {
    sources.emplace_back(ReadGenicam(*at, GenicamSource::Bus::kUsb3));
  }
  if (const auto at = map.Optional("v4l2")) sources.emplace_back(ReadV4l2(*at));
  if (const auto at = map.Optional("rtsp")) sources.emplace_back(ReadRtsp(*at));
  if (const auto at = map.Optional("video")) sources.emplace_back(ReadVideo(*at, folder));
  if (const auto at = map.Optional("folder")) sources.emplace_back(ReadFolder(*at, folder));
  if (const auto at = map.Optional("grpc"))
    sources.emplace_back(ImageSourceReadGrpc(*at, view, folder));
  map.Finish();
  if (sources.size() != 1) node.Fail(std::string("one source is expected: ") + kKinds);
  return std::move(sources.front());
}

}  // namespace silhouette
