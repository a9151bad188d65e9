// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/board_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <opencv2/calib3d.hpp>
#include <set>
#include <tuple>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// A corner may lie so far outside its image, as a share of the longer side.
constexpr double kBeyondRim = 0.02;

// Nothing if no board has the tag.
std::optional<size_t> BoardOf(const std::vector<Board>& boards, const TagSighting& sighting) {
  for (size_t i = 0; i < boards.size(); ++i) {
    if (boards[i].HasTag(sighting.family, sighting.tag)) return i;
  }
  return std::nullopt;
}

absl::StatusOr<size_t> CameraOf(const std::vector<LensCamera>& cameras,
                                const TagSighting& sighting) {
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].name == sighting.view) return i;
  }
  return InvalidArgument(
      "there are corners of the view '", sighting.view,
      "', but the size of its images is not given; give it, or leave the view out");
}

// How far a corner lies outside the image; 0 inside.
double Outside(const LensCamera& camera, const Eigen::Vector2d& corner) {
  return std::max({0.0, -0.5 - corner.x(), -0.5 - corner.y(), corner.x() - camera.width + 0.5,
                   corner.y() - camera.height + 0.5});
}

// Detection may put the corner of a tag that the image's rim cuts a little beyond it.
bool IsCutByRim(const LensCamera& camera, const TagSighting& sighting) {
  return std::ranges::any_of(
      sighting.corners, [&](const Eigen::Vector2d& corner) { return Outside(camera, corner) > 0; });
}

absl::Status CheckSighting(const LensCamera& camera, const Board& board,
                           const TagSighting& sighting) {
  const std::string where =
      absl::StrCat("view '", sighting.view, "', frame '", sighting.frame, "', tag ", sighting.tag);
  if (!(sighting.sigma > 0) || !std::isfinite(sighting.sigma)) {
    return InvalidArgument(where, ": sigma must be positive");
  }
  if (sighting.corners.size() != static_cast<size_t>(board.corners_per_mark())) {
    return InvalidArgument(where, ": it has ", sighting.corners.size(), " corners, not ",
                           board.corners_per_mark());
  }
  for (const Eigen::Vector2d& corner : sighting.corners) {
    if (!corner.allFinite()) {
      return InvalidArgument(where, ": a corner is not finite");
    }
    if (Outside(camera, corner) > kBeyondRim * std::max(camera.width, camera.height)) {
      return InvalidArgument(absl::StrFormat(
          "%s: the corner (%.1f, %.1f) lies outside the image of %d x %d pixels; give the size of "
          "the images from which the corners are, and take images of one size for each camera",
          where, corner.x(), corner.y(), camera.width, camera.height));
    }
  }
  return absl::OkStatus();
}

std::string StandOf(const TagSighting& sighting, const Board& board) {
  return board.IsAmbiguous() ? absl::StrCat(sighting.frame, " of ", sighting.view) : sighting.frame;
}

// Which of the boards that were seen shall be used, and their common lattice.
absl::Status ChooseBoards(const std::vector<LensCamera>& cameras, const std::vector<Board>& boards,
                          const std::set<size_t>& seen, BoardViews& out) {
  int most = 0;
  for (const size_t i : seen) most = std::max(most, boards[i].tags());
  std::optional<size_t> first;
  for (const size_t i : seen) {
    const Board& board = boards[i];
    const std::string& name = board.description().name;
    if (board.tags() == 1 && most > 1) {
      out.warnings.push_back(absl::StrCat("the single tag '", name, "' is not used for lenses"));
      continue;
    }
    const std::optional<Lattice> lattice = board.lattice();
    if (!lattice) {
      return InvalidArgument(absl::StrFormat(
          "board '%s': with %d x %d marks and gaps of %g m it needs a lattice too large for the "
          "lenses; print a board of fewer tags, or one whose gap equals its tag's size",
          name, board.description().columns, board.description().rows, board.description().gap));
    }
    if (!first) {
      first = i;
      out.lattice = *lattice;
    } else if (lattice->width != out.lattice.width || lattice->height != out.lattice.height ||
               lattice->exact != out.lattice.exact ||
               std::abs(lattice->spacing - out.lattice.spacing) > 1e-9) {
      return InvalidArgument(
          "boards '", boards[*first].description().name, "' and '", name,
          "' differ in rows, columns or tag size; use only boards of one kind for the lenses");
    }
    if (board.IsAmbiguous() && cameras.size() > 1) {
      out.warnings.push_back(absl::StrCat(
          "board '", name, "' looks the same turned by half, so it ties no cameras together"));
    }
    out.boards.push_back(i);
  }
  return absl::OkStatus();
}

