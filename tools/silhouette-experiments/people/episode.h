// SPDX-License-Identifier: Apache-2.0
// An episode: the robot picks and places while people walk about.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/collision/stop.h"
#include "server/scene/served_database.h"
#include "tools/silhouette-experiments/people/counts.h"
#include "tools/silhouette-experiments/people/method.h"
#include "tools/silhouette-experiments/people/video.h"

namespace silhouette::people_experiment {

struct EpisodeSettings {
  double seconds = 60;
  uint64_t seed = 1;
  // People stand still while their next step would bring them nearer to the robot than kPeopleStop.
  bool people_stop = false;
  // Scenes are made of rendered camera images, not of masks drawn with these errors.
  bool rendered = false;
  SegmentationErrors errors{};
};
inline constexpr double kPeopleStop = 0.15;  // metres

// What episodes share. Used by any number of threads.
class Stage {
 public:
  // Under the DefaultRule of `rate`.
  static absl::StatusOr<Stage> Make(const SimulatedWorkplace& workplace,
                                    std::shared_ptr<const ServedDatabase> database, double rate);

  const SimulatedWorkplace& workplace() const { return *workplace_; }
  const std::shared_ptr<const ServedDatabase>& database() const { return database_; }
  const DrawnRobot& robot() const { return robot_; }
  JointSpace joint_space() const;
  const SpeedRule& rule() const { return rule_; }
  // The robot goes from the one to the other and back.
  const std::vector<Configuration>& stations() const { return stations_; }

 private:
  Stage(const SimulatedWorkplace& workplace, std::shared_ptr<const ServedDatabase> database,
        DrawnRobot robot, SpeedRule rule);

  const SimulatedWorkplace* workplace_;
  std::shared_ptr<const ServedDatabase> database_;
  DrawnRobot robot_;
  SpeedRule rule_;
  std::vector<Configuration> stations_;
};

// Radius about the base's axis within which the whole robot always is, metres.
double ReachOf(const SimulatedWorkplace& workplace);

// The same arguments give the same result, but for processor_seconds. `video`: gets what the
// cameras see in a rendered episode, a picture a decision; null: none. Cancelled: `stop`, asked at
// every decision, says so. Errors of MakeScene and RenderedCell::Look.
absl::StatusOr<Counts> RunEpisode(const Stage& stage, const EpisodeSettings& settings, int episode,
                                  const std::string& method, const Stop& stop = nullptr,
                                  Video* video = nullptr);

}  // namespace silhouette::people_experiment
