// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include <fstream>
#include <regex>
#include <variant>

#include "tests/folders.h"
#include "tests/test_folder.h"
#include "tests/tools/cell/cell_file.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

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
  EXPECT_EQ(camera.offset_x, 0);
  cell = Load(WithSource("{gige: {serial: abc, offset: [320, 120]}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  camera = std::get<GenicamSource>(cell->views[0].source);
  EXPECT_EQ(camera.offset_x, 320);
  EXPECT_EQ(camera.offset_y, 120);
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

TEST(Cell, ViewsNameIsAFilesName) {
  const auto message = [](const std::string& name) {
    return std::string(Load("name: x\nrobot: {joints: [{name: a, lower: 0, upper: 1}]}\n"
                            "grid: {steps: {a: 3}}\nviews: [{name: " +
                            name + "}]\n")
                           .status()
                           .message());
  };
  EXPECT_THAT(message("../top"), HasSubstr("a view's name has no '/'"));
  EXPECT_THAT(message(std::string(101, 'x')), HasSubstr("at most 100 characters"));
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
