// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/cell.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numbers>
#include <regex>
#include <variant>

#include "absl/strings/str_cat.h"
#include "db/store/store.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/folders.h"
#include "tests/test_folder.h"
#include "tools/cell/segmentation_text.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;

constexpr char kBareCell[] = R"(name: bare
robot:
  joints:
    - {name: a, lower: 0, upper: 90 deg}
    - {name: b, continuous: true}
  fixed: {c: 0.5}
grid:
  steps: {a: 10, b: 36}
views:
  - {name: top}
  - {name: side, mask_size: [32, 16]}
)";

std::string Write(const std::string& text) {
  static int count = 0;
  const std::string path = (TestFolder() / ("cell_" + std::to_string(count++) + ".yaml")).string();
  std::ofstream(path) << text;
  return path;
}

absl::StatusOr<Cell> Load(const std::string& text) { return LoadCell(Write(text)); }

// kBareCell with `from` replaced by `to`.
std::string Changed(const std::string& from, const std::string& to) {
  std::string text = kBareCell;
  const size_t place = text.find(from);
  EXPECT_NE(place, std::string::npos) << from;
  return text.replace(place, from.size(), to);
}

std::string MessageOf(const std::string& text) {
  const absl::StatusOr<Cell> cell = Load(text);
  EXPECT_EQ(cell.status().code(), absl::StatusCode::kInvalidArgument);
  return std::regex_replace(std::string(cell.status().message()), std::regex("^.*/"), "");
}

TEST(Cell, BareJointsAndViewsWithoutASourceAreEnough) {
  const absl::StatusOr<Cell> cell = Load(kBareCell);
  ASSERT_TRUE(cell.ok()) << cell.status();
  ASSERT_EQ(cell->grid.dimensions(), 2);
  EXPECT_EQ(cell->grid.joints()[0].steps, 10);
  EXPECT_DOUBLE_EQ(cell->grid.joints()[0].upper, std::numbers::pi / 2);
  EXPECT_TRUE(cell->grid.joints()[1].continuous);
  EXPECT_DOUBLE_EQ(cell->grid.joints()[1].lower, -std::numbers::pi);
  ASSERT_EQ(cell->fixed_joints.size(), 1u);
  EXPECT_EQ(cell->fixed_joints[0].name, "c");
  EXPECT_EQ(cell->views[0].mask_size, (MaskSize{64, 64}));
  EXPECT_EQ(cell->views[1].mask_size, (MaskSize{32, 16}));
  EXPECT_EQ(cell->views[1].image_width, 32);
  EXPECT_EQ(DescriptionOf(*cell).segmentation(), "");
}

TEST(Cell, TilesAreThoseOfADatabaseThatIsThere) {
  const std::string path = Write(kBareCell);
  const std::string folder = FreshFolder() / "cell.lmdb";
  storage::v1::CellDescription description = DescriptionOf(*LoadCell(path, folder));
  const std::vector<int> chosen(description.tile_edges().begin(), description.tile_edges().end());
  description.clear_tile_edges();
  for (const int edge : {1, 4096}) description.add_tile_edges(edge);
  ASSERT_TRUE(Database::Create(folder, description).ok());

  const absl::StatusOr<Cell> cell = LoadCell(path, folder);
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->database, folder);
  EXPECT_THAT(cell->grid.tile_edges(), ElementsAre(1, 4096));
  // Not of a grid that is another, nor where there is no database.
  const auto edges_of = [](const absl::StatusOr<Cell>& of) {
    return std::vector<int>(of->grid.tile_edges().begin(), of->grid.tile_edges().end());
  };
  const std::string other = Write(Changed("a: 10", "a: 11"));
  EXPECT_EQ(edges_of(LoadCell(other, folder)), edges_of(LoadCell(other)));
  EXPECT_EQ(edges_of(LoadCell(path, folder + "-not-there")), chosen);
}

// The RX130 with all its joints; `robot` are further lines of the section.
std::string SixJoints(const std::string& robot, const std::string& rest = "") {
  return absl::StrCat("name: arm\nrobot:\n  urdf: ", SourceFolder(),
                      "/capture/sim/robots/rx130.urdf\n", robot,
                      "  joints: [{name: joint_1}, {name: joint_2}, {name: joint_3}, {name: "
                      "joint_4}, {name: joint_5}, {name: joint_6}]\nviews: [{name: top}]\n",
                      rest);
}

