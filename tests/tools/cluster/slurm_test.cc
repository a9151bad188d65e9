// SPDX-License-Identifier: Apache-2.0
// Drawing with a real Slurm of one node.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

const std::string kSources = SourceFolder();

// Six joints of a simulated cell, one of which stands still, so that a shard takes some seconds.
std::string DrawnCellFile() {
  const std::string sim = std::string(kSources) + "/capture/sim/";
  return "name: cluster\n"
         "simulation: " +
         sim +
         "cells/demo/simulation.yaml\n"
         "robot:\n"
         "  driver: sim\n"
         "  urdf: " +
         sim +
         "robots/rx130.urdf\n"
         "  images: drawn\n"
         "  joints:\n"
         "    - {name: joint_1, lower: -150 deg, upper: 150 deg}\n"
         "    - {name: joint_2, lower: -60 deg, upper: 60 deg}\n"
         "    - {name: joint_3, lower: -120 deg, upper: 110 deg}\n"
         "    - {name: joint_5, lower: -90 deg, upper: 90 deg}\n"
         "  fixed: {joint_4: 0, joint_6: 0}\n"
         "grid: {steps: {joint_1: 32, joint_2: 8, joint_3: 32, joint_5: 16}}\n"
         "views:\n"
         "  - {name: top, source: sim, image_size: [320, 240]}\n"
         "  - {name: left, source: sim, image_size: [320, 240]}\n"
         "  - {name: front, source: sim, image_size: [320, 240]}\n"
         "capture:\n"
         "  settle: 0\n"
         "  forbidden_regions:\n"
         "    - {name: floor, joints: {joint_2: [50 deg, 60 deg], joint_3: [90 deg, 110 deg]}}\n";
}

// What is run beside Slurm: submits, kills shard 3 with nothing to say for itself once it has
// stored something, and waits for the end of the last job.
constexpr char kWhatTheTestDoes[] = R"(set -euo pipefail
read -r array merge < <("$1/tools/cluster/slurm-draw" --cell cell.yaml --from base.lmdb --shards 8 \
  --into merged.lmdb --folder shards)
killed=no
while squeue -h -j "$merge" 2>/dev/null | grep -q .; do
  if [ "$killed" = no ] && pid=$(pgrep -f -- '--database shards/3.lmdb'); then
    records=$(silhouette-db info shards/3.lmdb --format json 2>/dev/null | jq .records || echo 0)
    if [ "${records:-0}" -gt 0 ] && kill -9 $pid 2>/dev/null; then
      echo "killed shard 3 with $records records"
      killed=yes
    fi
  fi
  # Slurm lets a job that was requeued wait for minutes.
  [ "$killed" = no ] || scontrol update JobId="${array}_3" StartTime=now 2>/dev/null || true
  sleep 0.1
done
scontrol show job "$merge" | grep -o 'JobState=[A-Z]*'
scontrol show job "${array}_3" | grep -o 'Restarts=[0-9]*'
)";

bool Installed(const std::string& program) {
  return std::system(("PATH=$PATH:/usr/sbin command -v " + program + " >/dev/null").c_str()) == 0;
}

struct SlurmTest : testing::Test {
  Ended Run(const std::string& command) const {
    return shell.Run("export PATH=" + ProgramFolder() + ":$PATH:/usr/sbin; " + command);
  }
  void MustRun(const std::string& command) const {
    const Ended ended = Run(command);
    ASSERT_EQ(ended.exit_code, 0) << command << "\n" << ended.out << ended.err;
  }

  const Shell shell;
};

TEST_F(SlurmTest, ShardThatWasKilledIsRequeuedAndTheMergedWholeIsThatOfOneRun) {
  for (const char* program : {"slurmctld", "slurmd", "munged", "sbatch", "jq", "pgrep"}) {
    if (!Installed(program)) {
      GTEST_SKIP() << program << " is not installed (tools/install-packages): drawing with Slurm "
                   << "was not tested";
    }
  }
  WriteFile(shell.folder() / "cell.yaml", DrawnCellFile());
  WriteFile(shell.folder() / "test.sh", kWhatTheTestDoes);
  MustRun("silhouette-capture reference --cell cell.yaml --database base.lmdb --images 2");
  MustRun("silhouette-sim calibration --cell cell.yaml --out cameras");
  MustRun("silhouette-db calibration import base.lmdb cameras");
  MustRun("silhouette-capture draw --cell cell.yaml --from base.lmdb --database whole.lmdb");

  const Ended ended =
      Run(std::string(kSources) + "/tests/tools/cluster/with-slurm slurm bash test.sh " + kSources);
  ASSERT_EQ(ended.exit_code, 0) << ended.out << ended.err;
  EXPECT_THAT(ended.out, HasSubstr("killed shard 3"));
  EXPECT_THAT(ended.out, HasSubstr("JobState=COMPLETED"))
      << ContentOf(shell.folder() / "shards/merge.log");
  EXPECT_THAT(ended.out, HasSubstr("Restarts=1"));
  // The second run of the shard kept what the first one had stored.
  const std::string log = ContentOf(shell.folder() / "shards/3.log");
  const size_t result = log.find("\n{");
  ASSERT_NE(result, std::string::npos) << log;
  const auto json = nlohmann::json::parse(log.substr(result, log.rfind('}') + 1 - result));
  EXPECT_GT(json["kept"], 0);
  EXPECT_GT(json["drawn"], 0);

  MustRun("silhouette-db diff merged.lmdb whole.lmdb");
  const std::string figures = "silhouette-db info --format json ";
  MustRun("for x in merged whole; do " + figures +
          "$x.lmdb | jq '[.records, .collision_index, .drawn]' >$x.json; done; "
          "diff merged.json whole.json && jq -e '.[1].state == \"fresh\"' whole.json");
}

}  // namespace
}  // namespace silhouette
