// SPDX-License-Identifier: Apache-2.0
// The house and its one direction: CMake's link graph (build/<preset>/architecture.txt) and all
// includes against the rules of docs/architecture.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/folders.h"

namespace {

namespace fs = std::filesystem;
using Names = std::set<std::string>;

const fs::path kSource = silhouette::SourceFolder();
const fs::path kBuild = silhouette::BuildFolder();

// A room uses only itself and the rooms before it.
const std::vector<std::string> kRooms = {"proto",   "db",     "common",  "calib",
                                         "capture", "server", "clients", "tools"};
// What clients/ may use of the other rooms.
const Names kForClients = {"proto", "proto/tls", "db/mask", "calib/camera", "calib/robot/drawing"};
// The pure core knows the standard library and Eigen alone.
const Names kPureCore = {"db/mask", "db/index", "calib/camera", "calib/robot/drawing",
                         "server/collision"};

// Who includes a header that begins like this links a library of this name.
const std::map<std::string, std::string> kLibraries = {{"Eigen/", "Eigen"},
                                                       {"opencv2/", "opencv"},
                                                       {"libavcodec/", "ffmpeg"},
                                                       {"libavformat/", "ffmpeg"},
                                                       {"libavutil/", "ffmpeg"},
                                                       {"libswscale/", "ffmpeg"},
                                                       {"grpcpp/", "gRPC"},
                                                       {"yaml-cpp/", "yaml-cpp"},
                                                       {"ceres/", "Ceres"},
                                                       {"mrcal/", "mrcal"},
                                                       {"apriltag/", "apriltag"},
                                                       {"cairo/", "cairo"},
                                                       {"lmdb.h", "lmdb"},
                                                       {"openssl/", "OpenSSL"},
                                                       {"lz4.h", "lz4"},
                                                       {"lz4frame.h", "lz4"},
                                                       {"pybind11/", "pybind11"},
                                                       {"xxhash.h", "xxhash"},
                                                       {"systemd/", "systemd"},
                                                       {"embree3/", "embree"},
                                                       {"assimp/", "assimp"},
                                                       {"fcl/", "fcl"},
                                                       {"libqhull_r/", "Qhull"},
                                                       {"urdf_parser/", "urdfdom"},
                                                       {"urdf_model/", "urdfdom"},
                                                       {"arv.h", "aravis"},
                                                       {"gst/", "gst"},
                                                       {"prometheus/", "prometheus"},
                                                       {"spdlog/", "spdlog"},
                                                       {"ompl/", "ompl"},
                                                       {"CLI/", "CLI11"},
                                                       {"httplib.h", "httplib"}};

struct Folder {
  Names folders;    // linked, of this project
  Names libraries;  // linked, of others
};
using House = std::map<std::string, Folder>;

std::string Underscored(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '/' || c == '-'; }, '_');
  return text;
}

House ReadHouse() {
  std::map<std::string, std::string> folders = {
      {"proto_storage", "proto"}, {"proto_health", "proto"}, {"client", "clients/cpp"}};
  std::vector<std::pair<std::string, std::string>> lines;
  std::ifstream in(kBuild / "architecture.txt");
  for (std::string line; std::getline(in, line);) {
    const size_t colon = line.find(':');
    lines.emplace_back(line.substr(0, colon), line.substr(colon + 1));
    folders.emplace(Underscored(lines.back().first), lines.back().first);
  }
  House house;
  for (const auto& [name, links] : lines) {
    Folder& folder = house[name];
    std::istringstream words(links);
    for (std::string link; words >> link;) {
      if (!link.starts_with("silhouette::")) {
        folder.libraries.insert(link);
      } else if (const std::string& linked = folders.at(link.substr(12)); linked != name) {
        folder.folders.insert(linked);
      }
    }
  }
  return house;
}

size_t RoomOf(const std::string& folder) {
  const std::string room = folder.substr(0, folder.find('/'));
  return static_cast<size_t>(std::ranges::find(kRooms, room) - kRooms.begin());
}

// The folder and all that it links, one after the other.
Names ReachedFrom(const House& house, const std::string& folder) {
  Names reached = {folder};
  std::vector<std::string> open = {folder};
  while (!open.empty()) {
    const std::string at = open.back();
    open.pop_back();
    for (const std::string& next : house.at(at).folders) {
      if (reached.insert(next).second) open.push_back(next);
    }
  }
  return reached;
}

// Why `from` must not use `to`; empty if it may.
std::string ForbiddenArrow(const std::string& from, const std::string& to) {
  if (RoomOf(to) > RoomOf(from)) return from + " uses " + to + ", a room after its own";
  if (from.starts_with("clients/") && !to.starts_with("clients/") && !kForClients.contains(to)) {
    return from + " uses " + to + "; clients use proto and db/mask alone";
  }
  return "";
}

// The folder that owns a file or an included path; empty if it is nobody's.
std::string OwnerOf(const House& house, const std::string& path) {
  if (path.starts_with("silhouette/v1/") || path.starts_with("silhouette/storage/") ||
      path.starts_with("grpc/health/")) {
    return "proto";
  }
  if (path.starts_with("silhouette/")) return "clients/cpp";
  for (fs::path at = fs::path(path).parent_path(); !at.empty(); at = at.parent_path()) {
    if (house.contains(at.string())) return at.string();
  }
  return "";
}

