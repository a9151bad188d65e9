// The map of a view's image: coverage, residuals and predicted errors by fields.
#pragma once

#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/poses/pose_solution.h"
#include "calib/report/quality_report.h"

namespace silhouette {

// Fills the map of `view` from its points, and what follows of it: span, coverage and reach.
// `solved`: null where there is no calibration. `workspace`: points in the image.
void FillMap(const CameraModel& lens, const SolvedView* solved,
             const std::vector<Eigen::Vector3d>& workspace, ReportView& view);

}  // namespace silhouette
