#include <algorithm>

#include "calib/files/calibration_camera_file.h"
#include "calib/files/calibration_message.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-experiments/calibration/rig.h"
#include "tools/silhouette-experiments/calibration/trials.h"

namespace silhouette::calibration_experiment {

absl::StatusOr<Figures> MeasureRoundTrip(uint64_t seed) {
  const Rig rig = DrawRig(seed);
  double worst = 0;
  for (const NamedCamera& camera : rig.cameras) {
    const std::string text = CameraFileText(MessageOf(camera.model), camera.view);
    ASSIGN_OR_RETURN(const auto message, CameraFromText(text, CameraFileName(camera.view)));
    ASSIGN_OR_RETURN(const auto read, CameraFrom(message));
    for (const Eigen::Vector3d& point : PointsOfWorkspace(rig)) {
      const auto before = camera.model.Project(point);
      const auto after = read.Project(point);
      if (before && after) worst = std::max(worst, (*after - *before).norm());
    }
  }
  return Figures{{"roundtrip_px", worst}};
}

}  // namespace silhouette::calibration_experiment
