// SPDX-License-Identifier: Apache-2.0
// A small simulated cell for tests, captured: two views without noise, 45 configurations.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/capture/session/program_cell.h"
#include "tools/silhouette-experiments/cell/trial.h"

namespace silhouette::cell_experiment {

class SmallWorkplace {
 public:
  SmallWorkplace() {
    auto loaded = SimulatedWorkplace::Load(files_.cell());
    EXPECT_TRUE(loaded.ok()) << loaded.status();
    workplace_ = std::make_unique<SimulatedWorkplace>(*std::move(loaded));
    auto database = workplace_->OpenOrCapture(files_.database(), {});
    EXPECT_TRUE(database.ok()) << database.status();
    auto served = workplace_->Serve(**database, {});
    EXPECT_TRUE(served.ok()) << served.status();
    served_ = *served;
  }

  const SimulatedWorkplace& workplace() const { return *workplace_; }
  const ServedDatabase& served() const { return *served_; }

  TrialSetting Setting(int off_grid_tests = 50) const {
    return {.workplace = *workplace_,
            .database = *served_,
            .policies = {{.preset = Preset::kUncalibrated}, {.preset = Preset::kCalibrated}},
            .off_grid_tests = off_grid_tests,
            .seed = 3};
  }

 private:
  ProgramCell files_;
  std::unique_ptr<SimulatedWorkplace> workplace_;
  std::shared_ptr<const ServedDatabase> served_;
};

// An obstacle that everybody sees: white, before dark walls.
inline Obstacle WhiteBox(const Eigen::Vector3d& size, const Eigen::Vector3d& position) {
  Obstacle box;
  box.name = "box";
  box.mesh = BoxMesh(size);
  box.world_from_obstacle.translation() = position;
  box.brightness = 0.95;
  return box;
}

}  // namespace silhouette::cell_experiment
