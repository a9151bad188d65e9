// SPDX-License-Identifier: Apache-2.0
#include "capture/drivers/aravis/aravis_device.h"

#include <algorithm>
#include <array>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "capture/devices/running_clock.h"
#include "capture/drivers/aravis/aravis_camera.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr auto kRefused = absl::StatusCode::kFailedPrecondition;
constexpr auto kAravisDeviceGone = absl::StatusCode::kUnavailable;
// Of a stream. The kernel grants no more than net.core.rmem_max; images that wait in it longer than
// it is large are incomplete.
constexpr int kSocketBuffer = 4 << 20;
constexpr int kBuffers = 8;

const char* ProtocolOf(GenicamSource::Bus bus) {
  return bus == GenicamSource::Bus::kGigE ? "GigEVision" : "USB3Vision";
}

std::string Text(const char* text) { return text == nullptr ? "" : text; }

// Guards Aravis' list of cameras.
std::mutex list_mutex;

// The address of a GigE camera, Aravis' name of any other, from those found when all were called
// the last time; empty: it was not among them.
std::string PlaceOf(const GenicamSource& source) {
  const std::lock_guard lock(list_mutex);
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    if (Text(arv_get_device_serial_nbr(i)) == source.serial &&
        Text(arv_get_device_protocol(i)) == ProtocolOf(source.bus)) {
      return Text(source.bus == GenicamSource::Bus::kGigE ? arv_get_device_address(i)
                                                          : arv_get_device_id(i));
    }
  }
  return "";
}

// Calls all cameras, unless somebody began to do so at about the moment `wanted` or later: several
// that are lost need not be looked for one by one.
void CallAllCameras(absl::Duration wanted) {
  constexpr absl::Duration kTogether = absl::Milliseconds(100);
  static absl::Duration begun = -absl::InfiniteDuration();
  const std::lock_guard lock(list_mutex);
  if (begun > wanted - kTogether) return;
  begun = RunningNow();
  arv_update_device_list();
}

// The serial number in the answer to GigE Vision's discovery message; empty: it has none.
std::string SerialIn(std::string_view answer) {
  constexpr size_t kPlace = 8 + 0xd8;  // header, then a copy of the first registers
  constexpr size_t kMost = 16;
  if (answer.size() < kPlace) return "";
  const std::string_view serial = answer.substr(kPlace, kMost);
  return std::string(serial.substr(0, serial.find('\0')));
}

// The serial number of the GigE camera at the address, empty if it has none; nothing: no camera
// answers there. Asked by GigE Vision's discovery message (its control protocol, GVCP), sent to it
// alone. Aravis opens one camera after the other and waits seconds for each that is not there; this
// may be asked for many at the same time.
std::optional<std::string> SerialAt(GInetAddress* address) {
  constexpr guint16 kControlPort = 3956;
  constexpr std::array<char, 8> kDiscovery = {0x42, 0x01, 0, 0x02, 0, 0, 0, 0x01};
  constexpr gint64 kWaitMicroseconds = 300'000;
  constexpr int kAttempts = 3;
  const std::unique_ptr<GSocketAddress, Unref> camera(
      g_inet_socket_address_new(address, kControlPort));
  const std::unique_ptr<GSocket, Unref> socket(g_socket_new(
      g_inet_address_get_family(address), G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr));
  if (socket == nullptr || !g_socket_connect(socket.get(), camera.get(), nullptr, nullptr)) {
    return std::nullopt;
  }
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    g_socket_send(socket.get(), kDiscovery.data(), kDiscovery.size(), nullptr, nullptr);
    if (!g_socket_condition_timed_wait(socket.get(), G_IO_IN, kWaitMicroseconds, nullptr,
                                       nullptr)) {
      continue;
    }
    char answer[1024];
    const gssize size = g_socket_receive(socket.get(), answer, sizeof(answer), nullptr, nullptr);
    if (size > 0) return SerialIn({answer, static_cast<size_t>(size)});
    absl::SleepFor(absl::Microseconds(kWaitMicroseconds));  // refused; its machine may be starting
  }
  return std::nullopt;
}

// `place`: PlaceOf(), or an address of the cell's file. Unavailable, too: cameras have exchanged
// their addresses, and another one than `serial` is there; empty: any.
absl::StatusOr<ArvCamera*> NewCamera(const std::string& place, const std::string& serial) {
  const std::unique_ptr<GInetAddress, Unref> address(g_inet_address_new_from_string(place.c_str()));
  if (address != nullptr) {
    const std::optional<std::string> there = SerialAt(address.get());
    if (!there) return absl::UnavailableError("nothing is heard from it");
    if (!serial.empty() && !there->empty() && *there != serial) {
      return absl::UnavailableError(
          absl::StrCat("at its address is the camera with the serial number '", *there, "', not '",
                       serial, "'"));
    }
  }
  return Ask(kAravisDeviceGone, arv_camera_new, place.c_str());
}

