// What a capture session is made of.
#pragma once

#include <vector>

#include "capture/capture_settings.h"
#include "capture/cell_cameras.h"
#include "capture/cell_robot.h"
#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"
#include "capture/travel.h"
#include "db/store.h"

namespace silhouette {

struct SessionParts {
  Database* database;
  const Travel* travel;
  CellRobot robot;
  CellCameras cameras;
  std::vector<Reference> references;  // one per view
  CaptureSettings settings;
  SegmentationSettings segmentation;
};

}  // namespace silhouette
