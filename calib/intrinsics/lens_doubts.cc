// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/lens_doubts.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Shares of the image's width: worth the search for a reason, and too much without one.
constexpr double kDoubtedRms = 0.05 / 640;
constexpr double kRefusedRms = 1.0 / 640;
constexpr double kOtherGap = 0.03;  // of a tag; distortion takes a third of it
constexpr size_t kLeastNeighbours = 20;
// The next tag lies beside one if it is so near to there, in pitches.
constexpr double kBeside = 0.4;
// Shares of the pairs of tags: a wrong first id contradicts more than the first, the right one
// fewer than the second.
constexpr double kWrongId = 0.08;
constexpr double kRightId = 0.02;
// Two lenses explain what one does not if each is off by a third of it or less.
constexpr double kExplains = 3;

using Corners = std::array<Eigen::Vector2d, 4>;

// The corners of a tag of side 1, as AprilTag orders them, y down.
const Corners kUnitTag = {{{0, 1}, {1, 1}, {1, 0}, {0, 0}}};

// The homography from pixels to where the tag's corners are at those of kUnitTag.
Eigen::Matrix3d UnitFromPixels(const TagSighting& tag) {
  Eigen::Matrix<double, 8, 8> a = Eigen::Matrix<double, 8, 8>::Zero();
  Eigen::Matrix<double, 8, 1> b;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d p = tag.corners[i].homogeneous();
    const Eigen::Vector2d& u = kUnitTag[i];
    a.block<1, 3>(2 * i, 0) = p.transpose();
    a.block<1, 3>(2 * i + 1, 3) = p.transpose();
    a.block<2, 2>(2 * i, 6) = -u * p.head<2>().transpose();
    b.segment<2>(2 * i) = u;
  }
  Eigen::Matrix<double, 9, 1> h;
  h << a.fullPivLu().solve(b), 1;
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
}

Eigen::Vector2d Middle(const Eigen::Matrix3d& map, const TagSighting& tag) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : tag.corners) {
    sum += (map * corner.homogeneous()).hnormalized() / 4;
  }
  return sum;
}

// The gap between a board's tags as a share of their side, as tags and their neighbours were seen.
std::optional<double> GapSeen(const Board& board, const std::vector<TagSighting>& sightings) {
  std::map<std::pair<std::string, std::string>, std::vector<const TagSighting*>> images;
  for (const TagSighting& seen : sightings) {
    if (board.HasTag(seen.family, seen.tag)) images[{seen.view, seen.frame}].push_back(&seen);
  }
  const double pitch = board.description().tag_size + board.description().gap;
  std::vector<double> gaps;
  for (const auto& [image, tags] : images) {
    for (const TagSighting* tag : tags) {
      const Eigen::Matrix3d map = UnitFromPixels(*tag);
      for (const TagSighting* other : tags) {
        const Eigen::Vector3d step = board.CornersOf(other->tag)[0] - board.CornersOf(tag->tag)[0];
        if (std::abs(step.norm() - pitch) > 0.01 * pitch) continue;
        gaps.push_back((Middle(map, *other) - Eigen::Vector2d(0.5, 0.5)).norm() - 1);
      }
    }
  }
  if (gaps.size() < kLeastNeighbours) return std::nullopt;
  return Median(std::move(gaps));
}

// Ids of which the next one was seen beside them, on their right, or elsewhere: how often.
struct NextSeen {
  int beside = 0;
  int elsewhere = 0;
};

std::map<int, NextSeen> NextTagsSeen(const Board& board,
                                     const std::vector<TagSighting>& sightings) {
  std::map<std::tuple<std::string, std::string, int>, const TagSighting*> seen;
  for (const TagSighting& tag : sightings) {
    if (board.HasTag(tag.family, tag.tag)) seen[{tag.view, tag.frame, tag.tag}] = &tag;
  }
  const double pitch = 1 + board.description().gap / board.description().tag_size;
  std::map<int, NextSeen> ids;
  for (const auto& [key, tag] : seen) {
    const auto next = seen.find({tag->view, tag->frame, tag->tag + 1});
    if (next == seen.end()) continue;
    const Eigen::Vector2d step =
        Middle(UnitFromPixels(*tag), *next->second) - Eigen::Vector2d(0.5 + pitch, 0.5);
    ++(step.norm() < kBeside * pitch ? ids[tag->tag].beside : ids[tag->tag].elsewhere);
  }
  return ids;
}

// How often the next tag was not where it is if rows begin at `first`, and at every row's length
// from there.
int Contradictions(const std::map<int, NextSeen>& ids, int first, int columns) {
  int sum = 0;
  for (const auto& [id, next] : ids) {
    const bool ends_row = ((id - first) % columns + columns) % columns == columns - 1;
    sum += ends_row ? next.beside : next.elsewhere;
  }
  return sum;
}

using Frames = std::set<std::string>;

// The sightings of a view in some frames.
std::vector<TagSighting> Of(const std::vector<TagSighting>& sightings, const std::string& view,
                            const Frames& frames) {
  std::vector<TagSighting> some;
  for (const TagSighting& seen : sightings) {
    if (seen.view == view && frames.contains(seen.frame)) some.push_back(seen);
  }
  return some;
}

