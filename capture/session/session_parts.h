// What a capture session is made of.
#pragma once

#include <vector>

#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"
#include "capture/session/capture_settings.h"
#include "capture/session/cell_cameras.h"
#include "capture/session/cell_robot.h"
#include "capture/session/travel.h"
#include "db/store/store.h"

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
