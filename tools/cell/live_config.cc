// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/live_config.h"

namespace silhouette {

LiveConfig LiveConfigOf(const Cell& cell) {
  LiveConfig config{
      .live = cell.server.live, .scene = cell.server.scene, .segmentation = cell.segmentation};
  for (const ViewSettings& view : cell.views) {
    if (!view.has_noise) config.without_noise.insert(view.name);
  }
  return config;
}

}  // namespace silhouette