// Frames that a lens of their own explains, and the rest another one, if the images of two cameras
// follow each other by name, or are by turns; empty if two lenses do not explain them so.
Frames OfAnotherLens(const LensCamera& camera, const std::vector<Board>& boards,
                     const std::vector<TagSighting>& sightings, LensSettings settings, double rms) {
  settings.least_known = 0;
  settings.most_uncertain_focal_length = 1;
  Frames all;
  for (const TagSighting& seen : sightings) {
    if (seen.view == camera.name) all.insert(seen.frame);
  }
  for (const bool by_turns : {false, true}) {
    std::array<Frames, 2> groups;
    size_t at = 0;
    for (const std::string& frame : all) {
      groups[by_turns ? at % 2 : 2 * at / all.size()].insert(frame);
      ++at;
    }
    const bool explained = std::ranges::all_of(groups, [&](const Frames& frames) {
      const auto own = SolveLenses({camera}, boards, Of(sightings, camera.name, frames), settings);
      return own.ok() && own->cameras[0].rms * kExplains < rms;
    });
    if (explained) return groups[1];
  }
  return {};
}

}  // namespace

std::string WrongGaps(const std::vector<Board>& boards, const std::vector<TagSighting>& sightings) {
  std::vector<std::string> wrong;
  for (const Board& board : boards) {
    const BoardDescription& d = board.description();
    if (d.kind != BoardKind::kTags || d.rows * d.columns == 1) continue;
    const std::optional<double> seen = GapSeen(board, sightings);
    if (!seen || std::abs(*seen - d.gap / d.tag_size) < kOtherGap) continue;
    const double gap = std::round(20 * *seen) / 20;  // as the lattice of a board has it
    wrong.push_back(absl::StrFormat(
        "by the images the gaps between the tags of board '%s' are about %.2f of a tag (%.3g mm), "
        "not %.2f (%.3g mm) as described",
        d.name, gap, 1000 * d.tag_size * gap, d.gap / d.tag_size, 1000 * d.gap));
  }
  return absl::StrJoin(wrong, "; ");
}

absl::Status CheckFirstIds(const std::vector<Board>& boards,
                           const std::vector<TagSighting>& sightings) {
  for (const Board& board : boards) {
    const BoardDescription& d = board.description();
    if (d.kind != BoardKind::kTags || d.rows < 2 || d.columns < 2) continue;
    const std::map<int, NextSeen> ids = NextTagsSeen(board, sightings);
    double pairs = 0;
    for (const auto& [id, next] : ids) pairs += next.beside + next.elsewhere;
    if (pairs < kLeastNeighbours || Contradictions(ids, d.first_id, d.columns) < kWrongId * pairs) {
      continue;
    }
    int lowest = std::numeric_limits<int>::max();  // seen, where another first id may be
    for (const TagSighting& tag : sightings) {
      if (tag.family == d.family && tag.tag > d.first_id - d.columns) {
        lowest = std::min(lowest, tag.tag);
      }
    }
    for (int off = 1; off < 2 * d.columns; ++off) {
      // The nearest first: 1 more, 1 less, 2 more, ...
      const int first = d.first_id + (off % 2 == 1 ? (off + 1) / 2 : -off / 2);
      if (first < 0 || first > lowest) continue;
      if (Contradictions(ids, first, d.columns) > kRightId * pairs) continue;
      return InvalidArgument("by the images the rows of board '", d.name, "' begin at tags ", first,
                             ", ", first + d.columns, " and so on: its first_id",
                             " (Kalibr's codeOffset) is ", first, ", not ", d.first_id);
    }
  }
  return absl::OkStatus();
}

absl::Status CheckFit(const std::vector<LensCamera>& cameras, const std::vector<Board>& boards,
                      const std::vector<TagSighting>& sightings, const LensSettings& settings,
                      const LensSolution& solution) {
  for (size_t i = 0; i < cameras.size(); ++i) {
    const SolvedCamera& camera = solution.cameras[i];
    if (cameras[i].fixed || camera.rms < kDoubtedRms * camera.width) continue;
    const std::string off =
        absl::StrFormat("view '%s': its corners are off by %.2f px", camera.name, camera.rms);
    if (const std::string wrong = WrongGaps(boards, sightings); !wrong.empty()) {
      return FailedPrecondition(off, ": ", wrong);
    }
    if (const Frames other = OfAnotherLens(cameras[i], boards, sightings, settings, camera.rms);
        !other.empty()) {
      return FailedPrecondition(
          off,
          "; two lenses explain them: these images are of another camera, zoom or focus than "
          "the rest: ",
          absl::StrJoin(other, ", "));
    }
    if (camera.rms > kRefusedRms * camera.width) {
      return FailedPrecondition(
          off,
          "; the board is not as described or not flat, the images are blurred or of several "
          "cameras, or another --model is needed");
    }
  }
  return absl::OkStatus();
}

}  // namespace silhouette
