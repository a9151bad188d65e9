// What people and programs are told of the collision index.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "db/store/collision_index.h"

namespace silhouette {

// "no robot images", "none", "fresh", "damaged" if a tile is, else "stale" if a tile is or has
// none.
std::string StateName(const CollisionIndexSummary& summary);

// One line: the state, and the mend if it is not fresh. `database`: its folder.
std::string StateText(const CollisionIndexSummary& summary, const std::string& database);

nlohmann::json StateJson(const CollisionIndexSummary& summary);

}  // namespace silhouette
