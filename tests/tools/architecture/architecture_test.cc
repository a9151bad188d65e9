// The layers of the project: who may include whom. docs/architecture.md shows the same table.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

struct Layer {
  std::set<std::string> may_use;    // other layers
  std::set<std::string> libraries;  // heavy libraries, by the first part of their headers' paths
};

const std::map<std::string, Layer>& Layers() {
  static const std::map<std::string, Layer> layers = {
      {"mask", {{}, {}}},
      {"camera", {{}, {"Eigen"}}},
      {"calibration", {{"camera", "proto_storage", "yaml"}, {"Eigen", "yaml-cpp"}}},
      {"tags", {{"yaml"}, {"Eigen", "yaml-cpp", "apriltag"}}},
      {"board_print", {{"tags"}, {"apriltag", "cairo"}}},
      {"detection", {{"tags", "camera"}, {"Eigen", "opencv2", "apriltag"}}},
      {"intrinsics",
       {{"tags", "camera", "calibration", "proto_storage", "yaml"},
        {"Eigen", "opencv2", "mrcal", "yaml-cpp"}}},
      {"poses", {{"tags", "camera", "kinematics", "yaml"}, {"Eigen", "opencv2", "ceres"}}},
      {"fundamental", {{"tags", "camera", "yaml"}, {"Eigen", "opencv2", "ceres"}}},
      {"report", {{"poses", "fundamental", "tags", "camera", "page"}, {"Eigen"}}},
      {"kinematics", {{}, {"Eigen", "urdf_parser", "urdf_model", "assimp"}}},
      {"session", {{"kinematics"}, {"Eigen"}}},
      {"index", {{"mask"}, {}}},
      {"store", {{"mask", "index", "proto_storage"}, {"lmdb.h", "lz4.h", "xxhash.h"}}},
      {"collision", {{"mask", "index", "camera"}, {"Eigen"}}},
      {"segmentation", {{"mask"}, {"opencv2"}}},
      {"scene",
       {{"mask", "index", "store", "proto_storage", "camera", "calibration", "collision",
         "segmentation", "kinematics"},
        {"Eigen", "opencv2"}}},
      {"live",
       {{"scene", "mask", "store", "proto_storage", "devices", "segmentation", "capture"},
        {"spdlog", "opencv2"}}},
      {"service",
       {{"scene", "live", "proto", "mask", "store", "collision", "segmentation", "picture",
         "shared_map"},
        {"grpcpp", "grpc", "spdlog", "opencv2", "prometheus"}}},
      {"devices", {{"mask"}, {}}},
      {"drivers", {{"devices"}, {}}},
      {"grpc_robot", {{"drivers", "devices", "proto"}, {"grpcpp"}}},
      {"opencv_camera", {{"drivers", "devices"}, {"opencv2"}}},
      {"aravis_camera", {{"drivers", "devices", "opencv_camera"}, {"arv.h", "opencv2"}}},
      {"grpc_camera", {{"drivers", "devices", "opencv_camera", "proto"}, {"grpcpp", "opencv2"}}},
      {"served_cameras", {{"devices", "sim", "proto"}, {"arv.h", "gst", "grpcpp"}}},
      {"capture",
       {{"devices", "mask", "store", "proto_storage", "segmentation", "kinematics"}, {"opencv2"}}},
      {"sim",
       {{"devices", "camera", "kinematics", "mask", "yaml", "tags"},
        {"Eigen", "embree3", "fcl", "apriltag"}}},
      {"served", {{"devices", "mask", "drivers", "sim", "kinematics", "proto"}, {"grpcpp"}}},
      {"shared_map", {{}, {}}},
      {"client", {{"mask", "proto", "shared_map"}, {"grpcpp", "grpc"}}},
      {"planners", {{"mask"}, {}}},
      {"yaml", {{}, {"yaml-cpp"}}},
      {"program", {{}, {"CLI"}}},
      {"picture", {{"mask"}, {"opencv2"}}},
      {"page", {{}, {}}},
      {"placement",
       {{"mask", "camera", "kinematics", "collision", "sim", "picture", "yaml"},
        {"Eigen", "opencv2"}}},
      {"cell",
       {{"mask", "store", "proto_storage", "segmentation", "collision", "scene", "live", "capture",
         "drivers", "kinematics", "yaml"},
        {"yaml-cpp", "Eigen"}}},
      {"open_devices",
       {{"devices", "mask", "capture", "sim", "cell", "drivers", "kinematics", "opencv_camera",
         "aravis_camera", "grpc_camera", "grpc_robot"},
        {}}},
      {"cell_experiment",
       {{"mask", "store", "proto_storage", "camera", "calibration", "kinematics", "devices",
         "capture", "segmentation", "sim", "collision", "scene", "cell", "picture"},
        {"Eigen", "opencv2"}}},
      {"segmentation_experiment",
       {{"mask", "kinematics", "devices", "segmentation", "sim", "picture"}, {"Eigen", "opencv2"}}},
      {"paper_experiment",
       {{"mask", "camera", "collision", "yaml", "picture"}, {"Eigen", "opencv2"}}},
  };
  return layers;
}