// Why a file of `folder` must not include `include`; empty if it may.
std::string ForbiddenInclude(const House& house, const std::string& folder,
                             const std::string& include) {
  const Names reached = ReachedFrom(house, folder);
  const std::string owner = OwnerOf(house, include);
  if (!owner.empty() && !reached.contains(owner)) return "does not link " + owner;
  if (kPureCore.contains(folder) &&
      (include.starts_with("absl/") || include.starts_with("nlohmann/"))) {
    return "is of the pure core";
  }
  for (const auto& [header, library] : kLibraries) {
    if (!include.starts_with(header)) continue;
    const bool linked = std::ranges::any_of(reached, [&, &sought = library](const std::string& at) {
      return std::ranges::any_of(house.at(at).libraries, [&](const std::string& name) {
        return name.find(sought) != std::string::npos;
      });
    });
    if (!linked) return "does not link " + library;
  }
  return "";
}

std::vector<std::string> SourceFiles() {
  std::vector<std::string> files;
  for (const std::string& room : kRooms) {
    for (const auto& entry : fs::recursive_directory_iterator(kSource / room)) {
      const std::string path = fs::relative(entry.path(), kSource).string();
      const std::string extension = entry.path().extension().string();
      if ((extension == ".h" || extension == ".cc") && path.find("/example/") == path.npos) {
        files.push_back(path);
      }
    }
  }
  return files;
}

std::vector<std::string> IncludesOf(const std::string& path) {
  static const std::regex include(R"(^\s*#\s*include\s*[<"]([^>"]+)[>"])");
  std::vector<std::string> includes;
  std::ifstream in(kSource / path);
  for (std::string line; std::getline(in, line);) {
    std::smatch match;
    if (std::regex_search(line, match, include)) includes.push_back(match[1]);
  }
  return includes;
}

TEST(Architecture, EveryLinkLeadsToARoomBefore) {
  const House house = ReadHouse();
  ASSERT_GT(house.size(), 30u);
  for (const auto& [name, folder] : house) {
    ASSERT_LT(RoomOf(name), kRooms.size()) << name << " is in no room";
    for (const std::string& linked : folder.folders) EXPECT_EQ(ForbiddenArrow(name, linked), "");
  }
}

TEST(Architecture, NoFolderLinksBackToItself) {
  const House house = ReadHouse();
  for (const auto& [name, folder] : house) {
    for (const std::string& linked : folder.folders) {
      EXPECT_FALSE(ReachedFrom(house, linked).contains(name)) << name << " and " << linked;
    }
  }
}

TEST(Architecture, EveryIncludeIsOfWhatIsLinked) {
  const House house = ReadHouse();
  const std::vector<std::string> files = SourceFiles();
  ASSERT_GT(files.size(), 100u);
  for (const std::string& path : files) {
    const std::string folder = OwnerOf(house, path);
    ASSERT_NE(folder, "") << path << " is in no folder with a target";
    for (const std::string& include : IncludesOf(path)) {
      EXPECT_EQ(ForbiddenInclude(house, folder, include), "") << path << ": " << include;
    }
  }
}

TEST(Architecture, ThePureCoreLinksNoLibraryButEigen) {
  const House house = ReadHouse();
  for (const std::string& name : kPureCore) {
    for (const std::string& folder : ReachedFrom(house, name)) {
      EXPECT_TRUE(kPureCore.contains(folder)) << name << " uses " << folder;
      for (const std::string& library : house.at(folder).libraries) {
        EXPECT_EQ(library, "Eigen3::Eigen") << folder;
      }
    }
  }
}

TEST(Architecture, ForbiddenArrowsAreFound) {
  const House house = ReadHouse();
  EXPECT_NE(ForbiddenArrow("db/store", "server/scene"), "");
  EXPECT_NE(ForbiddenArrow("clients/cpp", "db/store"), "");
  EXPECT_NE(ForbiddenInclude(house, "db/mask", "lmdb.h"), "");
  EXPECT_NE(ForbiddenInclude(house, "db/mask", "absl/status/status.h"), "");
  EXPECT_NE(ForbiddenInclude(house, "db/store", "server/scene/scene.h"), "");
  EXPECT_NE(ForbiddenInclude(house, "server/scene", "tools/silhouette-db/common.h"), "");
  EXPECT_EQ(ForbiddenInclude(house, "server/scene", "db/store/store.h"), "");
  EXPECT_EQ(ForbiddenInclude(house, "db/mask", "vector"), "");
}

TEST(Architecture, TheTableOfTheDocumentIsThatOfTheLinkGraph) {
  const std::string command = "python3 '" + (kSource / "tools/architecture").string() +
                              "' --check --build '" + kBuild.string() + "'";
  EXPECT_EQ(std::system(command.c_str()), 0);
}

// Neither the compiler nor the linker reports two types of one name.
TEST(Architecture, NoTypeIsDefinedInTwoHeaders) {
  static const std::regex space(R"(^namespace ([\w:]+) \{)");
  static const std::regex definition(
      R"(^(?:struct|class|enum class) (\w+)(?: final)?(?: : [^;]*)? \{)");
  std::map<std::string, std::string> headers;  // by the type
  for (const std::string& path : SourceFiles()) {
    if (!path.ends_with(".h")) continue;
    std::string around;
    std::ifstream in(kSource / path);
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
