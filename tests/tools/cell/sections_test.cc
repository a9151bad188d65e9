// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include "tests/folders.h"
#include "tests/tools/cell/cell_file.h"

namespace silhouette {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

TEST(Cell, RobotImageMemoryIsASizeOrLeftOpen) {
  const std::string bare = kBareCell;
  EXPECT_EQ(Load(bare)->server.robot_image_memory, std::nullopt);
  EXPECT_EQ(Load(bare + "server: {robot_image_memory: 8 GB}\n")->server.robot_image_memory,
            8'000'000'000u);
  EXPECT_THAT(MessageOf(bare + "server: {robot_image_memory: much}\n"),
              HasSubstr("robot_image_memory: a number of bytes is expected"));
}

TEST(Cell, FirstRobotImagesAreLookedAtUnlessTheFileSaysOtherwise) {
  const std::string bare = kBareCell;
  EXPECT_EQ(Load(bare)->capture.first_look.configurations, 3);
  EXPECT_FALSE(Load(bare)->capture.first_look.may_be_cut);
  const auto cell =
      Load(bare +
           "capture: {first_look: {configurations: 0, least_area: 0.01, may_be_cut: true, "
           "least_overlap: 0.7}}\n");
  EXPECT_EQ(cell->capture.first_look.configurations, 0);
  EXPECT_EQ(cell->capture.first_look.least_area, 0.01);
  EXPECT_TRUE(cell->capture.first_look.may_be_cut);
  EXPECT_EQ(cell->capture.first_look.least_overlap, 0.7);
  EXPECT_THAT(MessageOf(bare + "capture: {first_look: {least_area: 2}}\n"),
              HasSubstr("a number from 0 to 1 is expected"));
}

TEST(Cell, FirstLookAtMoreConfigurationsThanASessionMayLoseIsRefused) {
  const auto with = [](const std::string& count) {
    return kBareCell + ("capture: {first_look: {configurations: " + count + "}}\n");
  };
  EXPECT_TRUE(Load(with("10")).ok());
  EXPECT_THAT(MessageOf(with("11")), HasSubstr("configurations: at most 10 is expected"));
}

TEST(Cell, LimitsOfAVerificationAreThoseOfTheFile) {
  const std::string bare = kBareCell;
  const auto with = [&](const std::string& keys) {
    return bare + "verification: {" + keys + "}\n";
  };
  EXPECT_EQ(Describe(Load(bare)->verification), Describe(ComparisonSettings{}));
  const auto cell =
      Load(with("growth_step: 1 cm, most_growth: 20 cm, most_noise_pixels: 3, most_noise: 0.01, "
                "most_uncaptured: 0.05, most_uncaptured_of_link: 0.3, most_shift: 0.5 px, "
                "most_held_out: 0.04, least_moved: 0.6, least_configurations: 20"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(Describe(cell->verification),
            Describe(ComparisonSettings{.growth_step = 0.01,
                                        .most_growth = 0.2,
                                        .most_noise_pixels = 3,
                                        .most_noise = 0.01,
                                        .most_uncaptured = 0.05,
                                        .most_uncaptured_of_link = 0.3,
                                        .most_shift = 0.5,
                                        .most_held_out = 0.04,
                                        .least_moved = 0.6,
                                        .least_configurations = 20}));
  EXPECT_THAT(MessageOf(with("growth_step: 0")), HasSubstr("most_growth, 0.1 m, must be 1 to 200"));
  EXPECT_THAT(MessageOf(with("growth_step: 0.1 mm")), HasSubstr("times growth_step, 0.0001 m"));
  EXPECT_THAT(MessageOf(with("most_held_out: 2")), HasSubstr("a number from 0 to 1 is expected"));
  EXPECT_THAT(MessageOf(with("most_shift: 1 mm")), HasSubstr("a number of pixels is expected"));
  EXPECT_THAT(MessageOf(with("least_configurations: 1")), HasSubstr("at least 2 is expected"));
}

TEST(Cell, IndexIsAlwaysChecked) {
  const std::string bare = kBareCell;
  const auto with = [&](const std::string& keys) {
    return bare + "server: {index_check: {" + keys + "}}\n";
  };
  EXPECT_EQ(Load(bare)->server.index_check.rate, 64'000'000u);
  EXPECT_EQ(Load(bare)->server.index_check.samples, 16);
  EXPECT_EQ(Load(with("rate: 2 MB, samples: 3"))->server.index_check.rate, 2'000'000u);
  EXPECT_EQ(Load(with("rate: 2 MB, samples: 3"))->server.index_check.samples, 3);
  EXPECT_THAT(MessageOf(with("rate: 0 B")), HasSubstr("at least 1 MB is expected"));
  EXPECT_THAT(MessageOf(with("samples: 0")), HasSubstr("at least 1 is expected"));
}

TEST(Cell, ClientsHaveLimits) {
  const std::string bare = kBareCell;
  const auto with = [&](const std::string& keys) {
    return bare + "server: {limits: {" + keys + "}}\n";
  };
  EXPECT_EQ(Load(bare)->server.limits.connections, ClientLimits().connections);
  EXPECT_EQ(Load(with("connections: 7, streams_per_client: 3"))->server.limits.connections, 7);
  EXPECT_EQ(Load(with("connections: 7, streams_per_client: 3"))->server.limits.streams_per_client,
            3);
  EXPECT_EQ(Load(with("request_memory: 300 MB"))->server.limits.request_memory, 300'000'000u);
  EXPECT_THAT(MessageOf(with("request_memory: 1 MB")), HasSubstr("at least 256 MB is expected"));
  EXPECT_THAT(MessageOf(with("waiting: 0")), HasSubstr("at least 1 is expected"));
  for (const std::string key : {"streams_per_client", "waiting_per_client"}) {
    EXPECT_THAT(MessageOf(with(key + ": 2000000000")), HasSubstr("at most 1000000 is expected"));
  }
  EXPECT_THAT(MessageOf(with("calls_per_second: 0")), HasSubstr("greater than 0"));
}

TEST(Cell, VariantOfTheLiveRobotIsStatedOrLeftOpen) {
  const std::string bare = kBareCell;
  EXPECT_EQ(Load(bare)->server.live.variant, "");
  EXPECT_EQ(Load(bare + "server: {live: {variant: gripper-open}}\n")->server.live.variant,
            "gripper-open");
}

TEST(Cell, OtherVariantsAreInMemoryOnlyWhereAskedFor) {
  const std::string bare = kBareCell;
  EXPECT_FALSE(Load(bare)->server.variants_in_memory);
  EXPECT_TRUE(Load(bare + "server: {variants_in_memory: true}\n")->server.variants_in_memory);
}

TEST(Cell, GateAndAuditAreReadAndTheirMistakesNamed) {
  const auto with = [](const std::string& keys) {
    return kBareCell + ("server: {" + keys + "}\n");
  };
  const auto cell =
      Load(with("tls: {certificate: s.pem, key: s.key, client_ca: /ca.pem}, audit: a.jsonl, "
                "roles: {planner: [p], operator: [o, p]}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  ASSERT_TRUE(cell->server.gate.tls.has_value());
  EXPECT_EQ(cell->server.gate.tls->client_ca, "/ca.pem");
  EXPECT_THAT(cell->server.gate.tls->key, EndsWith("/s.key"));
  EXPECT_THAT(cell->server.audit, EndsWith("/a.jsonl"));
  const std::vector<std::string> p = {"p"};
  EXPECT_TRUE(cell->server.gate.roles.Permit(p, "/silhouette.v1.SceneService/AllowRegion").ok());
  EXPECT_FALSE(cell->server.gate.roles.Permit(p, "/silhouette.v1.SceneService/PublishScene").ok());
  EXPECT_EQ(Load(with("socket_mode: 0620"))->server.gate.socket_mode, 0620u);
  EXPECT_THAT(MessageOf(with("socket_mode: rw")), HasSubstr("a file mode in octal digits"));
  EXPECT_THAT(MessageOf(with("socket_mode: 01777")), HasSubstr("a file mode in octal digits"));
  EXPECT_THAT(MessageOf(with("roles: {}")), HasSubstr("no client has a role"));
  EXPECT_THAT(MessageOf(with("roles: {planer: [p]}")), HasSubstr("did you mean 'planner'"));
  EXPECT_THAT(MessageOf(with("tls: {key: s.key}")), HasSubstr("certificate"));
}

TEST(Cell, SoundIsReadAndNeedsTheRobotsModel) {
  const std::string robots = SourceFolder() + "/capture/sim/robots/";
  const std::string cell_with = "name: x\nrobot:\n  urdf: " + robots +
                                "rx130.urdf\n  joints: [{name: joint_1}]\n"
                                "  fixed: {joint_2: 0, joint_3: 0, joint_4: 0, joint_5: 0, "
                                "joint_6: 0}\n  payload_radius: 0.2\n"
                                "grid: {steps: {joint_1: 4}}\nviews: [{name: top}]\n";
  const absl::StatusOr<Cell> silent = Load(cell_with);
  ASSERT_TRUE(silent.ok()) << silent.status();
  EXPECT_FALSE(silent->sound.has_value());
  EXPECT_FALSE(SoundCellOf(*silent)->has_value());
  const absl::StatusOr<Cell> cell =
      Load(cell_with + "sound: {least_obstacle: 0.03, voxel_edge: 0.01, model_tolerance: 0.002}\n");
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->sound->least_obstacle, 0.03);
  EXPECT_EQ(cell->sound->voxel_edge, 0.01);
  EXPECT_EQ(cell->sound->model_tolerance, 0.002);
  EXPECT_FALSE(cell->sound->whole_model);
  EXPECT_EQ(cell->sound->geometry, BodyGeometry::kVisual);
  EXPECT_EQ(Load(cell_with + "sound: {least_obstacle: 1, geometry: collision}\n")->sound->geometry,
            BodyGeometry::kCollision);
  const auto sound = SoundCellOf(*cell);
  ASSERT_TRUE(sound.ok() && sound->has_value()) << sound.status();
  EXPECT_GT(cell->grid_move, 0.5) << "four steps a turn";
  EXPECT_EQ(Load(kBareCell)->grid_move, 0) << "without a model it is not known";
  EXPECT_EQ((*sound)->payload_radius, 0.2);
  EXPECT_GT((*sound)->workspace.sizes().minCoeff(), 0.5) << "the robot's reach";

  EXPECT_THAT(MessageOf(std::string(kBareCell) + "sound: {least_obstacle: 0.03}\n"),
              HasSubstr("it needs the robot's model"));
  EXPECT_THAT(MessageOf(cell_with + "sound: {}\n"), HasSubstr("least_obstacle"));
  EXPECT_THAT(MessageOf(cell_with + "sound: {least_obstacle: 0}\n"), HasSubstr("greater than 0"));
  EXPECT_THAT(MessageOf(cell_with + "sound: {least_obstacle: 0.03, voxel_edge: 0.04}\n"),
              HasSubstr("must not exceed least_obstacle"));
  EXPECT_THAT(MessageOf(cell_with + "sound: {least_obstacle: 0.03, model_tolerance: -1}\n"),
              HasSubstr("a length is expected"));
}

TEST(Cell, ARobotThatIsNotWhereItReportsCannotBeLetPassByCoreError) {
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "server: {max_core_error: 0.9}\n"),
              HasSubstr("server.max_core_error: at most 0.05"));
  EXPECT_TRUE(Load(std::string(kBareCell) + "server: {max_core_error: 0.05}\n").ok());
}

TEST(Cell, PolicyAndCalibrationAreRead) {
  const absl::StatusOr<Cell> cell = Load(std::string(kBareCell) +
                                         "policy: {preset: paper-calibrated}\n"
                                         "calibration: {margin: 1.5}\n");
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_FALSE(cell->choose_preset);
  EXPECT_EQ(cell->policy.preset, Preset::kPaperCalibrated);
  EXPECT_EQ(cell->calibration.margin, 1.5);
}

}  // namespace
}  // namespace silhouette