// Libraries that only the layers named above may include. Everything else (the standard library,
// absl, nlohmann) is for all but the pure core.
const std::set<std::string> kHeavy = {
    "Eigen",   "urdf_parser", "urdf_model", "lmdb.h",     "lz4.h",    "xxhash.h",
    "opencv2", "grpcpp",      "grpc",       "spdlog",     "embree3",  "assimp",
    "fcl",     "CLI",         "yaml-cpp",   "prometheus", "apriltag", "cairo",
    "mrcal",   "ceres",       "arv.h",      "gst"};
const std::set<std::string> kPureCore = {"mask", "index", "camera", "collision", "shared_map"};

// The layer of a file, by its path from the project's root; "" for a program, which sits on top of
// everything.
std::string LayerOf(const std::string& path) {
  static const std::vector<std::pair<std::string, std::string>> places = {
      {"db/mask.", "mask"},
      {"db/configuration_grid.", "mask"},
      {"db/program/", ""},
      {"db/index/", "index"},
      {"db/", "store"},
      {"calib/camera_", "camera"},
      {"calib/calibration.", "camera"},
      {"calib/calibration_", "calibration"},
      {"calib/epipolar_", "camera"},
      {"calib/pixels_per_metre.", "camera"},
      {"calib/tags/", "tags"},
      {"calib/board_print/", "board_print"},
      {"calib/detection/", "detection"},
      {"calib/intrinsics/", "intrinsics"},
      {"calib/poses/", "poses"},
      {"calib/fundamental/", "fundamental"},
      {"calib/report/", "report"},
      {"calib/session/", "session"},
      {"calib/program/", ""},
      {"calib/", "kinematics"},
      {"server/collision/", "collision"},
      {"server/scene/", "scene"},
      {"server/live/", "live"},
      {"server/service/", "service"},
      {"server/program/", ""},
      {"capture/devices/devices.h", "devices"},
      {"capture/drivers/aravis_", "aravis_camera"},
      {"capture/drivers/grpc_camera.", "grpc_camera"},
      {"capture/drivers/opencv_", "opencv_camera"},
      {"capture/drivers/recorded_camera.", "opencv_camera"},
      {"capture/drivers/stream_camera.", "opencv_camera"},
      {"capture/drivers/grpc_robot_", "grpc_robot"},
      {"capture/drivers/", "drivers"},
      {"capture/segmentation/", "segmentation"},
      {"capture/sim/program/", ""},
      {"capture/sim/served/served_views.", "served_cameras"},
      {"capture/sim/served/gige_cameras.", "served_cameras"},
      {"capture/sim/served/rtsp_cameras.", "served_cameras"},
      {"capture/sim/served/grpc_cameras.", "served_cameras"},
      {"capture/sim/served/", "served"},
      {"capture/sim/", "sim"},
      {"capture/open_devices/", "open_devices"},
      {"capture/program/", ""},
      {"capture/", "capture"},
      {"clients/cpp/example/", ""},
      {"clients/cpp/", "client"},
      {"clients/shared_map/", "shared_map"},
      {"silhouette/storage/", "proto_storage"},
      {"silhouette/v1/", "proto"},
      {"silhouette/", "client"},
      {"clients/planners/", "planners"},
      {"clients/program/", ""},
      {"tools/yaml/", "yaml"},
      {"tools/program/", "program"},
      {"tools/picture/", "picture"},
      {"tools/page/", "page"},
      {"tools/cell/", "cell"},
      {"tools/experiments/placement/", "placement"},
      {"tools/experiments/cell/", "cell_experiment"},
      {"tools/experiments/paper/", "paper_experiment"},
      {"tools/experiments/segmentation/", "segmentation_experiment"},
      {"tools/experiments/", ""},
  };
  for (const auto& [prefix, layer] : places) {
    if (path.starts_with(prefix)) return layer;
  }
  return "?";
}

