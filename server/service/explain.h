// The pictures of one verdict.
#pragma once

#include <span>

#include "server/scene/checker.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette {

// Adds what every view shows: scene, obstacle, intersection and collision image, as far as they are
// there. Nothing where there is no scene.
void ExplainViews(const Checker& checker, std::span<const double> q, v1::ExplainResponse* response);

}  // namespace silhouette
