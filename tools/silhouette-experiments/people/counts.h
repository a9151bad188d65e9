// SPDX-License-Identifier: Apache-2.0
// What is counted of a method, in one episode or in many.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace silhouette::people_experiment {

// Times in seconds, distances in metres.
struct Counts {
  static constexpr double kBin = 0.1;  // of distances
  static constexpr size_t kBins = 15;  // the last one: and more

  int episodes = 0;
  double seconds = 0;
  double people_seconds = 0;  // with somebody inside the fence
  double cycles = 0;          // a way there or back is half of one
  int contacts = 0;           // that began
  int contacts_moving = 0;    // of them those in which the robot moved while it touched
  int stops = 0;              // on the way
  double standing = 0;        // on the way: not while it picks or places
  double moving = 0;
  double too_fast = 0;  // moving, nearer than the protective distance, and not away
  double leaving = 0;   // moving away, nearer than that
  int scenes = 0;       // that were looked at
  // By reason: with a defect, or no scene at all ("no scene"); then no verdict is free. `unusable`:
  // scenes with any.
  int unusable = 0;
  std::map<std::string, int> defects{};
  // Of the distance over the stopping distance, while it moves.
  double least_over_stopping = std::numeric_limits<double>::infinity();
  // How long each command was too fast by the truth.
  std::vector<double> reactions{};
  // Seconds by distance, while it moves.
  std::array<double, kBins> distances{};
  double processor_seconds = 0;  // of the episode's own thread; the renderer has others, too

  void Add(const Counts& other);
  double CyclesPerHour() const { return seconds > 0 ? 3600 * cycles / seconds : 0; }
  double PeopleShare() const { return seconds > 0 ? people_seconds / seconds : 0; }

  // As a line of the results of an episode; From throws nlohmann::json::exception if it is none.
  nlohmann::ordered_json ToJson() const;
  static Counts From(const nlohmann::json& json);
};

// A method in one episode.
struct EpisodeResult {
  int episode = 0;
  std::string method;
  Counts counts;
};

}  // namespace silhouette::people_experiment
