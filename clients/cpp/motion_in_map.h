// SPDX-License-Identifier: Apache-2.0
// The verdict of a map on a straight motion: the server's verdict, or unknown.
#pragma once

#include <span>

#include "clients/cpp/off_grid.h"
#include "clients/cpp/space_map.h"
#include "silhouette/space_snapshot.h"

namespace silhouette::client {

// Unknown from its start on.
MotionVerdict UnknownMotion(Reason reason, std::span<const double> from);

// Tests the same places as the server does. Free only if the server returns the same; occupied or
// unknown at a place where the server returns occupied, or where the map does not decide
// (kBetweenGridPoints, kNotInMap). A motion of a drawn robot is not decided by a map:
// kNotCheckedHere. Never allocates.
MotionVerdict CheckMotionInMap(const SpaceMap& map, const OffGridRule& rule,
                               std::span<const double> from, std::span<const double> to);

}  // namespace silhouette::client
