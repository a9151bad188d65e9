// SPDX-License-Identifier: Apache-2.0
// The server's own acquisition as a cell's file says.
#pragma once

#include "server/live/acquisition.h"
#include "tools/cell/cell.h"

namespace silhouette {

LiveConfig LiveConfigOf(const Cell& cell);

}  // namespace silhouette