// The same image under two names counts once.
void LeaveOutCopies(const std::vector<LensCamera>& cameras, BoardViews& out) {
  std::vector<BoardView> kept;
  for (BoardView& view : out.views) {
    const auto copy = std::ranges::find_if(kept, [&](const BoardView& other) {
      return other.camera == view.camera && other.board == view.board && other.seen == view.seen &&
             other.corners == view.corners;
    });
    if (copy == kept.end()) {
      kept.push_back(std::move(view));
    } else {
      out.warnings.push_back(absl::StrCat("view '", cameras[view.camera].name, "': the frame '",
                                          view.frame, "' shows exactly what '", copy->frame,
                                          "' shows and is left out; it seems to be a copy"));
    }
  }
  out.views = std::move(kept);
}

// Moves each tag's corners to where those of its places on the lattice would be seen.
void LayOnLattice(const Board& board, const Lattice& lattice, BoardView& view) {
  view.shifts.assign(view.corners.size(), Eigen::Vector2d::Zero());
  for (int id = board.first_mark(); board.HasTag(id); ++id) {
    const MarkCorners corners = board.CornersOf(id);
    std::vector<size_t> places;
    std::vector<cv::Point2d> on_board;
    std::vector<cv::Point2d> on_lattice;
    std::vector<cv::Point2d> seen;
    for (int i = 0; i < 4; ++i) {
      places.push_back(LatticeIndex(board, id, i));
      const GridPlace place = board.LatticePlaceOf(id, i);
      on_lattice.emplace_back(lattice.spacing * place.column, lattice.spacing * place.row);
      on_board.emplace_back(corners[places.size() - 1].x(), corners[places.size() - 1].y());
      seen.emplace_back(view.corners[places.back()].x(), view.corners[places.back()].y());
    }
    if (view.corners[places[0]].z() == kNoCorner) continue;
    const cv::Mat homography = cv::findHomography(on_board, seen, 0);
    if (homography.empty()) continue;  // on one line: an outlier in any case
    std::vector<cv::Point2d> moved;
    cv::perspectiveTransform(on_lattice, moved, homography);
    for (size_t i = 0; i < 4; ++i) {
      view.shifts[places[i]] = {moved[i].x - seen[i].x, moved[i].y - seen[i].y};
      view.corners[places[i]].head<2>() += view.shifts[places[i]];
    }
  }
}

}  // namespace

size_t LatticeIndex(const Board& board, int id, int corner) {
  const GridPlace place = board.LatticePlaceOf(id, corner);
  return static_cast<size_t>(place.row) * static_cast<size_t>(board.lattice().value().width) +
         static_cast<size_t>(place.column);
}

