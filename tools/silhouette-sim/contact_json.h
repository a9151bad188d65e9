// Truth as JSON.
#pragma once

#include <nlohmann/json.hpp>

#include "capture/sim/contact.h"

namespace silhouette {

// {"contact": bool, "distance": metres, "link": name, "obstacle": name}; without obstacles the last
// three are null.
inline nlohmann::ordered_json JsonOf(const Contact& contact) {
  nlohmann::ordered_json json{{"contact", contact.touching}};
  const bool any = !contact.obstacle.empty();
  json["distance"] = any ? nlohmann::ordered_json(contact.distance) : nullptr;
  json["link"] = any ? nlohmann::ordered_json(contact.link) : nullptr;
  json["obstacle"] = any ? nlohmann::ordered_json(contact.obstacle) : nullptr;
  return json;
}

}  // namespace silhouette
