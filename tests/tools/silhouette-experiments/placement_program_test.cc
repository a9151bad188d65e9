// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments placement as its users meet it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

const std::string kPlaces = R"(mask_size: [32, 32]
field_of_view: 60 deg
cameras: 2
look_at: [0, 0, 0.8]
places:
  - {name: front, position: [4, 0, 1]}
  - {name: door, position: [4, 0.2, 1], look_at: [9, 0, 1]}
boxes:
  - {name: wall, lower: [-2, 4, 2], upper: [2, 4, 2], counts: [2, 1, 1]}
samples: {configurations: 30, scenes: 4, seed: 7}
)";

class PlacementProgram : public testing::Test {
 protected:
  Ended Run(const std::string& places, const std::string& more = "",
            const std::string& cell = "demo") {
    WriteFile(shell_.folder() / "places.yaml", places);
    return shell_.Run(ProgramFolder() + "/silhouette-experiments placement --cell " +
                      SourceFolder() + "/capture/sim/cells/" + cell +
                      "/cell.yaml --places places.yaml " + more);
  }

  void ExpectMistake(const std::string& places, const std::string& message) {
    const Ended ended = Run(places);
    EXPECT_EQ(ended.exit_code, 2);
    EXPECT_THAT(ended.err, HasSubstr(message));
    EXPECT_EQ(std::count(ended.err.begin(), ended.err.end(), '\n'), 1) << ended.err;
  }

  // kPlaces with one thing replaced by another.
  static std::string With(const std::string& what, const std::string& by) {
    std::string places = kPlaces;
    places.replace(places.find(what), what.size(), by);
    return places;
  }

  Shell shell_;
};

TEST_F(PlacementProgram, ChoosesDrawsAndTellsScripts) {
  const Ended ended = Run(kPlaces, "--format json --out out");
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const auto json = nlohmann::json::parse(ended.out);
  EXPECT_EQ(json["candidates"], 4);
  EXPECT_EQ(json["robot_not_whole"], 1);
  ASSERT_EQ(json["selections"].size(), 2u);
  EXPECT_EQ(json["selections"][0]["cameras"], 1);
  EXPECT_EQ(json["selections"][1]["tested"], 120);
  EXPECT_EQ(json["chosen"].size(), 2u);
  std::ifstream file(shell_.folder() / "out/placement.json");
  const auto map = nlohmann::json::parse(file);
  EXPECT_EQ(map["places"].size(), 4u);
  EXPECT_EQ(map["chosen"], json["chosen"]);
  EXPECT_GT(map["footprint"].size(), 5u);
  const Ended plot = shell_.Run(SourceFolder() + "/tools/plot out/placement.json");
  EXPECT_EQ(plot.exit_code, 0) << plot.err;
  EXPECT_GT(std::filesystem::file_size(shell_.folder() / "out/placement.png"), 1000u);
  EXPECT_EQ(Run(kPlaces, "--format json").out, ended.out) << "the same seed, the same answer";
  const Ended text = Run(kPlaces, "--cameras 1 --preset uncalibrated");
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_THAT(text.out, HasSubstr("cameras  missing %  additional %  places"));
}

TEST_F(PlacementProgram, WhereTheCellStatesNoGridConfigurationsAreAnywhereWithinTheLimits) {
  const Ended ended =
      Run("mask_size: [32, 32]\nfield_of_view: 60 deg\ncameras: 1\nlook_at: [0, 0, 0.8]\n"
          "places: [{name: front, position: [7, 0, 1]}]\n"
          "samples: {configurations: 100, scenes: 2, seed: 7}\n",
          "--format json", "six_axes");
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_EQ(nlohmann::json::parse(ended.out)["selections"][0]["tested"], 200)
      << "more than the limits' 64 corners";
}

TEST_F(PlacementProgram, MistakesInTheFileAreOneSentenceWithItsPlace) {
  ExpectMistake(With("cameras: 2", "camera: 2"), "places.yaml:3: unknown key 'camera'");
  ExpectMistake(With("60 deg", "200 deg"), "places.yaml:2");
  ExpectMistake(With("[32, 32]", "[32, 3200]"), "each side of a mask is 1 to 1024 pixels");
  ExpectMistake(With("name: front", "name: wall 1"), "another place called 'wall 1'");
  ExpectMistake(With("look_at: [0, 0, 0.8]\n", ""), "there is no 'look_at'");
  ExpectMistake(With("counts: [2, 1, 1]", "counts: [2, 1, 0]"), "at least one place");
  ExpectMistake(With("scenes: 4", "scenes: 0"), "at least 1 is expected");
  ExpectMistake("mask_size: [32, 32]\nfield_of_view: 1\n", "there is no place for a camera");
  ExpectMistake("[", "places.yaml");
}

TEST_F(PlacementProgram, PlacesThatAllCutTheRobotOffAreRefused) {
  ExpectMistake(
      "mask_size: [32, 32]\nfield_of_view: 10 deg\nlook_at: [0, 0, 1]\n"
      "places: [{name: near, position: [2, 0, 1]}]\n",
      "no place has the whole robot in its image");
}

TEST_F(PlacementProgram, FileThatIsNotThereIsNamed) {
  const Ended ended = shell_.Run(
      ProgramFolder() + "/silhouette-experiments placement --cell no.yaml --places x.yaml");
  EXPECT_EQ(ended.exit_code, 2);
  EXPECT_THAT(ended.err, HasSubstr("no.yaml"));
}

}  // namespace
}  // namespace silhouette
