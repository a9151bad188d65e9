// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/served/network_cameras.h"

#include <arv.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// GigE Vision's bootstrap registers have room for this many characters of a serial number.
constexpr size_t kLongestSerial = 15;
// A trigger waits for the next multiple of it.
constexpr guint32 kFramePeriodMicroseconds = 10'000;

struct GigeCamerasUnref {
  void operator()(gpointer object) const { g_object_unref(object); }
};

// The colours of a Bayer mosaic's 2x2 pixels, row by row, as channels of blue, green, red; nothing
// for other formats.
std::optional<std::array<size_t, 4>> MosaicOf(ArvPixelFormat format) {
  constexpr size_t kBlue = 0, kGreen = 1, kRed = 2;
  switch (format) {
    case ARV_PIXEL_FORMAT_BAYER_RG_8:
      return {{kRed, kGreen, kGreen, kBlue}};
    case ARV_PIXEL_FORMAT_BAYER_GR_8:
      return {{kGreen, kRed, kBlue, kGreen}};
    case ARV_PIXEL_FORMAT_BAYER_GB_8:
      return {{kGreen, kBlue, kRed, kGreen}};
    case ARV_PIXEL_FORMAT_BAYER_BG_8:
      return {{kBlue, kGreen, kGreen, kRed}};
    default:
      return std::nullopt;
  }
}

// A channel of a pixel; the same in all channels if the image is grey.
uint8_t LevelAt(const CameraImage& image, size_t pixel, size_t channel) {
  return image.channels == 1 ? image.pixels[pixel] : image.pixels[3 * pixel + channel];
}

std::vector<uint8_t> PixelsAs(ArvPixelFormat format, CameraImage image) {
  const size_t width = static_cast<size_t>(image.width);
  const size_t count = width * static_cast<size_t>(image.height);
  std::vector<uint8_t> pixels;
  if (const auto mosaic = MosaicOf(format)) {
    for (size_t i = 0; i < count; ++i) {
      pixels.push_back(LevelAt(image, i, (*mosaic)[2 * (i / width % 2) + i % width % 2]));
    }
    return pixels;
  }
  if (format != ARV_PIXEL_FORMAT_RGB_8_PACKED) return GreyPixels(std::move(image));
  for (size_t i = 0; i < count; ++i) {
    for (const size_t channel : {2, 1, 0}) pixels.push_back(LevelAt(image, i, channel));
  }
  return pixels;
}

// What a camera's thread needs to make an image.
struct Filling {
  ServedViews* views;
  size_t view;
  size_t pixels;
};

// Called by the camera's thread, which answers no command meanwhile.
void Fill(ArvBuffer* buffer, void* data, guint32 /*exposure*/, guint32 /*gain*/,
          ArvPixelFormat format) {
  const auto* filling = static_cast<const Filling*>(data);
  size_t unused = 0;
  // The buffer's bytes: it has room for the image that its registers describe.
  auto* pixels = static_cast<uint8_t*>(const_cast<void*>(arv_buffer_get_data(buffer, &unused)));
  const std::vector<uint8_t> taken = PixelsAs(format, filling->views->Take(filling->view));
  const size_t room = filling->pixels * (format == ARV_PIXEL_FORMAT_RGB_8_PACKED ? 3 : 1);
  std::copy_n(taken.begin(), std::min(taken.size(), room), pixels);
}

class GigeCameras : public NetworkCameras {
 public:
  absl::Status Add(ServedViews& views, size_t view, const std::string& genicam) {
    const SimulatedView& shown = views.views()[view];
    const std::string address = absl::StrCat("127.0.0.", view + 1);
    std::unique_ptr<ArvGvFakeCamera, GigeCamerasUnref> camera(arv_gv_fake_camera_new_full(
        address.c_str(), shown.name.c_str(), genicam.empty() ? nullptr : genicam.c_str()));
    if (camera == nullptr || !arv_gv_fake_camera_is_running(camera.get())) {
      return absl::FailedPreconditionError(absl::StrCat(
          "no GigE Vision camera can be at ", address, "; give the machine the address with 'ip ",
          "address add ", address, "/8 dev lo', and end what else is at its port 3956"));
    }
    ArvFakeCamera* registers = arv_gv_fake_camera_get_fake_camera(camera.get());
    const auto width = static_cast<guint32>(shown.image_width);
    const auto height = static_cast<guint32>(shown.image_height);
    arv_fake_camera_write_register(registers, ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, width);
    arv_fake_camera_write_register(registers, ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, height);
    arv_fake_camera_write_register(registers, ARV_FAKE_CAMERA_REGISTER_WIDTH, width);
    arv_fake_camera_write_register(registers, ARV_FAKE_CAMERA_REGISTER_HEIGHT, height);
    arv_fake_camera_write_register(registers, ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US,
                                   kFramePeriodMicroseconds);
    fillings_.push_back(std::make_unique<Filling>(
        Filling{&views, view, static_cast<size_t>(width) * static_cast<size_t>(height)}));
    arv_fake_camera_set_fill_pattern(registers, Fill, fillings_.back().get());
    cameras_.push_back(std::move(camera));
    addresses_.push_back(address);
    return absl::OkStatus();
  }

  void LosePackets(double share) override {
    for (const auto& camera : cameras_) {
      g_object_set(camera.get(), "gvsp-lost-ratio", share, nullptr);
    }
  }

 private:
  std::vector<std::unique_ptr<Filling>> fillings_;  // outlive the cameras
  std::vector<std::unique_ptr<ArvGvFakeCamera, GigeCamerasUnref>> cameras_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<NetworkCameras>> ServeGigeCameras(ServedViews& views,
                                                                 const std::string& genicam) {
  auto cameras = std::make_unique<GigeCameras>();
  for (size_t v = 0; v < views.views().size(); ++v) {
    const std::string& name = views.views()[v].name;
    if (name.size() > kLongestSerial) {
      return absl::InvalidArgumentError(
          absl::StrCat("the view '", name, "' cannot be a GigE Vision camera: its name is the ",
                       "serial number, which has at most ", kLongestSerial, " characters"));
    }
    RETURN_IF_ERROR(cameras->Add(views, v, genicam));
  }
  return cameras;
}

}  // namespace silhouette
