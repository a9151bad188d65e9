// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/board_views.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// A corner may lie so far outside its image, as a share of the longer side.
constexpr double kBeyondRim = 0.02;

// Nothing if no board has the tag.
std::optional<size_t> BoardOf(const std::vector<Board>& boards, const TagSighting& sighting) {
  for (size_t i = 0; i < boards.size(); ++i) {
    if (boards[i].description().family == sighting.family && boards[i].HasTag(sighting.tag)) {
      return i;
    }
  }
  return std::nullopt;
}

absl::StatusOr<size_t> CameraOf(const std::vector<LensCamera>& cameras,
                                const TagSighting& sighting) {
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].name == sighting.view) return i;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("there are corners of the view '", sighting.view,
                   "', but the size of its images is not given; give it, or leave the view out"));
}

// How far a corner lies outside the image; 0 inside.
double Outside(const LensCamera& camera, const Eigen::Vector2d& corner) {
  return std::max({0.0, -0.5 - corner.x(), -0.5 - corner.y(), corner.x() - camera.width + 0.5,
                   corner.y() - camera.height + 0.5});
}

// Detection may put the corner of a tag that the image's rim cuts a little beyond it.
bool IsCutByRim(const LensCamera& camera, const TagSighting& sighting) {
  return std::any_of(sighting.corners.begin(), sighting.corners.end(),
                     [&](const Eigen::Vector2d& corner) { return Outside(camera, corner) > 0; });
}

absl::Status CheckSighting(const LensCamera& camera, const TagSighting& sighting) {
  const std::string where =
      absl::StrCat("view '", sighting.view, "', frame '", sighting.frame, "', tag ", sighting.tag);
  if (!(sighting.sigma > 0) || !std::isfinite(sighting.sigma)) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": sigma must be positive"));
  }
  for (const Eigen::Vector2d& corner : sighting.corners) {
    if (!corner.allFinite()) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": a corner is not finite"));
    }
    if (Outside(camera, corner) > kBeyondRim * std::max(camera.width, camera.height)) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "%s: the corner (%.1f, %.1f) lies outside the image of %d x %d pixels; give the size of "
          "the images from which the corners are, and take images of one size for each camera",
          where, corner.x(), corner.y(), camera.width, camera.height));
    }
  }
  return absl::OkStatus();
}

// Which of the boards that were seen shall be used, and their common lattice.
absl::Status ChooseBoards(const std::vector<Board>& boards, const std::set<size_t>& seen,
                          BoardViews& out) {
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
    if (!board.IsLattice()) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "board '%s': its corners are no regular lattice, as the gap of %g m is not the tag's "
          "size "
          "of %g m; print a board whose gap equals its tag's size (tagStandard41h12 with a gap of "
          "one module) for the lenses",
          name, board.description().gap, board.description().tag_size));
    }
    const Lattice lattice = LatticeOf(board);
    if (!first) {
      first = i;
      out.lattice = lattice;
    } else if (lattice.width != out.lattice.width || lattice.height != out.lattice.height ||
               std::abs(lattice.spacing - out.lattice.spacing) > 1e-9) {
      return absl::InvalidArgumentError(absl::StrCat(
          "boards '", boards[*first].description().name, "' and '", name,
          "' differ in rows, columns or tag size; use only boards of one kind for the lenses"));
    }
    out.boards.push_back(i);
  }
  return absl::OkStatus();
}

// The same image under two names counts once.
void LeaveOutCopies(const std::vector<LensCamera>& cameras, BoardViews& out) {
  std::vector<BoardView> kept;
  for (BoardView& view : out.views) {
    const auto copy = std::find_if(kept.begin(), kept.end(), [&](const BoardView& other) {
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

}  // namespace

Lattice LatticeOf(const Board& board) {
  const BoardDescription& d = board.description();
  return {.width = 2 * d.columns, .height = 2 * d.rows, .spacing = d.tag_size};
}

size_t LatticeIndex(const Board& board, int place, int corner) {
  const BoardDescription& d = board.description();
  const int row = 2 * (place / d.columns) + (corner < 2 ? 1 : 0);
  const int column = 2 * (place % d.columns) + (corner == 1 || corner == 2 ? 1 : 0);
  return static_cast<size_t>(row) * static_cast<size_t>(2 * d.columns) +
         static_cast<size_t>(column);
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
    RETURN_IF_ERROR(CheckSighting(cameras[camera], sighting));
    if (IsCutByRim(cameras[camera], sighting)) continue;
    seen.push_back({camera, *board, &sighting});
    seen_boards.insert(*board);
  }
  if (seen.empty()) {
    return absl::InvalidArgumentError(
        "none of the tags that were seen is on a board; give the boards that were used (their tag "
        "family and first_id matter)");
  }
  RETURN_IF_ERROR(ChooseBoards(boards, seen_boards, out));

  const size_t corners =
      static_cast<size_t>(out.lattice.width) * static_cast<size_t>(out.lattice.height);
  std::map<std::tuple<std::string, size_t, size_t>, size_t> places;
  for (const Seen& each : seen) {
    if (std::find(out.boards.begin(), out.boards.end(), each.board) == out.boards.end()) continue;
    const TagSighting& sighting = *each.sighting;
    const auto [place, is_new] =
        places.try_emplace({sighting.frame, each.camera, each.board}, out.views.size());
    if (is_new) {
      out.views.push_back(
          {.frame = sighting.frame,
           .camera = each.camera,
           .board = each.board,
           .corners = std::vector<Eigen::Vector3d>(corners, Eigen::Vector3d(0, 0, kNoCorner))});
    }
    BoardView& view = out.views[place->second];
    const Board& board = boards[each.board];
    for (int corner = 0; corner < 4; ++corner) {
      const size_t at = LatticeIndex(board, sighting.tag - board.description().first_id, corner);
      if (view.corners[at].z() != kNoCorner) {
        return absl::InvalidArgumentError(absl::StrCat(
            "tag ", sighting.tag, " occurs twice in the frame '", sighting.frame, "' of the view '",
            sighting.view, "'; give each image once, and print no tag twice"));
      }
      const Eigen::Vector2d& pixel = sighting.corners[static_cast<size_t>(corner)];
      view.corners[at] = {pixel.x(), pixel.y(), 1 / sighting.sigma};
      ++view.seen;
    }
  }
  LeaveOutCopies(cameras, out);
  RETURN_IF_ERROR(CheckBoardShapes(cameras, boards, out.views));
  // Too little of a board to tell its pose.
  std::erase_if(out.views, [&](const BoardView& view) {
    return view.seen < std::min(8, 4 * boards[view.board].tags());
  });
  return out;
}

}  // namespace silhouette
