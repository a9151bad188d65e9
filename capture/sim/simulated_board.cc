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
  const BoardDescription& d = board.description();
  const auto require = [&](bool holds, const std::string& what) {
    if (!holds) throw std::invalid_argument("board '" + d.name + "': " + what);
  };
  const TagFamily family(d.family);
  rows_ = d.rows;
  columns_ = d.columns;
  pitch_ = d.tag_size + d.gap;
  module_ = d.tag_size / family.width_at_border();
  width_ = family.total_width();
  print_ = (width_ - family.width_at_border()) / 2 * module_;
  require(board.tags() == 1 || pitch_ >= width_ * module_ * (1 - 1e-9),
          "the gap is so small that the prints of neighbouring tags overlap");
  require(d.first_id + board.tags() <= family.tags(),
          d.family + " has only " + std::to_string(family.tags()) + " tags");
  require(std::isfinite(margin) && margin >= 0, "the margin must not be negative");
  for (int i = 0; i < board.tags(); ++i) tags_.push_back(family.Modules(d.first_id + i));
  const Eigen::Vector2d far((columns_ - 1) * pitch_ + d.tag_size,
                            (rows_ - 1) * pitch_ + d.tag_size);
  const Eigen::Vector2d border = Eigen::Vector2d::Constant(print_ + margin);
  extent_ = Eigen::AlignedBox2d(-border, far + border);
}

int BoardTexture::TagAt(double coordinate, int count) const {
  if (count == 1) return 0;
  const double place = std::floor((coordinate + print_) / pitch_);
  return static_cast<int>(std::clamp<double>(place, 0, count - 1));
}

bool BoardTexture::IsBlack(const Eigen::Vector2d& point) const {
  const int row = TagAt(point.y(), rows_);
  const int column = TagAt(point.x(), columns_);
  const double x = std::floor((point.x() + print_ - column * pitch_) / module_);
  const double y = std::floor((point.y() + print_ - row * pitch_) / module_);
  if (!(x >= 0 && x < width_ && y >= 0 && y < width_)) return false;
  return !tags_[static_cast<size_t>(row * columns_ + column)].White(static_cast<int>(x),
                                                                    static_cast<int>(y));
}

double BoardTexture::BlackAreaOfTag(int row, int column, const Quadrangle& area,
                                    const Eigen::AlignedBox2d& bounds) const {
  const TagModules& tag = tags_[static_cast<size_t>(row * columns_ + column)];
  const Eigen::Vector2d corner(column * pitch_ - print_, row * pitch_ - print_);
  const auto module_at = [&](double offset) {
    return static_cast<int>(std::clamp<double>(std::floor(offset / module_), 0, width_ - 1));
  };
  const int left = module_at(bounds.min().x() - corner.x());
  const int right = module_at(bounds.max().x() - corner.x());
  const int top = module_at(bounds.min().y() - corner.y());
  const int bottom = module_at(bounds.max().y() - corner.y());
  double black = 0;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      if (tag.White(x, y)) continue;
      Polygon polygon(area);
      polygon.Cut(0, corner.x() + x * module_, 1);
      polygon.Cut(0, corner.x() + (x + 1) * module_, -1);
      polygon.Cut(1, corner.y() + y * module_, 1);
      polygon.Cut(1, corner.y() + (y + 1) * module_, -1);
      black += polygon.Area();
    }
  }
  return black;
}

double BoardTexture::BlackShare(const Quadrangle& area) const {
  Eigen::AlignedBox2d bounds;
  for (const Eigen::Vector2d& corner : area) bounds.extend(corner);
  const double whole = Polygon(area).Area();
  if (!(whole > 0)) return IsBlack(bounds.center()) ? 1 : 0;
  double black = 0;
  for (int row = TagAt(bounds.min().y(), rows_); row <= TagAt(bounds.max().y(), rows_); ++row) {
    for (int column = TagAt(bounds.min().x(), columns_);
         column <= TagAt(bounds.max().x(), columns_); ++column) {
      black += BlackAreaOfTag(row, column, area, bounds);
    }
  }
  return std::min(black / whole, 1.0);
}

}  // namespace silhouette
