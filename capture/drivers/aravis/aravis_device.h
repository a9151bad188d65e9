// SPDX-License-Identifier: Apache-2.0
// What aravis_camera.cc needs of Aravis, with owners and statuses instead of GObject's conventions.
#pragma once

#include <arv.h>

#include <memory>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "capture/devices/camera_settings.h"

namespace silhouette {

struct Unref {
  void operator()(gpointer object) const { g_object_unref(object); }
};
using CameraHandle = std::unique_ptr<ArvCamera, Unref>;
using StreamHandle = std::unique_ptr<ArvStream, Unref>;

// Calls an Aravis function with `arguments` and a GError; the error as a status of `code`.
template <typename Function, typename... Arguments>
absl::Status Call(absl::StatusCode code, Function* function, Arguments... arguments) {
  GError* error = nullptr;
  function(arguments..., &error);
  if (error == nullptr) return absl::OkStatus();
  absl::Status status(code, error->message);
  g_error_free(error);
  return status;
}

// The same for a function with a result.
template <typename Function, typename... Arguments>
auto Ask(absl::StatusCode code, Function* function, Arguments... arguments)
    -> absl::StatusOr<decltype(function(arguments..., nullptr))> {
  GError* error = nullptr;
  auto result = function(arguments..., &error);
  if (error == nullptr) return result;
  absl::Status status(code, error->message);
  g_error_free(error);
  return status;
}

// The camera that `source` names, under this program's control, not set up yet. Unavailable: it
// does not answer, or another program controls it.
absl::StatusOr<CameraHandle> FindDevice(const GenicamSource& source);

// Sets size, pixels, trigger, exposure, gain and packets. FailedPrecondition as OpenGenicamCamera.
absl::Status SetUpDevice(ArvCamera* camera, int width, int height, const GenicamSource& source);

// A stream with its buffers, not started yet.
absl::StatusOr<StreamHandle> MakeStream(ArvCamera* camera);

}  // namespace silhouette
