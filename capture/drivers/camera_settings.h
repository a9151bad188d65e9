// Where the images of a view come from, one struct per kind of source. docs/cell.yaml documents
// them for users.
#pragma once

#include <optional>
#include <string>
#include <variant>

#include "absl/time/time.h"

namespace silhouette {

// The camera of the view's name in the simulated cell.
struct SimulatedSource {};

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

// std::monostate: there is none, masks come from elsewhere.
using ImageSource = std::variant<std::monostate, SimulatedSource, V4l2Source, RtspSource,
                                 VideoSource, FolderSource>;

inline bool IsSimulated(const ImageSource& source) {
  return std::holds_alternative<SimulatedSource>(source);
}
inline bool HasImages(const ImageSource& source) {
  return !std::holds_alternative<std::monostate>(source);
}

}  // namespace silhouette
