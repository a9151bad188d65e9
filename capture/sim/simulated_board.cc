#include "capture/sim/simulated_board.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "calib/boards/board.h"
#include "capture/sim/board_texture.h"
#include "capture/sim/yaml_values.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// The board of a name in a file of boards, whose path is relative to the simulation's file.
Board BoardOfFile(const YamlNode& file, const YamlNode& name) {
  const fs::path path = fs::path(file.file()).parent_path() / file.As<std::string>();
  std::ifstream in(path);
  if (!in) file.Fail("the file '" + path.string() + "' does not exist or cannot be read");
  std::stringstream text;
  text << in.rdbuf();
  const auto boards = BoardsFromText(text.str(), path.string());
  if (!boards.ok()) file.Fail(std::string(boards.status().message()));
  std::vector<std::string> names;
  for (const Board& board : *boards) {
    names.push_back(board.description().name);
    if (names.back() == name.As<std::string>()) return board;
  }
  name.Fail("the boards of '" + path.string() + "' are " + ListOfWords(names));
}

SimulatedBoard ReadSimulatedBoard(const YamlNode& node) {
  YamlMap map(node);
  const YamlNode file = map.Required("file");
  SimulatedBoard board{.board = BoardOfFile(file, map.Required("name"))};
  if (const auto margin = map.Optional("margin")) board.margin = ReadNotNegative(*margin);
  board.link = map.Get<std::string>("link", "");
  board.always = map.Get<bool>("always", true);
  const auto position = map.Optional("position");
  const auto rotation = map.Optional("rotation");
  const bool held = map.Get<bool>("held", false);
  if (held == position.has_value()) {
    node.Fail("a board needs either a 'position' in the world or on its 'link', or 'held: true'");
  }
  if (held && (rotation || !board.link.empty())) {
    node.Fail("a board that is held has neither 'rotation' nor 'link'");
  }
  if (position) {
    board.pose = Eigen::Translation3d(ReadVector(*position)) *
                 (rotation ? ReadRotation(*rotation) : Eigen::Quaterniond::Identity());
  }
  map.Finish();
  return board;
}

}  // namespace

std::vector<SimulatedBoard> ReadBoards(const YamlNode& node) {
  std::vector<SimulatedBoard> boards;
  std::vector<Board> all;
  for (const YamlNode& item : node.Items()) {
    boards.push_back(ReadSimulatedBoard(item));
    all.push_back(boards.back().board);
    const absl::Status fault = CheckBoards(all);
    if (!fault.ok()) item.Fail(std::string(fault.message()));
  }
  return boards;
}

}  // namespace silhouette
