// How much memory the robot images may take, and what the log says of them.
#pragma once

#include <cstdint>
#include <string>

#include "server/scene/served_database.h"
#include "tools/cell/cell.h"

namespace silhouette {

// Bytes of memory that this process may have: those of the machine, or fewer where its control
// group or a limit of the process allows no more.
uint64_t AvailableMemory();

// What the cell says of loading; where it says nothing, robot images may take two fifths of
// AvailableMemory(), since a reload has two databases at a time. Its progress goes into the log
// every few seconds.
LoadSettings LoadSettingsOf(const Cell& cell);

// Where the robot images are, and why; and whether writers have to stay away from the folder `path`
// while it is served.
void LogRobotImages(const ServedDatabase& database, const std::string& path,
                    const LoadSettings& settings);

}  // namespace silhouette