absl::StatusOr<BoardViews> GatherBoardViews(const std::vector<LensCamera>& cameras,
                                            const std::vector<Board>& boards,
                                            const std::vector<TagSighting>& sightings) {
  BoardViews out;
  struct Seen {
    size_t camera;
    size_t board;
    const TagSighting* sighting;
  };
  std::vector<Seen> seen;
  std::set<size_t> seen_boards;
  for (const TagSighting& sighting : sightings) {
    const std::optional<size_t> board = BoardOf(boards, sighting);
    if (!board) continue;
    ASSIGN_OR_RETURN(const size_t camera, CameraOf(cameras, sighting));
    RETURN_IF_ERROR(CheckSighting(cameras[camera], boards[*board], sighting));
    if (IsCutByRim(cameras[camera], sighting)) continue;
    seen.push_back({camera, *board, &sighting});
    seen_boards.insert(*board);
  }
  if (seen.empty()) {
    std::set<std::string> families;
    for (const Board& board : boards) families.insert(board.family());
    return InvalidArgument(
        "none of the tags or corners that were seen is on a board: the first is of ",
        sightings.empty() ? "none" : sightings.front().family, ", the boards have ",
        absl::StrJoin(families, ", "),
        "; correct --boards (family, first_id, and columns x rows matter)");
  }
  RETURN_IF_ERROR(ChooseBoards(cameras, boards, seen_boards, out));

  const size_t corners =
      static_cast<size_t>(out.lattice.width) * static_cast<size_t>(out.lattice.height);
  std::map<std::tuple<std::string, size_t, size_t>, size_t> places;
  for (const Seen& each : seen) {
    if (std::ranges::find(out.boards, each.board) == out.boards.end()) continue;
    const TagSighting& sighting = *each.sighting;
    const auto [place, is_new] =
        places.try_emplace({sighting.frame, each.camera, each.board}, out.views.size());
    if (is_new) {
      out.views.push_back(
          {.frame = sighting.frame,
           .stand = StandOf(sighting, boards[each.board]),
           .camera = each.camera,
           .board = each.board,
           .corners = std::vector<Eigen::Vector3d>(corners, Eigen::Vector3d(0, 0, kNoCorner))});
    }
    BoardView& view = out.views[place->second];
    const Board& board = boards[each.board];
    for (size_t corner = 0; corner < sighting.corners.size(); ++corner) {
      const size_t at = LatticeIndex(board, sighting.tag, static_cast<int>(corner));
      if (view.corners[at].z() != kNoCorner) {
        return InvalidArgument("tag ", sighting.tag, " occurs twice in the frame '", sighting.frame,
                               "' of the view '", sighting.view,
                               "'; give each image once, and print no tag twice");
      }
      const Eigen::Vector2d& pixel = sighting.corners[corner];
      view.corners[at] = {pixel.x(), pixel.y(), 1 / sighting.sigma};
      ++view.seen;
    }
  }
  LeaveOutCopies(cameras, out);
  RETURN_IF_ERROR(CheckBoardShapes(cameras, boards, out.views));
  // Too little of a board to determine its pose.
  std::erase_if(out.views, [&](const BoardView& view) {
    return view.seen < (boards[view.board].tags() == 1 ? 4 : 8);
  });
  if (out.lattice.exact) return out;
  for (BoardView& view : out.views) LayOnLattice(boards[view.board], out.lattice, view);
  return out;
}

namespace {

// Largest rms of a view's corners about their homography, as a share of the tags' sides: lenses
// bend less.
constexpr double kLargestMisfit = 0.3;

// A way to lay the tags' ids out: the place (row by row) of the tag that stands at (row, column).
using Order = std::function<int(int row, int column, int rows, int columns)>;

struct Mistake {
  const char* says;
  bool exchanged;  // rows and columns
  Order order;
};

const std::vector<Mistake>& Mistakes() {
  static const std::vector<Mistake> mistakes = {
      {"its ids run from right to left: the print or the images are mirrored", false,
       [](int row, int column, int, int columns) { return row * columns + columns - 1 - column; }},
      {"its ids run from bottom to top: the print or the images are mirrored", false,
       [](int row, int column, int rows, int columns) {
         return (rows - 1 - row) * columns + column;
       }},
      {"its rows and columns seem to be exchanged", true,
       [](int row, int column, int, int columns) { return row * columns + column; }},
      {"its ids run down the columns, not along the rows", false,
       [](int row, int column, int rows, int) { return column * rows + row; }},
  };
  return mistakes;
}

// rms of the distances from the best homography over the mean side of the tags, if they lay in
// `order`; nothing if too few were seen.
std::optional<double> Misfit(const Board& board, const BoardView& view, const Order& order,
                             bool exchanged) {
  const BoardDescription& d = board.description();
  const int rows = exchanged ? d.columns : d.rows;
  const int columns = exchanged ? d.rows : d.columns;
  const double pitch = d.tag_size + d.gap;
  std::vector<cv::Point2d> on_board;
  std::vector<cv::Point2d> seen;
  double sides = 0;
  const MarkCorners corners = Board({.name = "tag", .tag_size = d.tag_size}).CornersOf(0);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const int place = order(row, column, rows, columns);
      std::array<Eigen::Vector3d, 4> pixels;
      for (int corner = 0; corner < 4; ++corner) {
        pixels[static_cast<size_t>(corner)] =
            view.corners[LatticeIndex(board, d.first_id + place, corner)];
      }
      if (pixels[0].z() == kNoCorner) continue;
      for (size_t corner = 0; corner < 4; ++corner) {
        on_board.emplace_back(corners[corner].x() + pitch * column,
                              corners[corner].y() + pitch * (d.from_bottom ? rows - 1 - row : row));
        seen.emplace_back(pixels[corner].x(), pixels[corner].y());
        sides += (pixels[corner] - pixels[(corner + 1) % 4]).head<2>().norm() / 4;
      }
    }
  }
  if (seen.size() < 12) return std::nullopt;
  const cv::Mat homography = cv::findHomography(on_board, seen, 0);
  if (homography.empty()) return std::nullopt;
  std::vector<cv::Point2d> mapped;
  cv::perspectiveTransform(on_board, mapped, homography);
  double squares = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    const cv::Point2d off = mapped[i] - seen[i];
    squares += off.dot(off);
  }
  const double tags = static_cast<double>(seen.size()) / 4;
  return std::sqrt(squares / static_cast<double>(seen.size())) / (sides / tags);
}

