// SPDX-License-Identifier: Apache-2.0
#include "server/scene/view_treatment.h"

#include <cmath>
#include <stdexcept>

#include "absl/strings/str_cat.h"
#include "calib/camera/camera_model.h"

namespace silhouette {
namespace {

void Check(const ViewTreatmentSettings& settings, MaskSize size,
           const std::optional<Eigen::AlignedBox3d>& workspace) {
  for (const double length : {settings.margin.pixels, settings.margin.metres}) {
    if (!std::isfinite(length) || length < 0) {
      throw std::invalid_argument("a margin must be a number not below 0");
    }
  }
  if (settings.ignored && settings.ignored->size() != size) {
    throw std::invalid_argument("a mask of ignored pixels is not of its view's size");
  }
  if (settings.margin.metres > 0 && !workspace) {
    throw std::invalid_argument("a margin in metres needs the workspace");
  }
}

// What `metres` can look like at most wherever the robot may be.
absl::Status AddMetres(double metres, const Calibration* calibration, size_t view, MaskSize size,
                       const Eigen::AlignedBox3d& workspace, double& pixels) {
  if (calibration == nullptr || calibration->cameras.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("its margin of ", metres, " m needs the camera models, which the database ",
                     "does not have; import them with 'silhouette-db calibration import', or state "
                     "the margin in px"));
  }
  // From the robot, which is in the workspace, the margin reaches this far beyond it.
  const Eigen::AlignedBox3d reached(workspace.min().array() - metres,
                                    workspace.max().array() + metres);
  const std::optional<double> scale =
      PixelsPerMetre(calibration->cameras.at(view).ScaledTo(size.width, size.height), reached);
  if (!scale) {
    return absl::FailedPreconditionError(
        absl::StrCat("its camera is in the workspace or nearer to it than its margin of ", metres,
                     " m, so that there is no largest image of it; state a smaller 'workspace', "
                     "or the margin in px"));
  }
  pixels += metres * *scale;
  return absl::OkStatus();
}

}  // namespace

ViewTreatments TreatmentsOf(const TreatmentSettings& settings, const Calibration* calibration,
                            std::span<const std::string> names, std::span<const MaskSize> sizes) {
  ViewTreatments treatments{.views = std::vector<ViewTreatment>(sizes.size()), .margins_known = {}};
  if (settings.views.empty()) return treatments;
  if (settings.views.size() != sizes.size()) {
    throw std::invalid_argument("the settings of margins are not of these views");
  }
  for (size_t view = 0; view < sizes.size(); ++view) {
    const ViewTreatmentSettings& stated = settings.views[view];
    Check(stated, sizes[view], settings.workspace);
    ViewTreatment& treatment = treatments.views[view];
    treatment.ignored = stated.ignored;
    treatment.margin = stated.margin.pixels;
    if (stated.margin.metres == 0) continue;
    const absl::Status known = AddMetres(stated.margin.metres, calibration, view, sizes[view],
                                         *settings.workspace, treatment.margin);
    if (known.ok()) continue;
    treatments.margins_known.Update(
        absl::Status(known.code(), absl::StrCat("view '", names[view], "': ", known.message())));
  }
  return treatments;
}

}  // namespace silhouette