TEST(Cell, TilesOfAWristAreLongAndThoseOfAnArmShort) {
  const absl::StatusOr<Cell> cell = Load(SixJoints("", "grid: {max_move: 0.3}\n"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  const std::span<const int> edges = cell->grid.tile_edges();
  EXPECT_LE(edges[0] * edges[1] * edges[2], 16);
  EXPECT_GE(edges[3] * edges[4] * edges[5], 256);
}

TEST(Cell, TheCommentedSampleIsACellAndShowsTheDefaults) {
  std::ifstream in(SourceFolder() + "/docs/cell.yaml");
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const std::string robots = SourceFolder() + "/capture/sim/robots/";
  text = std::regex_replace(text, std::regex("urdf: rx130"), "urdf: " + robots + "rx130");
  const absl::StatusOr<Cell> cell = Load(text);
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->segmentation, SegmentationSettings{});
  EXPECT_EQ(Describe(cell->verification), Describe(ComparisonSettings{}));
  EXPECT_EQ(cell->policy, Policy{});
  EXPECT_TRUE(cell->choose_preset);
  EXPECT_EQ(cell->calibration.margin, CalibrationSettings{}.margin);
  EXPECT_EQ(cell->capture.settle, CaptureSettings{}.settle);
  EXPECT_EQ(cell->capture.settle_timeout, CaptureSettings{}.settle_timeout);
  EXPECT_EQ(cell->capture.still_images, CaptureSettings{}.still_images);
  EXPECT_EQ(cell->capture.joint_speed, CaptureSettings{}.joint_speed);
  EXPECT_EQ(cell->capture.arrival_timeout, CaptureSettings{}.arrival_timeout);
  EXPECT_EQ(cell->capture.reference_images, CaptureSettings{}.reference_images);
  EXPECT_EQ(cell->capture.raw_images, CaptureSettings{}.raw_images);
  EXPECT_EQ(cell->capture.sentinels.count, SentinelSettings{}.count);
  EXPECT_EQ(cell->capture.sentinels.every, SentinelSettings{}.every);
  EXPECT_EQ(cell->capture.sentinels.most_shift, SentinelSettings{}.most_shift);
  EXPECT_EQ(cell->capture.retry, CaptureSettings{}.retry);
  EXPECT_EQ(cell->capture.keep_free, CaptureSettings{}.keep_free);
  EXPECT_EQ(cell->server.listen, ServerSettings{}.listen);
  EXPECT_EQ(cell->server.scene.max_age, SceneSettings{}.max_age);
  EXPECT_EQ(cell->server.scene.max_skew, SceneSettings{}.max_skew);
  EXPECT_EQ(cell->server.scene.max_core_error, SceneSettings{}.max_core_error);
  EXPECT_EQ(cell->server.scene.weak_rim, SceneSettings{}.weak_rim);
  EXPECT_EQ(cell->capture.forbidden_regions.size(), 1u);
}

TEST(Segmentation, SettingsOfADatabaseAreThoseItWasMadeWith) {
  const auto read = [](const std::string& text) {
    storage::v1::CellDescription cell;
    cell.set_segmentation(text);
    return SegmentationOf(cell);
  };
  for (const SegmentationSettings& settings :
       {SegmentationSettings{}, LeftOutOfDescriptions(),
        SegmentationSettings{.faint_difference = 3, .texture_difference = 0, .faint_side = 5},
        SegmentationSettings{.noise_factor = 1.0 / 3,
        .faint_side = 3,
        .follow_brightness = false,
        .keep_thin_parts = false,
        .min_cover = 0.25,
        .shadows = Shadows::kIgnore}}) {
    const auto found = read(Describe(settings));
    ASSERT_TRUE(found.ok()) << found.status();
    EXPECT_EQ(*found, settings) << Describe(settings);
  }
  // Of databases that are older than the keys which are not there.
  const std::string first =
      "clean_up_radius: 1\nfollow_brightness: true\nmin_blob_pixels: 12\nmin_cover: 0\n"
      "min_difference: 8\nnoise_factor: 6\n";
  EXPECT_EQ(*read(first), (SegmentationSettings{.faint_difference = 0,
                                                .texture_difference = 0,
                                                .faint_side = 5,
                                                .keep_thin_parts = false}));
  EXPECT_EQ(*read(first + "faint_difference: 3\n"),
            (SegmentationSettings{.faint_difference = 3,
                                  .texture_difference = 0,
                                  .faint_side = 5,
                                  .keep_thin_parts = false}));
  EXPECT_TRUE(absl::IsNotFound(read("").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(read("blobs: 1\n").status()));
}

TEST(Segmentation, CellFileThatDiffersFromItsDatabaseIsToldWhatToWrite) {
  storage::v1::CellDescription database;
  database.set_segmentation(
      Describe({.faint_difference = 3, .texture_difference = 0, .faint_side = 5}));
  EXPECT_THAT(SegmentationAdvice({}, database),
              HasSubstr("'segmentation: {faint_difference: 3, faint_side: 5, "
                        "texture_difference: 0}'"));
  EXPECT_THAT(SegmentationAdvice({}, database), HasSubstr("silhouette-capture remask"));
  const auto settings = SegmentationIn("faint_difference: 3, faint_side: 5, texture_difference: 0",
                                       "the command line", {});
  ASSERT_TRUE(settings.ok()) << settings.status();
  EXPECT_EQ(SegmentationAdvice(*settings, database), "");
}

TEST(Segmentation, DatabaseWithoutThinPartsIsNotServedAsIfItHadThem) {
  storage::v1::CellDescription database;
  SegmentationSettings without;
  without.keep_thin_parts = false;
  database.set_segmentation(Describe(without));
  EXPECT_EQ(database.segmentation().find("thin"), std::string::npos) << "as it was captured then";
  EXPECT_THAT(SegmentationAdvice({}, database),
              HasSubstr("'segmentation: {keep_thin_parts: false}'"));
}

TEST(Segmentation, TextSaysWhatChangesAndRefusesWhatIsUnknown) {
  const SegmentationSettings usual{.min_difference = 5};
  EXPECT_EQ(
      *SegmentationIn("faint_side: 7, shadows: ignore", "--try", usual),
      (SegmentationSettings{.min_difference = 5, .faint_side = 7, .shadows = Shadows::kIgnore}));
  EXPECT_EQ(SegmentationIn("{faint_side: 7}", "--try", usual)->faint_side, 7);
  EXPECT_THAT(SegmentationIn("fant_side: 7", "--try", usual).status().message(),
              HasSubstr("did you mean 'faint_side'?"));
  EXPECT_THAT(SegmentationIn("x: 7", "--try", usual).status().message(),
              HasSubstr("known are 'clean_up_radius'"));
  EXPECT_FALSE(SegmentationIn("faint_side: 4", "--try", usual).ok());
}

// A view with this source.
std::string WithSource(const std::string& source) {
  return Changed("{name: top}", "{name: top, image_size: [640, 480], source: " + source + "}");
}

TEST(Cell, EverySourceInTheCommentedSampleIsOne) {
  std::ifstream in(SourceFolder() + "/docs/cell.yaml");
  size_t kinds = 0;
  for (std::string line; std::getline(in, line);) {
    static const std::regex sample(R"(^ *# source: (\{.*\})$)");
    std::smatch match;
    if (!std::regex_match(line, match, sample)) continue;
    const absl::StatusOr<Cell> cell = Load(WithSource(match[1]));
    ASSERT_TRUE(cell.ok()) << cell.status();
    EXPECT_TRUE(HasImages(cell->views[0].source));
    ++kinds;
  }
  EXPECT_GE(kinds, std::variant_size_v<ImageSource> - 2) << "all but none and sim";
}

TEST(Cell, SourcesAreReadInShortAndWithTheirSettings) {
  EXPECT_FALSE(HasImages(Load(kBareCell)->views[0].source));
  EXPECT_TRUE(IsSimulated(Load(WithSource("sim"))->views[0].source));
  auto cell = Load(WithSource("{v4l2: /dev/video3}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  V4l2Source camera = std::get<V4l2Source>(cell->views[0].source);
  EXPECT_EQ(camera.device, "/dev/video3");
  EXPECT_EQ(camera.exposure, std::nullopt);
  EXPECT_EQ(camera.latency, absl::Milliseconds(100));
  cell = Load(WithSource("{v4l2: {device: /dev/video3, exposure: 4 ms, gain: 2.5, latency: 0}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  camera = std::get<V4l2Source>(cell->views[0].source);
  EXPECT_EQ(camera.exposure, absl::Milliseconds(4));
  EXPECT_EQ(camera.gain, 2.5);
  EXPECT_EQ(camera.latency, absl::ZeroDuration());
  cell = Load(WithSource("{folder: images}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(std::get<FolderSource>(cell->views[0].source).folder,
            (TestFolder() / "images").string());
}

TEST(Cell, CamerasOfABusAreReadWithTheirTrigger) {
  auto cell = Load(WithSource("{gige: {serial: abc}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  GenicamSource camera = std::get<GenicamSource>(cell->views[0].source);
  EXPECT_EQ(camera.serial, "abc");
  EXPECT_EQ(camera.trigger, CameraTrigger::kSoftware);
  EXPECT_FALSE(camera.colour);
  cell = Load(WithSource("{usb3: {serial: 7, trigger: hardware, line: Line3, latency: 40 ms}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  camera = std::get<GenicamSource>(cell->views[0].source);
  EXPECT_EQ(camera.bus, GenicamSource::Bus::kUsb3);
  EXPECT_EQ(camera.serial, "7");
  EXPECT_EQ(camera.line, "Line3");
  EXPECT_EQ(camera.latency, absl::Milliseconds(40));
  cell = Load(WithSource("{grpc: \"localhost:1\"}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(std::get<GrpcSource>(cell->views[0].source).camera, "top") << "the view's name";
}

TEST(Cell, MistakesInSourcesAreToldWithTheMend) {
  const auto message = [](const std::string& source) {
    return std::string(Load(WithSource(source)).status().message());
  };
  EXPECT_THAT(message("usb"), HasSubstr("the source 'usb' is not known; a source is 'sim', or"));
  EXPECT_THAT(message("{gige: {exposure: 1 ms}}"), HasSubstr("'serial' or its 'address'"));
  EXPECT_THAT(message("{usb3: {address: 10.0.0.1}}"), HasSubstr("unknown key 'address'"));
  EXPECT_THAT(message("{gige: {serial: a, trigger: soft}}"), HasSubstr("'software', 'hardware'"));
  EXPECT_THAT(message("{gige: {serial: a, line: Line2}}"), HasSubstr("unknown key 'line'"));
  EXPECT_THAT(message("{gige: {serial: a, packet_size: 20}}"), HasSubstr("576 to 16384"));
  EXPECT_THAT(message("{v4l: /dev/video0}"), HasSubstr("did you mean 'v4l2'?"));
  EXPECT_THAT(message("{v4l2: {device: /dev/video0, exposre: 5}}"),
              HasSubstr("did you mean 'exposure'?"));
  EXPECT_THAT(message("{v4l2: {exposure: 5 ms}}"), HasSubstr("'device' is missing"));
  EXPECT_THAT(message("{v4l2: /dev/video0, rtsp: \"rtsp://x\"}"), HasSubstr("one source"));
  EXPECT_THAT(message("{rtsp: \"http://x\"}"), HasSubstr("begins with 'rtsp://'"));
  EXPECT_THAT(message("{v4l2: {device: /dev/video0, latency: 3 s}}"),
              HasSubstr("'timeout' must be longer than its 'latency'"));
  EXPECT_THAT(message("{v4l2: {device: /dev/video0, timeout: 0}}"), HasSubstr("a time above 0"));
  EXPECT_THAT(MessageOf(Changed("{name: top}", "{name: top, source: sim}")),
              HasSubstr("needs its image_size"));
}

// kBareCell with a driver.
std::string Driven(const std::string& driver) {
  return Changed("robot:\n", "robot:\n  driver: " + driver + "\n");
}

TEST(Cell, RobotIsDrivenByNobodyOrAsTheFileSays) {
  EXPECT_TRUE(std::holds_alternative<std::monostate>(Load(kBareCell)->robot.driver));
  EXPECT_TRUE(std::holds_alternative<SimulatedRobotDriver>(Load(Driven("sim"))->robot.driver));
  const auto least =
      Load(Driven("{simple_message: {host: robot, byte_order: big, joints: [b, a, c]}}"));
  ASSERT_TRUE(least.ok()) << least.status();
  const auto& settings = std::get<SimpleMessageSettings>(least->robot.driver);
  EXPECT_EQ(settings.host, "robot");
  EXPECT_EQ(settings.motion_port, 11000);
  EXPECT_EQ(settings.state_port, 11002);
  EXPECT_EQ(settings.byte_order, simple_message::ByteOrder::kBig);
  EXPECT_THAT(settings.joints, ElementsAre("b", "a", "c"));
  EXPECT_EQ(settings.trajectory, SimpleMessageSettings::Trajectory::kStreaming);
  EXPECT_EQ(settings.point, SimpleMessageSettings::PointMessage::kSimple);
  const auto all = Load(Driven(
      "{simple_message: {host: robot, byte_order: little, joints: [a, b, c], motion_port: 1,"
      " state_port: 2, trajectory: download, message: full, velocity: 0.5, timeout: 250 ms}}"));
  ASSERT_TRUE(all.ok()) << all.status();
  EXPECT_EQ(std::get<SimpleMessageSettings>(all->robot.driver).point,
            SimpleMessageSettings::PointMessage::kFull);
  EXPECT_EQ(std::get<SimpleMessageSettings>(all->robot.driver).velocity, 0.5);
  EXPECT_EQ(std::get<SimpleMessageSettings>(all->robot.driver).timeout, absl::Milliseconds(250));
}

TEST(Cell, RobotIsMovedByHandOrBySomebodysDriver) {
  auto cell = Load(Driven("manual"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_FALSE(std::get<ManualRobotSettings>(cell->robot.driver).typed);
  cell = Load(Driven("{manual: {joints: typed}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_TRUE(std::get<ManualRobotSettings>(cell->robot.driver).typed);
  cell = Load(Driven("{manual: {read: {grpc: {address: \"a:1\"}}}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  const auto& manual = std::get<ManualRobotSettings>(cell->robot.driver);
  EXPECT_EQ(std::get<GrpcRobotSettings>(manual.read).address, "a:1");
  cell = Load(Driven("{grpc: {address: \"robot:50061\", timeout: 2 s}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(std::get<GrpcRobotSettings>(cell->robot.driver).timeout, absl::Seconds(2));
  EXPECT_EQ(std::get<GrpcRobotSettings>(cell->robot.driver).tls, ClientTlsFiles());
  cell =
      Load(Driven("{grpc: {address: \"robot:1\", tls: {ca: a.pem, certificate: /b.pem, key: c}}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  const ClientTlsFiles& tls = std::get<GrpcRobotSettings>(cell->robot.driver).tls;
  EXPECT_EQ(tls.ca, (TestFolder() / "a.pem").string());
  EXPECT_EQ(tls.certificate, "/b.pem");
  EXPECT_THAT(MessageOf(Driven("{grpc: {address: \"robot:1\", tls: {ca: a.pem}}}")),
              HasSubstr("certificate"));
  EXPECT_THAT(MessageOf(Driven("grpc")), HasSubstr("say 'grpc: {address"));
  EXPECT_THAT(MessageOf(Driven("{grpc: {}}")), HasSubstr("address"));
  EXPECT_THAT(MessageOf(Driven("{manual: {read: {}}}")), HasSubstr("is expected"));
  EXPECT_THAT(MessageOf(Driven("{manual: {joints: guessed}}")), HasSubstr("'typed' or"));
}

TEST(Cell, WrongDriverIsToldWithTheMend) {
  EXPECT_THAT(MessageOf(Driven("staubli")), HasSubstr("'staubli' is not known; known are 'sim'"));
  EXPECT_THAT(MessageOf(Driven("simple_message")), HasSubstr("say at least"));
  const auto with = [](const std::string& settings) {
    return MessageOf(Driven("{simple_message: {host: robot, " + settings + "}}"));
  };
  EXPECT_THAT(with("joints: [a]"), HasSubstr("byte_order"));
  EXPECT_THAT(with("byte_order: middle, joints: [a]"), HasSubstr("'big' or 'little'"));
  EXPECT_THAT(with("byte_order: big, joints: [a], message: long"), HasSubstr("'full' or"));
  EXPECT_THAT(with("byte_order: big"), HasSubstr("joints"));
  EXPECT_THAT(with("byte_order: big, joints: [a, a]"), HasSubstr("named twice"));
  EXPECT_THAT(with("byte_order: big, joints: [a], state_port: 0"), HasSubstr("a port of 1"));
  EXPECT_THAT(with("byte_order: big, joints: [a], velocity: 2"), HasSubstr("a share above 0"));
  EXPECT_THAT(with("byte_order: big, joints: [a], prot: 1"), HasSubstr("unknown key 'prot'"));
}

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

// The simulated arm of which two joints move, about z and at the elbow.
std::string TwoJoints(const std::string& in_robot, const std::string& grid,
                      const std::string& rest) {
  return "name: x\nrobot:\n  urdf: " + SourceFolder() +
         "/capture/sim/robots/rx130.urdf\n  joints: [{name: joint_1}, {name: joint_3}]\n"
         "  fixed: {joint_2: 0, joint_4: 0, joint_5: 0, joint_6: 0}\n" +
         in_robot + "grid: {" + grid + "}\nviews: [{name: top}]\n" + rest;
}

TEST(Cell, LengthsInMillimetresOrCentimetresWithoutTheirUnitAreRefused) {
  const std::string metres = "a number without a unit is in metres";
  const auto grid = [](const std::string& max_move) {
    return TwoJoints("", "max_move: " + max_move, "");
  };
  EXPECT_THAT(MessageOf(grid("350")),
              AllOf(HasSubstr("grid.max_move: that is 350 m; at most 0.5 m"), HasSubstr(metres)));
  EXPECT_THAT(MessageOf(grid("0")), HasSubstr("greater than 0"));
  EXPECT_TRUE(Load(grid("0.5")).ok());
  EXPECT_EQ(Load(grid("350 mm"))->grid.size(), Load(grid("0.35"))->grid.size());

  const auto sound = [](const std::string& keys) {
    return TwoJoints("", "max_move: 0.3", "sound: {" + keys + "}\n");
  };
  for (const char* least : {"15", "150", "1.01", "2 m"}) {
    EXPECT_THAT(MessageOf(sound(std::string("least_obstacle: ") + least)),
                AllOf(HasSubstr("sound.least_obstacle: that is"), HasSubstr(metres)));
  }
  EXPECT_EQ(Load(sound("least_obstacle: 15 cm, voxel_edge: 20 mm"))->sound->least_obstacle, 0.15);
  EXPECT_THAT(MessageOf(sound("least_obstacle: 0.15, voxel_edge: 2")), HasSubstr(metres));
  EXPECT_THAT(MessageOf(sound("least_obstacle: 0.15, model_tolerance: 5")), HasSubstr(metres));
  EXPECT_THAT(MessageOf(TwoJoints("  payload_radius: 100\n", "max_move: 0.3", "")),
              AllOf(HasSubstr("payload_radius: that is 100 m; at most 3 m"), HasSubstr(metres)));
}

TEST(Cell, ARobotThatIsNotWhereItReportsCannotBeLetPassByCoreError) {
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "server: {max_core_error: 0.9}\n"),
              HasSubstr("server.max_core_error: at most 0.05"));
  EXPECT_TRUE(Load(std::string(kBareCell) + "server: {max_core_error: 0.05}\n").ok());
}

TEST(Cell, LongTimesAndWideStepsAreDoubted) {
  EXPECT_THAT(Doubts(*Load(kBareCell)), ElementsAre());
  const std::string server = "server: {max_age: 10 s, max_skew: 1 s}\n";
  EXPECT_THAT(Doubts(*Load(std::string(kBareCell) + server)), ElementsAre());
  EXPECT_THAT(Doubts(*Load(std::string(kBareCell) + "server: {max_age: 500, max_skew: 50}\n")),
              ElementsAre(HasSubstr("max_age: free verdicts may rest on images 8 min 20 s old; "
                                    "a number without a unit is in seconds"),
                          HasSubstr("max_skew: free verdicts may rest on images 50 s apart")));
  EXPECT_THAT(Doubts(*Load(TwoJoints("", "max_move: 0.5", ""))), ElementsAre());
  const std::string sound =
      "workspace: {lower: [-1.8, -1.8, 0], upper: [1.8, 1.8, 2.4]}\nsound: {least_obstacle: ";
  EXPECT_THAT(Doubts(*Load(TwoJoints("", "max_move: 0.5", sound + "0.25}\n"))), ElementsAre());
  EXPECT_THAT(Doubts(*Load(TwoJoints("", "max_move: 0.5", sound + "0.3}\n"))),
              ElementsAre(HasSubstr("least_obstacle: 0.3 m is a radius")));
  EXPECT_THAT(Doubts(*Load(TwoJoints("", "steps: {joint_1: 8, joint_3: 8}", ""))),
              ElementsAre(HasSubstr("people are 0.3 to 0.5 m thick")));
}

TEST(Cell, WorkspaceThatTheRobotLeavesAtAnyJointValuesIsRefused) {
  const auto status = [](const std::string& upper, const std::string& more = "",
                         const std::string& lower = "-1.8, -1.8, 0") {
    const auto cell =
        Load(TwoJoints("", "max_move: 0.3",
                       "workspace: {lower: [" + lower + "], upper: [" + upper + "]}\n" + more));
    EXPECT_TRUE(cell.ok()) << cell.status();
    const absl::Status holds = WorkspaceHoldsRobot(*cell);
    EXPECT_EQ(WorkspaceOf(*cell).status(), holds);
    return holds;
  };
  EXPECT_TRUE(status("1.8, 1.8, 2.4").ok());
  EXPECT_TRUE(status("1.8, 1.8, 2.4", "", "-1.8, -1.8, 0.2").ok()) << "its foot may be below";
  const absl::Status low = status("1.8, 1.8, 1");
  EXPECT_EQ(low.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(low.message()),
              AllOf(HasSubstr("m beyond the upper face of 'workspace' across z at joint_1 = "),
                    HasSubstr("enlarge 'workspace', in metres")));
  EXPECT_THAT(std::string(status("1.8, 1.8, 2.4", "", "0, 0, 0").message()),
              HasSubstr("beyond the lower face of 'workspace' across"));
  // To one side only, where it must not go.
  const std::string forbidden =
      "capture: {forbidden_regions: [{name: left, joints: {joint_1: [0.1, 3]}}, "
      "{name: right, joints: {joint_1: [-3, -0.1]}}]}\n";
  const std::string side = "1.8, 0.7, 2.4";
  EXPECT_THAT(std::string(status(side).message()), HasSubstr("upper face of 'workspace' across y"));
  EXPECT_TRUE(status(side, forbidden).ok()) << status(side, forbidden);
}

TEST(Cell, RobotImagesAreCapturedUnlessTheFileHasThemDrawn) {
  EXPECT_FALSE(Load(kBareCell)->robot.drawn.has_value());
  EXPECT_FALSE(DrawnCellOf(*Load(kBareCell))->has_value());
  const auto captured = Load(SixJoints("  images: captured\n", "grid: {max_move: 0.3}\n"));
  ASSERT_TRUE(captured.ok()) << captured.status();
  EXPECT_FALSE(captured->robot.drawn.has_value());

  const auto defaults = Load(SixJoints("  images: drawn\n"));
  ASSERT_TRUE(defaults.ok()) << defaults.status();
  EXPECT_EQ(defaults->robot.drawn->tolerance, 0.005);
  EXPECT_EQ(defaults->robot.drawn->geometry, BodyGeometry::kVisual);

  const auto cell = Load(SixJoints(
      "  payload_radius: 0.1\n  images: {drawn: {tolerance: 8 mm, geometry: collision}}\n",
      "capture: {forbidden_regions: [{name: door, joints: {joint_1: [0.5, 1]}}]}\n"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  const auto drawn = DrawnCellOf(*cell);
  ASSERT_TRUE(drawn.ok() && drawn->has_value()) << drawn.status();
  EXPECT_EQ((*drawn)->parts.tolerance, 0.008);
  EXPECT_EQ((*drawn)->parts.geometry, BodyGeometry::kCollision);
  EXPECT_EQ((*drawn)->payload_radius, 0.1);
  EXPECT_EQ((*drawn)->robot->joints().size(), 6u);
  const Configuration before{0, 0, 0, 0, 0, 0};
  const Configuration within{0.7, 0, 0, 0, 0, 0};
  EXPECT_TRUE((*drawn)->forbidden.Between(before, within));
  EXPECT_FALSE((*drawn)->forbidden.Between(before, before));
}

TEST(Cell, WithoutAGridOnlyTheLimitsOfADrawnRobotAreKnown) {
  const auto cell = Load(SixJoints("  images: drawn\n"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->grid.size(), 64u);
  EXPECT_EQ(cell->grid_move, 0);
  std::string still = SixJoints("  images: drawn\n");
  still = std::regex_replace(still, std::regex("joint_6"), "joint_6, lower: 0, upper: 0");
  EXPECT_EQ(Load(still)->grid.size(), 32u);
  const auto gridded = Load(SixJoints("  images: drawn\n", "grid: {max_move: 0.3}\n"));
  EXPECT_GT(gridded->grid.size(), 100'000u);
}

TEST(Cell, GridOfAnArmHasOneValueForEachJointOfTheWrist) {
  const std::string images = "  images: {drawn: {arm_joints: 3}}\n";
  const auto cell = Load(SixJoints(images, "grid: {max_move: 0.3}\n"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->robot.arm_joints, 3);
  EXPECT_TRUE(cell->robot.drawn.has_value());
  const auto whole = Load(SixJoints("  images: drawn\n", "grid: {max_move: 0.3}\n"));
  EXPECT_EQ(whole->robot.arm_joints, 0);
  for (size_t j = 0; j < 6; ++j) {
    EXPECT_EQ(cell->grid.joints()[j].any(), j >= 3);
    EXPECT_EQ(cell->grid.joints()[j].lower, whole->grid.joints()[j].lower);
    EXPECT_EQ(cell->grid.joints()[j].upper, whole->grid.joints()[j].upper);
    if (j < 3) {
      EXPECT_EQ(cell->grid.joints()[j].steps, whole->grid.joints()[j].steps);
    }
  }
  const auto steps =
      Load(SixJoints(images, "grid: {steps: {joint_1: 9, joint_2: 8, joint_3: 7}}\n"));
  ASSERT_TRUE(steps.ok()) << steps.status();
  EXPECT_EQ(steps->grid.size(), 9u * 8 * 7);
}

TEST(Cell, MistakesInTheGridOfAnArmAreNamed) {
  const auto with = [](const std::string& joints, const std::string& rest) {
    return MessageOf(SixJoints("  images: {drawn: {arm_joints: " + joints + "}}\n", rest));
  };
  EXPECT_THAT(with("3", ""), HasSubstr("arm_joints needs a 'grid'"));
  EXPECT_THAT(with("0", "grid: {max_move: 0.3}\n"), HasSubstr("state at least 1"));
  EXPECT_THAT(with("6", "grid: {max_move: 0.3}\n"),
              HasSubstr("arm_joints is 6, and 6 joints move; state fewer"));
  EXPECT_THAT(with("3", "grid: {steps: {joint_1: 9, joint_2: 8, joint_3: 1}}\n"),
              HasSubstr("one step goes with lower == upper"));
  EXPECT_THAT(with("2", "grid: {steps: {joint_1: 9, joint_2: 8, joint_3: 7}}\n"),
              HasSubstr("joint_3"));
}

TEST(Cell, MistakesInDrawnImagesAreNamed) {
  EXPECT_THAT(MessageOf(SixJoints("  images: painted\n")), HasSubstr("captured"));
  EXPECT_THAT(MessageOf(SixJoints("  images: {drawn: {tolerance: 5 inch}}\n")),
              HasSubstr("a length is expected: metres, or e.g. '5 mm'"));
  EXPECT_THAT(MessageOf(SixJoints("  images: {drawn: {tolerances: 5 mm}}\n")),
              HasSubstr("tolerance"));
  EXPECT_THAT(MessageOf(SixJoints("")), HasSubstr("the cell needs a 'grid', unless"));
  EXPECT_THAT(MessageOf(Changed("  joints:", "  images: drawn\n  joints:")),
              HasSubstr("images are drawn from the robot's model; state urdf"));
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

TEST(Cell, MaxMoveGridObeysTheLargestMovementAndSumDividesIt) {
  const std::string robots = SourceFolder() + "/capture/sim/robots/";
  const auto steps = [&](const std::string& rule) {
    const absl::StatusOr<Cell> cell = Load("name: x\nrobot:\n  urdf: " + robots +
                                           "rx130.urdf\n  joints:\n"
                                           "    - {name: joint_1, lower: -1, upper: 1}\n"
                                           "    - {name: joint_3, lower: -1, upper: 1}\n"
                                           "  fixed: {joint_2: 90 deg, joint_4: 0, joint_5: 0, "
                                           "joint_6: 0}\n"
                                           "grid: {max_move: 0.1, max_move_rule: " +
                                           rule + "}\nviews: [{name: top}]\n");
    EXPECT_TRUE(cell.ok()) << cell.status();
    return std::vector<int>{cell->grid.joints()[0].steps, cell->grid.joints()[1].steps};
  };
  const std::vector<int> each = steps("each");
  const std::vector<int> sum = steps("sum");
  EXPECT_GT(each[0], each[1]) << "the base moves the robot further than the elbow";
  // The reach of about 1.5 m at the base bounds a step of 0.1 m to about 1/15 rad.
  EXPECT_GE(each[0], 25);
  EXPECT_LE(each[0], 45);
  EXPECT_NEAR(sum[0], 2 * each[0], 2);
}

TEST(Cell, JointValuesHaveTheUnitOfTheirKind) {
  const auto folder = FreshFolder();
  WriteFile(folder / "gripper.urdf", GripperUrdf());
  const auto load = [&](const std::string& urdf, const std::string& lower) {
    return Load("name: x\nrobot:\n" + urdf + "  joints: [{name: left, lower: " + lower +
                ", upper: 0.2}]\n" +
                (urdf.empty() ? ""
                              : "  fixed: {joint0: 0, joint1: 0, joint2: 0, joint3: 0, joint4: 0, "
                                "joint5: 0, joint6: 0}\n") +
                "grid: {steps: {left: 3}}\nviews: [{name: top}]\n");
  };
  const std::string urdf = "  urdf: " + (folder / "gripper.urdf").string() + "\n";
  const absl::StatusOr<Cell> finger = load(urdf, "50 mm");
  ASSERT_TRUE(finger.ok()) << finger.status();
  EXPECT_DOUBLE_EQ(finger->grid.joints()[0].lower, 0.05);
  EXPECT_THAT(std::string(load(urdf, "1 deg").status().message()),
              HasSubstr("joints[0].lower: a position is expected"));
  EXPECT_THAT(std::string(load("", "-90").status().message()),
              HasSubstr("joints[0].lower: that is more than two turns; write degrees as '90 deg'"));
  const absl::StatusOr<Cell> bare = load("", "-50 cm");
  ASSERT_TRUE(bare.ok()) << bare.status();
  EXPECT_DOUBLE_EQ(bare->grid.joints()[0].lower, -0.5);
}

TEST(Cell, FolderOrImpossibleNameInPlaceOfTheFileIsTheUsersMistake) {
  EXPECT_THAT(std::string(LoadCell(FreshFolder().string()).status().message()),
              HasSubstr("is a folder; name a file"));
  EXPECT_THAT(std::string(LoadCell(std::string(5000, 'x')).status().message()),
              HasSubstr("does not exist or cannot be read"));
}

TEST(Cell, ViewsNameIsAFilesName) {
  EXPECT_THAT(std::string(Load("name: x\nrobot: {joints: [{name: a, lower: 0, upper: 1}]}\n"
                               "grid: {steps: {a: 3}}\nviews: [{name: ../top}]\n")
                              .status()
                              .message()),
              HasSubstr("a view's name has no '/'"));
}

// Of two fingers one mimics the other, and a tip turns as that one slides.
TEST(Cell, MaxMoveCountsJointsThatMimic) {
  const auto folder = FreshFolder();
  WriteFile(folder / "gripper.urdf", GripperUrdf());
  const absl::StatusOr<Cell> cell = Load(
      "name: x\nrobot:\n  urdf: " + (folder / "gripper.urdf").string() +
      "\n  joints: [{name: left}]\n"
      "  fixed: {joint0: 0, joint1: 0, joint2: 0, joint3: 0, joint4: 0, joint5: 0, joint6: 0}\n"
      "grid: {max_move: 0.05}\nviews: [{name: top}]\n");
  ASSERT_TRUE(cell.ok()) << cell.status();
  // The finger's 0.5 m alone would take eleven steps.
  EXPECT_GT(cell->grid.joints()[0].steps, 12);
  EXPECT_LE(cell->grid_move, 0.05);
  EXPECT_TRUE(cell->joint_slides.at("left"));
  EXPECT_FALSE(cell->joint_slides.at("joint1"));
}

TEST(Cell, MistakesAreToldWithLineAndMend) {
  EXPECT_THAT(MessageOf(Changed("views:", "vews:")),
              HasSubstr(".yaml:9: unknown key 'vews'; did you mean 'views'?"));
  EXPECT_THAT(MessageOf(Changed("a: 10, ", "")), HasSubstr("grid.steps: the key 'a' is missing"));
  EXPECT_THAT(MessageOf(Changed("a: 10", "a: 0")), HasSubstr("joint 'a'"));
  EXPECT_THAT(MessageOf(Changed("steps: {a: 10, b: 36}", "max_move: 0.1")),
              HasSubstr("max_move needs the robot's urdf"));
  EXPECT_THAT(MessageOf(Changed("steps: {a: 10, b: 36}", "{}")), HasSubstr("max_move or steps"));
  EXPECT_THAT(MessageOf(Changed("[32, 16]", "[32, 2000]")), HasSubstr("1 to 1024"));
  EXPECT_THAT(MessageOf(Changed("name: side", "name: top")),
              HasSubstr("another view called 'top'"));
  EXPECT_THAT(MessageOf(Changed("lower: 0", "lower: 100 deg")), HasSubstr("joint 'a'"));
  EXPECT_THAT(MessageOf(Changed("{name: a, lower: 0, ", "{name: a, ")),
              HasSubstr("'lower' is missing"));
  EXPECT_THAT(MessageOf(Changed("{c: 0.5}", "{a: 0.5}")), HasSubstr("moves; it cannot be fixed"));
  for (const char* degrees :
       {"capture: {joint_tolerance: 1}\n", "server: {fixed_joint_tolerance: 1}\n",
        "server: {max_joint_movement: 1}\n"}) {
    EXPECT_THAT(MessageOf(std::string(kBareCell) + degrees), HasSubstr("write degrees as '1 deg'"));
  }
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "capture: {joint_tolerance: 0.01}\n"),
              HasSubstr("capture: joint_tolerance, 0.01, is more than the server's "
                        "fixed_joint_tolerance, 0.005"));
  EXPECT_TRUE(Load(std::string(kBareCell) + "capture: {joint_tolerance: 0.01}\n" +
                   "server: {fixed_joint_tolerance: 0.01}\n")
                  .ok());
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "policy: {min_views: 3}\n"),
              HasSubstr("min_views"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "policy: {preset: brave}\n"),
              HasSubstr("the presets are 'uncalibrated', 'paper'"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "calibration: {margin: -1}\n"),
              HasSubstr("calibration.margin: a number not below 0 is expected"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) +
                        "capture:\n  forbidden_regions: [{name: x, joints: {d: [0, 1]}}]\n"),
              HasSubstr("'d' is not a joint of the grid"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "capture: {commit_interval: 5 s}\n"),
              HasSubstr("at most 2 s"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "capture: {raw_images: some}\n"),
              HasSubstr("capture.raw_images: 'none', 'sentinels' or 'all' is expected"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "capture: {sentinels: {most_shift: 2}}\n"),
              HasSubstr("most_shift: a number of pixels is expected, as in '1 px'"));
}

TEST(Cell, JointsThatTheModelLacksOrThatAreNotNamedAreTold) {
  const std::string robots = SourceFolder() + "/capture/sim/robots/";
  const auto message = [&](const std::string& joint, const std::string& fixed) {
    return MessageOf("name: x\nrobot:\n  urdf: " + robots + "rx130.urdf\n  joints: [" + joint +
                     "]\n  fixed: " + fixed + "\ngrid: {max_move: 0.1}\nviews: [{name: top}]\n");
  };
  EXPECT_THAT(message("{name: joint_7}", "{}"), HasSubstr("joint_7"));
  EXPECT_THAT(message("{name: joint_1}", "{joint_2: 0}"),
              HasSubstr("say where 'joint_3', 'joint_4', 'joint_5' and 'joint_6' stand"));
  EXPECT_THAT(message("{name: joint_1, upper: 300 deg}", "{}"), HasSubstr("limit"));
}

TEST(Cell, MissingFileIsTold) {
  EXPECT_EQ(LoadCell("/nowhere/cell.yaml").status().message(),
            "/nowhere/cell.yaml: the file does not exist or cannot be read");
}

TEST(Cell, MarginOfAViewGoesBeforeThatOfTheCell) {
  const absl::StatusOr<Cell> cell =
      Load(Changed("{name: top}", "{name: top, margin: 1.5 px, ignore: pillar.png}") +
           "margin: 5 cm\nworkspace: {lower: [-1, -2, 0], upper: [1, 2, 3]}\n");
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->views[0].margin.pixels, 1.5);
  EXPECT_EQ(cell->views[0].margin.metres, 0);
  EXPECT_EQ(cell->views[0].ignore, (TestFolder() / "pillar.png").string());
  EXPECT_EQ(cell->views[1].margin.pixels, 0);
  EXPECT_EQ(cell->views[1].margin.metres, 0.05);
  EXPECT_EQ(cell->views[1].ignore, "");
  EXPECT_EQ(WorkspaceOf(*cell)->max(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(Load(Changed("{name: top}", "{name: top, margin: 5mm}"))->views[0].margin.metres,
            0.005);
}

TEST(Cell, SourcesHaveNoiseUnlessTheirViewSaysOtherwise) {
  const absl::StatusOr<Cell> cell = Load(Changed("{name: top}", "{name: top, noise: none}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_FALSE(cell->views[0].has_noise);
  EXPECT_TRUE(cell->views[1].has_noise);
  EXPECT_THAT(MessageOf(Changed("{name: top}", "{name: top, noise: little}")),
              HasSubstr("'camera' or 'none'"));
}

TEST(Cell, MistakesInMarginAndWorkspaceAreNamed) {
  for (const char* margin : {"5", "px", "-1 px", "2 inch", "1e999 m", ""}) {
    EXPECT_THAT(
        MessageOf(Changed("{name: top}", std::string("{name: top, margin: \"") + margin + "\"}")),
        HasSubstr("a margin with its unit is expected"))
        << margin;
  }
  EXPECT_THAT(
      MessageOf(std::string(kBareCell) + "workspace: {lower: [0, 0, 0], upper: [1, 0, 1]}\n"),
      HasSubstr("it must lie above 'lower'"));
  EXPECT_THAT(std::string(WorkspaceOf(*Load(kBareCell)).status().message()),
              HasSubstr("say 'workspace', or the robot's 'urdf'"));
}

}  // namespace
}  // namespace silhouette