std::optional<double> MedianMisfit(const Board& board, const std::vector<const BoardView*>& views,
                                   const Order& order, bool exchanged = false) {
  std::vector<double> misfits;
  for (const BoardView* view : views) {
    if (const auto misfit = Misfit(board, *view, order, exchanged)) misfits.push_back(*misfit);
  }
  if (misfits.empty()) return std::nullopt;
  return Median(std::move(misfits));
}

// Whether the corners of most tags run the wrong way round.
bool MostTagsMirrored(const Board& board, const std::vector<const BoardView*>& views) {
  int tags = 0;
  int mirrored = 0;
  for (const BoardView* view : views) {
    for (int place = 0; place < board.tags(); ++place) {
      double area = 0;
      const auto pixel = [&](int corner) {
        return view->corners[LatticeIndex(board, board.first_mark() + place, corner % 4)];
      };
      if (pixel(0).z() == kNoCorner) continue;
      for (int corner = 0; corner < 4; ++corner) {
        const Eigen::Vector3d a = pixel(corner);
        const Eigen::Vector3d b = pixel(corner + 1);
        area += a.x() * b.y() - a.y() * b.x();
      }
      ++tags;
      if (area > 0) ++mirrored;
    }
  }
  return 2 * mirrored > tags;
}

}  // namespace

absl::Status CheckBoardShapes(const std::vector<LensCamera>& cameras,
                              const std::vector<Board>& boards,
                              const std::vector<BoardView>& views) {
  std::map<std::pair<size_t, size_t>, std::vector<const BoardView*>> by_camera;
  for (const BoardView& view : views) by_camera[{view.camera, view.board}].push_back(&view);
  for (const auto& [key, group] : by_camera) {
    const Board& board = boards[key.second];
    if (board.description().kind != BoardKind::kTags) continue;  // found by their shape
    const std::string where = absl::StrCat("board '", board.description().name, "', seen by '",
                                           cameras[key.first].name, "': ");
    if (MostTagsMirrored(board, group)) {
      return InvalidArgument(
          where,
          "the tags' corners run the wrong way round; the images are mirrored (switch off the "
          "camera's mirroring), or their order is not bottom left, bottom right, top right, top "
          "left");
    }
    const Order as_described = [](int row, int column, int, int columns) {
      return row * columns + column;
    };
    const auto misfit = MedianMisfit(board, group, as_described);
    if (!misfit || *misfit < kLargestMisfit) continue;
    for (const Mistake& mistake : Mistakes()) {
      const auto other = MedianMisfit(board, group, mistake.order, mistake.exchanged);
      if (other && *other < kLargestMisfit) {
        return InvalidArgument(where, mistake.says,
                               "; print the board again, or describe it as it is");
      }
    }
    return InvalidArgument(
        where,
        "its tags do not lie as the description says; compare rows, columns, gap and first_id with "
        "the print, and see that it is flat");
  }
  return absl::OkStatus();
}

}  // namespace silhouette