std::vector<std::string> SourceFiles(const fs::path& root) {
  std::vector<std::string> files;
  for (const char* folder : {"db", "calib", "capture", "server", "clients", "tools"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const std::string extension = entry.path().extension().string();
      if (extension == ".h" || extension == ".cc") {
        files.push_back(fs::relative(entry.path(), root).string());
      }
    }
  }
  return files;
}

std::vector<std::string> IncludesOf(const fs::path& file) {
  static const std::regex include(R"(^\s*#\s*include\s*[<"]([^>"]+)[>"])");
  std::vector<std::string> includes;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    std::smatch match;
    if (std::regex_search(line, match, include)) includes.push_back(match[1]);
  }
  return includes;
}

// What is wrong with `path`, of the layer `layer`, including `include`; empty if nothing is.
std::string Fault(const std::string& path, const std::string& layer, const std::string& include) {
  const Layer& rules = Layers().at(layer);
  const std::string first = include.substr(0, include.find('/'));
  const std::string target = LayerOf(include);
  if (target == "?") {
    if (kHeavy.contains(first) && !rules.libraries.contains(first)) {
      return path + ": the layer '" + layer + "' must not use the library of <" + include + ">";
    }
    if (kPureCore.contains(layer) && (first == "absl" || first == "nlohmann")) {
      return path + ": the pure core must not use <" + include + ">";
    }
    return "";
  }
  if (target.empty()) return path + ": no layer may use a program's " + include;
  if (target == layer || rules.may_use.contains(target)) return "";
  return path + ": the layer '" + layer + "' must not use '" + target + "' (" + include + ")";
}

TEST(Architecture, EveryIncludeFollowsAnArrowOfTheTable) {
  const fs::path root = SILHOUETTE_SOURCE_DIR;
  const std::vector<std::string> files = SourceFiles(root);
  ASSERT_GT(files.size(), 10u);
  for (const std::string& path : files) {
    const std::string layer = LayerOf(path);
    EXPECT_NE(layer, "?") << path << " belongs to no layer";
    if (layer.empty() || layer == "?") continue;
    for (const std::string& include : IncludesOf(root / path)) {
      EXPECT_EQ(Fault(path, layer, include), "");
    }
  }
}

TEST(Architecture, ArrowsNeverLeadBack) {
  // A layer reaches only layers that do not reach it.
  std::map<std::string, std::set<std::string>> reached;
  const auto reach = [&](const auto& self, const std::string& from, const std::string& at) -> void {
    const auto found = Layers().find(at);
    if (found == Layers().end()) return;
    for (const std::string& next : found->second.may_use) {
      if (reached[from].insert(next).second) self(self, from, next);
    }
  };
  for (const auto& [layer, rules] : Layers()) reach(reach, layer, layer);
  for (const auto& [layer, targets] : reached) EXPECT_FALSE(targets.contains(layer)) << layer;
}

TEST(Architecture, ForbiddenArrowIsFound) {
  EXPECT_NE(Fault("db/mask/mask.cc", "mask", "lmdb.h"), "");
  EXPECT_NE(Fault("db/mask/mask.cc", "mask", "absl/status/status.h"), "");
  EXPECT_NE(Fault("db/store/store.cc", "store", "server/scene/scene.h"), "");
  EXPECT_NE(Fault("server/scene/scene.cc", "scene", "server/program/main.h"), "");
  EXPECT_EQ(Fault("server/scene/scene.cc", "scene", "db/store/store.h"), "");
  EXPECT_EQ(Fault("db/mask/mask.cc", "mask", "vector"), "");
}

// The compiler does not tell, the linker takes either.
TEST(Architecture, NoTypeIsDefinedInTwoHeaders) {
  static const std::regex space(R"(^namespace ([\w:]+) \{)");
  static const std::regex definition(
      R"(^(?:struct|class|enum class) (\w+)(?: final)?(?: : [^;]*)? \{)");
  const fs::path root = SILHOUETTE_SOURCE_DIR;
  std::map<std::string, std::string> headers;  // by the type
  for (const std::string& path : SourceFiles(root)) {
    if (!path.ends_with(".h")) continue;
    std::string around;
    std::ifstream in(root / path);
    for (std::string line; std::getline(in, line);) {
      std::smatch match;
      if (std::regex_search(line, match, space)) around = match[1];
      if (!std::regex_search(line, match, definition)) continue;
      const auto [first, is_new] = headers.emplace(around + "::" + match[1].str(), path);
      EXPECT_TRUE(is_new) << first->first << " is in " << first->second << " and in " << path;
    }
  }
  EXPECT_GT(headers.size(), 100u);
}

}  // namespace
