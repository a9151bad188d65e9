#include "capture/session/capture_report.h"

namespace silhouette {

void ViewQuality::Add(const Mask& mask) {
  ++images;
  area += mask.Count();
  if (mask.Empty()) ++empty;
  if (TouchesBorder(mask)) ++touching_border;
}

double ViewQuality::mean_area() const {
  return images == 0 ? 0 : static_cast<double>(area) / static_cast<double>(images);
}

bool TouchesBorder(const Mask& mask) {
  for (int x = 0; x < mask.width(); ++x) {
    if (mask.at(x, 0) || mask.at(x, mask.height() - 1)) return true;
  }
  for (int y = 0; y < mask.height(); ++y) {
    if (mask.at(0, y) || mask.at(mask.width() - 1, y)) return true;
  }
  return false;
}

}  // namespace silhouette
