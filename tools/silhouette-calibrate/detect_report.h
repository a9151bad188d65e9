// What `detect` says of the images.
#pragma once

#include <string>

#include "tools/silhouette-calibrate/detect_session.h"

namespace silhouette {

// A table of the images, the warnings and the views' coverage. `out`: the file that was written.
void PrintDetection(const DetectSession& session, const std::string& out);
void PrintDetectionJson(const DetectSession& session, const std::string& out);

// "coverage left 31 %, right 22 %"
std::string CoverageLine(const DetectSession& session);

}  // namespace silhouette
