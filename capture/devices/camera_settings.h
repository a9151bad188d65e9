// SPDX-License-Identifier: Apache-2.0
// Where the images of a view come from, one struct per kind of source. docs/cell.yaml documents
// them for users.
#pragma once

#include <optional>
#include <string>
#include <variant>

#include "absl/time/time.h"
#include "proto/tls/client_tls_files.h"

namespace silhouette {

// What makes a camera take an image.
enum class CameraTrigger {
  kSoftware,  // a command to each camera, all in a row
  kHardware,  // a pulse on a line of the camera
  kFree,      // nothing: the camera takes images all the time
};

// The camera of the view's name in the simulated cell.
struct SimulatedSource {};

// A GigE Vision or USB3 Vision camera.
struct GenicamSource {
  enum class Bus { kGigE, kUsb3 };
  Bus bus = Bus::kGigE;
  // One of them is stated; an address only of a GigE camera.
  std::string serial = {};
  std::string address = {};
  CameraTrigger trigger = CameraTrigger::kSoftware;
  std::string line = "Line1";  // of the hardware trigger
  // Nothing: as the camera has them; in no case are they automatic.
  std::optional<absl::Duration> exposure = std::nullopt;
  std::optional<double> gain = std::nullopt;  // in the camera's unit
  bool colour = false;                        // colour pixels if it has any; else grey ones
  // The sensor's pixel at the image's upper left corner.
  int offset_x = 0;
  int offset_y = 0;
  // GigE: bytes of a packet; nothing: the largest that gets through.
  std::optional<int> packet_size = std::nullopt;
  // The longest that an image is under way; counts unless images are triggered by software.
  absl::Duration latency = absl::Milliseconds(100);
  absl::Duration timeout = absl::Seconds(2);
};

// A camera with a Linux driver of its own.
struct V4l2Source {
  std::string device;  // e.g. /dev/video0
  // Nothing: as the driver has them; in no case are they automatic. The gain is in the driver's
  // unit.
  std::optional<absl::Duration> exposure = std::nullopt;
  std::optional<double> gain = std::nullopt;
  absl::Duration latency = absl::Milliseconds(100);
  absl::Duration timeout = absl::Seconds(2);
};

// A network camera's stream.
struct RtspSource {
  std::string url;
  absl::Duration latency = absl::Milliseconds(500);
  absl::Duration timeout = absl::Seconds(5);
};

// The images of a video file, one after the other.
struct VideoSource {
  std::string file;
  bool repeat = false;  // begins again at the end
};

// The image files of a folder in the order of their names.
struct FolderSource {
  std::string folder;
  bool repeat = false;
};

// A camera of somebody's own CameraDriverService.
struct GrpcSource {
  std::string address;  // host:port, or unix:path
  std::string camera;   // its name there
  absl::Duration timeout = absl::Seconds(5);
  ClientTlsFiles tls;  // without files: plain text
};

// std::monostate: there is none, masks come from elsewhere.
using ImageSource = std::variant<std::monostate, SimulatedSource, GenicamSource, V4l2Source,
                                 RtspSource, VideoSource, FolderSource, GrpcSource>;

inline bool IsSimulated(const ImageSource& source) {
  return std::holds_alternative<SimulatedSource>(source);
}
inline bool HasImages(const ImageSource& source) {
  return !std::holds_alternative<std::monostate>(source);
}

}  // namespace silhouette
