// SPDX-License-Identifier: Apache-2.0
// Four minutes of the demo's cell.
#include "tools/silhouette-experiments/faults/faults.h"
#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"

#include <gtest/gtest.h>

namespace silhouette::faults_experiment {
namespace {

TEST(Faults, EveryFaultIsFoundAndPeopleAreNone) {
  const auto demo = cell_experiment::SimulatedWorkplace::Load(SourceFolder() +
                                                              "/capture/sim/cells/demo/cell.yaml");
  ASSERT_TRUE(demo.ok()) << demo.status();
  const WatchSettings settings{.minutes = 4, .interval = 1, .fault_every = 15};
  const WatchResult result = Watch(
      *demo, settings, [] { return false; }, [](int) {});
  EXPECT_EQ(result.scenes, 240);
  EXPECT_EQ(result.none.found, 0);
  for (const FaultRow& fault : result.faults) {
    EXPECT_GT(fault.tried, 0) << fault.name;
    // Where the arm is folded it moves by hardly a pixel of the mask; there may be people where it
    // moves to, and in a loop they change the image. docs/live.md has the shares of four hours.
    double least = 1;
    if (fault.name.starts_with("robot 8 degrees")) least = 0.85;
    if (fault.name.starts_with("still image with noise")) least = 0.85;
    if (fault.name.starts_with("loop with people")) least = 0.45;
    EXPECT_GE(fault.found, least * fault.tried) << fault.name << ", tried " << fault.tried;
  }
}

TEST(Faults, JointsOfAFewDegreesStayInTheirRangeAndOneViewIsNotExchangedWithItself) {
  ProgramCell files;
  files.WriteCell(
      {{"joint_3, lower: -120 deg, upper: 110 deg", "joint_3, lower: 30 deg, upper: 36 deg"},
       {"  - {name: front, source: sim, noise: none, image_size: [160, 120], mask_size: [40, "
        "30]}\n",
        ""}});
  const auto workplace = cell_experiment::SimulatedWorkplace::Load(files.cell());
  ASSERT_TRUE(workplace.ok()) << workplace.status();
  const WatchSettings settings{.minutes = 0.1, .interval = 1, .people = 0};
  const WatchResult result = Watch(
      *workplace, settings, [] { return false; }, [](int) {});
  EXPECT_EQ(result.scenes, 6);
  EXPECT_FALSE(result.faults.empty());
  for (const FaultRow& fault : result.faults) EXPECT_NE(fault.name, "two views exchanged");
}

}  // namespace
}  // namespace silhouette::faults_experiment
