// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/simulated_board.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "calib/boards/board.h"
#include "calib/boards/board_print.h"
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
  map.Read("margin", board.margin, &YamlNode::AsNotNegative);
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

namespace {

// Of a paper, along each side; they only speed up.
constexpr size_t kBins = 64;

// A convex polygon that half planes cut smaller. A quadrangle cut by a square's four sides has at
// most eight corners.
class Polygon {
 public:
  explicit Polygon(const BoardTexture::Quadrangle& corners) : count_(4) {
    std::copy(corners.begin(), corners.end(), corners_.begin());
  }

  // Keeps what has sign * coordinate >= sign * bound along `axis`.
  void Cut(int axis, double bound, double sign) {
    std::array<Eigen::Vector2d, kMost> kept;
    size_t count = 0;
    for (size_t i = 0; i < count_; ++i) {
      const Eigen::Vector2d& a = corners_[i];
      const Eigen::Vector2d& b = corners_[(i + 1) % count_];
      const double inside_a = sign * (a[axis] - bound);
      const double inside_b = sign * (b[axis] - bound);
      if (inside_a >= 0 && count < kMost) kept[count++] = a;
      if ((inside_a < 0) != (inside_b < 0) && count < kMost) {
        kept[count++] = a + inside_a / (inside_a - inside_b) * (b - a);
      }
    }
    corners_ = kept;
    count_ = count;
  }

  double Area() const {
    double twice = 0;
    for (size_t i = 0; i < count_; ++i) {
      const Eigen::Vector2d& a = corners_[i];
      const Eigen::Vector2d& b = corners_[(i + 1) % count_];
      twice += a.x() * b.y() - a.y() * b.x();
    }
    return std::abs(twice) / 2;
  }

 private:
  static constexpr size_t kMost = 12;
  std::array<Eigen::Vector2d, kMost> corners_;
  size_t count_;
};

}  // namespace

BoardTexture::BoardTexture(const Board& board, double margin) {
  if (!std::isfinite(margin) || margin < 0) {
    throw std::invalid_argument("board '" + board.description().name +
                                "': the margin must not be negative");
  }
  BoardPrint print = PrintOf(board);
  black_ = std::move(print.black);
  const Eigen::Vector2d border = Eigen::Vector2d::Constant(margin);
  extent_ = {print.extent.min() - border, print.extent.max() + border};
  bins_.resize(kBins * kBins);
  for (uint32_t i = 0; i < black_.size(); ++i) {
    for (size_t y = BinAt(black_[i].min().y(), 1); y <= BinAt(black_[i].max().y(), 1); ++y) {
      for (size_t x = BinAt(black_[i].min().x(), 0); x <= BinAt(black_[i].max().x(), 0); ++x) {
        bins_[y * kBins + x].push_back(i);
      }
    }
  }
}

size_t BoardTexture::BinAt(double coordinate, int axis) const {
  const double share = (coordinate - extent_.min()[axis]) / extent_.sizes()[axis];
  return static_cast<size_t>(std::clamp(share * kBins, 0.0, kBins - 1.0));
}

std::vector<uint32_t> BoardTexture::BoxesNear(const Eigen::AlignedBox2d& bounds) const {
  std::vector<uint32_t> boxes;
  for (size_t y = BinAt(bounds.min().y(), 1); y <= BinAt(bounds.max().y(), 1); ++y) {
    for (size_t x = BinAt(bounds.min().x(), 0); x <= BinAt(bounds.max().x(), 0); ++x) {
      const std::vector<uint32_t>& bin = bins_[y * kBins + x];
      boxes.insert(boxes.end(), bin.begin(), bin.end());
    }
  }
  std::ranges::sort(boxes);
  boxes.erase(std::unique(boxes.begin(), boxes.end()), boxes.end());
  return boxes;
}

bool BoardTexture::IsBlack(const Eigen::Vector2d& point) const {
  const std::vector<uint32_t>& bin = bins_[BinAt(point.y(), 1) * kBins + BinAt(point.x(), 0)];
  return std::ranges::any_of(bin, [&](uint32_t i) { return black_[i].contains(point); });
}

double BoardTexture::BlackShare(const Quadrangle& area) const {
  Eigen::AlignedBox2d bounds;
  for (const Eigen::Vector2d& corner : area) bounds.extend(corner);
  const double whole = Polygon(area).Area();
  if (!(whole > 0)) return IsBlack(bounds.center()) ? 1 : 0;
  double black = 0;
  for (const uint32_t i : BoxesNear(bounds)) {
    Polygon polygon(area);
    for (int axis = 0; axis < 2; ++axis) {
      polygon.Cut(axis, black_[i].min()[axis], 1);
      polygon.Cut(axis, black_[i].max()[axis], -1);
    }
    black += polygon.Area();
  }
  return std::min(black / whole, 1.0);
}

}  // namespace silhouette