absl::Status NotFound(const GenicamSource& source) {
  const std::lock_guard lock(list_mutex);
  std::vector<std::string> others;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    if (Text(arv_get_device_protocol(i)) == ProtocolOf(source.bus)) {
      others.push_back(Text(arv_get_device_serial_nbr(i)));
    }
  }
  return absl::UnavailableError(absl::StrCat(
      "no ", ProtocolOf(source.bus), " camera with the serial number '", source.serial,
      "' answers; ",
      others.empty() ? "none does" : absl::StrCat("those that do: ", absl::StrJoin(others, ", ")),
      ". Check its power, cable and address"));
}

// The pixels that it can send and this program can read, the preferred first.
std::vector<const char*> Preferred(bool colour) {
  std::vector<const char*> formats = {"BGR8",     "BGR8Packed", "RGB8",     "RGB8Packed",
                                      "BayerRG8", "BayerGR8",   "BayerGB8", "BayerBG8"};
  formats.insert(colour ? formats.end() : formats.begin(), "Mono8");
  return formats;
}

absl::Status SetPixels(ArvCamera* camera, const GenicamSource& source) {
  guint count = 0;
  ASSIGN_OR_RETURN(
      auto names, Ask(kRefused, arv_camera_dup_available_pixel_formats_as_strings, camera, &count));
  const std::set<std::string> available(names, names + count);
  g_free(names);
  for (const char* format : Preferred(source.colour)) {
    if (!available.contains(format)) continue;
    return Call(kRefused, arv_camera_set_pixel_format_from_string, camera, format);
  }
  return absl::FailedPreconditionError(
      absl::StrCat("it sends none of the pixel formats Mono8, BGR8, RGB8, Bayer..8, only ",
                   absl::StrJoin(available, ", ")));
}

// Whatever the camera has: after a power failure it may have another region.
absl::Status SetRegion(ArvCamera* camera, int width, int height, const GenicamSource& source) {
  gint x = 0, y = 0, has_width = 0, has_height = 0;
  const auto ask = [&] {
    return Call(kRefused, arv_camera_get_region, camera, &x, &y, &has_width, &has_height);
  };
  const auto fits = [&] {
    return x == source.offset_x && y == source.offset_y && has_width == width &&
           has_height == height;
  };
  RETURN_IF_ERROR(ask());
  if (fits()) return absl::OkStatus();
  gint sensor_width = 0, sensor_height = 0;
  RETURN_IF_ERROR(
      Call(kRefused, arv_camera_get_sensor_size, camera, &sensor_width, &sensor_height));
  if (source.offset_x > sensor_width - width || source.offset_y > sensor_height - height) {
    return absl::FailedPreconditionError(absl::StrCat(
        "its sensor has ", sensor_width, " x ", sensor_height, " pixels; the cell says ", width,
        " x ", height, " (image_size) from ", source.offset_x, ", ", source.offset_y, " (offset)"));
  }
  // First at offset 0, where every size fits. Aravis skips negative values: some cameras refuse any
  // offset.
  const auto set = [&](gint to_x, gint to_y, gint to_width, gint to_height) {
    return Call(kRefused, arv_camera_set_region, camera, to_x, to_y, to_width, to_height);
  };
  RETURN_IF_ERROR(set(x == 0 ? -1 : 0, y == 0 ? -1 : 0, width, height));
  if (source.offset_x > 0 || source.offset_y > 0) {
    RETURN_IF_ERROR(set(source.offset_x, source.offset_y, -1, -1));
  }
  RETURN_IF_ERROR(ask());
  if (fits()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("of its sensor it takes ", has_width, " x ", has_height, " pixels from ", x,
                   ", ", y, " instead of ", width, " x ", height, " from ", source.offset_x, ", ",
                   source.offset_y, "; state an image_size and offset that it can have"));
}

absl::Status SetTrigger(ArvCamera* camera, const GenicamSource& source) {
  RETURN_IF_ERROR(
      Call(kRefused, arv_camera_set_acquisition_mode, camera, ARV_ACQUISITION_MODE_CONTINUOUS));
  if (source.trigger == CameraTrigger::kFree) {
    return Call(kRefused, arv_camera_clear_triggers, camera);
  }
  const bool hardware = source.trigger == CameraTrigger::kHardware;
  const absl::Status status =
      Call(kRefused, arv_camera_set_trigger, camera, hardware ? source.line.c_str() : "Software");
  if (status.ok()) return status;
  return absl::FailedPreconditionError(
      absl::StrCat("it takes no such trigger: ", status.message()));
}

// Exposure or gain: its bounds, in the camera's unit, and how it is set.
struct Quantity {
  const char* name;
  void (*bounds)(ArvCamera*, double*, double*, GError**);
  void (*set)(ArvCamera*, double, GError**);
};

absl::Status Set(ArvCamera* camera, const Quantity& quantity, double value) {
  double least = 0, most = 0;
  RETURN_IF_ERROR(Call(kRefused, quantity.bounds, camera, &least, &most));
  if (value < least || value > most) {
    return absl::FailedPreconditionError(absl::StrCat(
        quantity.name, " ", value, " is not possible; it takes ", least, " to ", most));
  }
  return Call(kRefused, quantity.set, camera, value);
}

