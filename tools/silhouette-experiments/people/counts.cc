// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/counts.h"

#include <algorithm>
#include <cmath>

namespace silhouette::people_experiment {

void Counts::Add(const Counts& other) {
  episodes += other.episodes;
  seconds += other.seconds;
  people_seconds += other.people_seconds;
  cycles += other.cycles;
  contacts += other.contacts;
  contacts_moving += other.contacts_moving;
  stops += other.stops;
  standing += other.standing;
  moving += other.moving;
  too_fast += other.too_fast;
  leaving += other.leaving;
  scenes += other.scenes;
  unusable += other.unusable;
  for (const auto& [reason, count] : other.defects) defects[reason] += count;
  least_over_stopping = std::min(least_over_stopping, other.least_over_stopping);
  reactions.insert(reactions.end(), other.reactions.begin(), other.reactions.end());
  for (size_t bin = 0; bin < kBins; ++bin) distances[bin] += other.distances[bin];
  processor_seconds += other.processor_seconds;
}

nlohmann::ordered_json Counts::ToJson() const {
  nlohmann::ordered_json json = {{"episodes", episodes},
                                 {"seconds", seconds},
                                 {"people_seconds", people_seconds},
                                 {"cycles", cycles},
                                 {"contacts", contacts},
                                 {"contacts_moving", contacts_moving},
                                 {"stops", stops},
                                 {"standing", standing},
                                 {"moving", moving},
                                 {"too_fast", too_fast},
                                 {"leaving", leaving},
                                 {"scenes", scenes},
                                 {"unusable", unusable},
                                 {"defects", defects},
                                 {"reactions", reactions},
                                 {"distances", distances},
                                 {"processor_seconds", processor_seconds}};
  if (std::isfinite(least_over_stopping)) json["least_over_stopping"] = least_over_stopping;
  return json;
}

Counts Counts::From(const nlohmann::json& json) {
  Counts counts;
  json.at("episodes").get_to(counts.episodes);
  json.at("seconds").get_to(counts.seconds);
  json.at("people_seconds").get_to(counts.people_seconds);
  json.at("cycles").get_to(counts.cycles);
  json.at("contacts").get_to(counts.contacts);
  json.at("contacts_moving").get_to(counts.contacts_moving);
  json.at("stops").get_to(counts.stops);
  json.at("standing").get_to(counts.standing);
  json.at("moving").get_to(counts.moving);
  json.at("too_fast").get_to(counts.too_fast);
  json.at("leaving").get_to(counts.leaving);
  json.at("scenes").get_to(counts.scenes);
  json.at("unusable").get_to(counts.unusable);
  json.at("defects").get_to(counts.defects);
  json.at("reactions").get_to(counts.reactions);
  json.at("distances").get_to(counts.distances);
  json.at("processor_seconds").get_to(counts.processor_seconds);
  const auto least = json.find("least_over_stopping");
  if (least != json.end()) least->get_to(counts.least_over_stopping);
  return counts;
}

}  // namespace silhouette::people_experiment
