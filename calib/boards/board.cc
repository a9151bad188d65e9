#include "calib/boards/board.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace silhouette {
namespace {

constexpr int kMostTags = 1'000'000;

}  // namespace

Board::Board(BoardDescription description) : description_(std::move(description)) {
  const BoardDescription& d = description_;
  const auto require = [&](bool holds, const std::string& what) {
    if (!holds) throw std::invalid_argument("board '" + d.name + "': " + what);
  };
  require(!d.name.empty(), "a board needs a name");
  require(!d.family.empty(), "a board needs a tag family");
  require(d.rows > 0 && d.columns > 0, "there must be at least one row and one column of tags");
  require(d.rows <= kMostTags / d.columns, "there are too many tags");
  require(std::isfinite(d.tag_size) && d.tag_size > 0, "tag_size must be positive");
  require(tags() == 1 || (std::isfinite(d.gap) && d.gap > 0),
          "the gap between tags must be positive");
  require(d.first_id >= 0, "first_id must not be negative");
  require(d.first_id <= std::numeric_limits<int>::max() - kMostTags, "first_id is too large");
}

bool Board::HasTag(int id) const {
  return id >= description_.first_id && id - description_.first_id < tags();
}

TagCorners Board::CornersOf(int id) const {
  if (!HasTag(id)) {
    throw std::out_of_range("board '" + description_.name + "' has no tag " + std::to_string(id));
  }
  const int place = id - description_.first_id;
  const double pitch = description_.tag_size + description_.gap;
  const double left = pitch * (place % description_.columns);
  const double top = pitch * (place / description_.columns);
  const double right = left + description_.tag_size;
  const double bottom = top + description_.tag_size;
  return {Eigen::Vector3d(left, bottom, 0), Eigen::Vector3d(right, bottom, 0),
          Eigen::Vector3d(right, top, 0), Eigen::Vector3d(left, top, 0)};
}

bool Board::IsLattice() const {
  return tags() == 1 ||
         std::abs(description_.gap - description_.tag_size) <= 1e-9 * description_.tag_size;
}

}  // namespace silhouette