// Nothing may change by itself.
absl::Status FixExposure(ArvCamera* camera, const GenicamSource& source) {
  absl::Status status;
  if (arv_camera_is_exposure_auto_available(camera, nullptr)) {
    status.Update(Call(kRefused, arv_camera_set_exposure_time_auto, camera, ARV_AUTO_OFF));
  }
  if (arv_camera_is_gain_auto_available(camera, nullptr)) {
    status.Update(Call(kRefused, arv_camera_set_gain_auto, camera, ARV_AUTO_OFF));
  }
  for (const char* feature : {"BalanceWhiteAuto", "BlackLevelAuto", "GammaAuto"}) {
    if (arv_camera_is_feature_available(camera, feature, nullptr)) {
      status.Update(Call(kRefused, arv_camera_set_string, camera, feature, "Off"));
    }
  }
  if (source.exposure) {
    status.Update(Set(camera,
                      {"the exposure, in microseconds,", arv_camera_get_exposure_time_bounds,
                       arv_camera_set_exposure_time},
                      absl::ToDoubleMicroseconds(*source.exposure)));
  }
  if (source.gain) {
    status.Update(
        Set(camera, {"the gain", arv_camera_get_gain_bounds, arv_camera_set_gain}, *source.gain));
  }
  return status;
}

absl::Status SetPackets(ArvCamera* camera, const GenicamSource& source) {
  if (!arv_camera_is_gv_device(camera)) return absl::OkStatus();
  // A packet socket needs rights of its own, and hears nothing on the loopback interface.
  arv_camera_gv_set_stream_options(camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  if (source.packet_size) {
    return Call(kRefused, arv_camera_gv_set_packet_size, camera, *source.packet_size);
  }
  return Ask(kRefused, arv_camera_gv_auto_packet_size, camera).status();
}

}  // namespace

std::vector<FoundCamera> FindGenicamCameras() {
  const std::lock_guard lock(list_mutex);
  arv_update_device_list();
  std::vector<FoundCamera> found;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    FoundCamera camera{.protocol = Text(arv_get_device_protocol(i)),
                       .vendor = Text(arv_get_device_vendor(i)),
                       .model = Text(arv_get_device_model(i)),
                       .serial = Text(arv_get_device_serial_nbr(i)),
                       .address = ""};
    if (camera.protocol == ProtocolOf(GenicamSource::Bus::kGigE)) {
      camera.address = Text(arv_get_device_address(i));
    }
    found.push_back(std::move(camera));
  }
  std::sort(found.begin(), found.end(), [](const FoundCamera& a, const FoundCamera& b) {
    return std::tie(a.protocol, a.serial) < std::tie(b.protocol, b.serial);
  });
  return found;
}

absl::StatusOr<CameraHandle> FindDevice(const GenicamSource& source) {
  const absl::Duration wanted = RunningNow();
  std::string id = source.address;
  if (id.empty()) {
    id = PlaceOf(source);
    if (id.empty()) {
      CallAllCameras(wanted);
      id = PlaceOf(source);
    }
    if (id.empty()) return NotFound(source);
  }
  const auto camera = NewCamera(id, source.serial);
  if (!camera.ok() || *camera == nullptr) {
    if (source.address.empty()) CallAllCameras(wanted);  // the next attempt finds it elsewhere
    return absl::UnavailableError(
        absl::StrCat("the camera ", id, " does not answer",
                     camera.ok() ? "" : absl::StrCat(": ", camera.status().message())));
  }
  CameraHandle handle(*camera);
  ArvDevice* device = arv_camera_get_device(handle.get());
  if (ARV_IS_GV_DEVICE(device) && !arv_gv_device_is_controller(ARV_GV_DEVICE(device))) {
    return absl::UnavailableError(absl::StrCat("another program controls the camera ", id,
                                               "; end it, or wait until the camera gives it up"));
  }
  return handle;
}

absl::Status SetUpDevice(ArvCamera* camera, int width, int height, const GenicamSource& source) {
  RETURN_IF_ERROR(SetPixels(camera, source));
  RETURN_IF_ERROR(SetRegion(camera, width, height, source));
  RETURN_IF_ERROR(SetTrigger(camera, source));
  RETURN_IF_ERROR(FixExposure(camera, source));
  return SetPackets(camera, source);
}

absl::StatusOr<StreamHandle> MakeStream(ArvCamera* camera) {
  ASSIGN_OR_RETURN(const auto payload, Ask(kRefused, arv_camera_get_payload, camera));
  ASSIGN_OR_RETURN(const auto made,
                   Ask(kAravisDeviceGone, arv_camera_create_stream, camera,
                       static_cast<ArvStreamCallback>(nullptr), static_cast<void*>(nullptr)));
  if (made == nullptr) return absl::UnavailableError("it has no stream");
  StreamHandle stream(made);
  if (ARV_IS_GV_STREAM(stream.get())) {
    g_object_set(stream.get(), "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED,
                 "socket-buffer-size", kSocketBuffer, nullptr);
  }
  for (int i = 0; i < kBuffers; ++i) {
    arv_stream_push_buffer(stream.get(), arv_buffer_new(payload, nullptr));
  }
  return stream;
}

}  // namespace silhouette
