// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/board_views.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <set>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Poses that single images give differ by no more than this if they are of one thing.
constexpr double kLargestTurn = 4 * std::numbers::pi / 180;
constexpr double kLargestShift = 0.06;  // of the distance

bool Agree(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double distance) {
  const Eigen::Isometry3d off = a.inverse() * b;
  return Eigen::AngleAxisd(off.linear()).angle() < kLargestTurn &&
         off.translation().norm() < kLargestShift * distance;
}

using Stand = std::pair<std::string, size_t>;              // BoardView::stand, board
using StandsOfCamera = std::map<Stand, const PosedView*>;  // in the order of the frames' names

// Where two cameras stand to each other by one board.
struct Evidence {
  Eigen::Isometry3d b_from_a;
  double distance = 0;
};

struct Tie {
  size_t a = 0;
  size_t b = 0;
  Eigen::Isometry3d b_from_a = Eigen::Isometry3d::Identity();
  size_t shared = 0;    // boards that both saw at once
  size_t agreeing = 0;  // those that say the same
};

// The evidence if b's images were of the frame `shift` places later.
std::vector<Evidence> EvidenceOf(const StandsOfCamera& a, const StandsOfCamera& b, int shift,
                                 const std::vector<std::string>& frames) {
  std::vector<Evidence> evidence;
  for (const auto& [stand, view] : a) {
    const auto at = std::lower_bound(frames.begin(), frames.end(), stand.first) - frames.begin();
    const auto other = at + shift;
    if (other < 0 || other >= static_cast<std::ptrdiff_t>(frames.size())) continue;
    const auto found = b.find({frames[static_cast<size_t>(other)], stand.second});
    if (found == b.end()) continue;
    const PosedView& seen = *found->second;
    evidence.push_back({seen.camera_from_board * view->camera_from_board.inverse(),
                        std::max(seen.camera_from_board.translation().norm(),
                                 view->camera_from_board.translation().norm())});
  }
  return evidence;
}

// The evidence with which most agree.
Tie TieOf(const std::vector<Evidence>& evidence) {
  Tie tie;
  tie.shared = evidence.size();
  for (const Evidence& candidate : evidence) {
    const auto agreeing =
        static_cast<size_t>(std::ranges::count_if(evidence, [&](const Evidence& other) {
          return Agree(candidate.b_from_a, other.b_from_a, other.distance);
        }));
    if (agreeing > tie.agreeing) {
      tie.agreeing = agreeing;
      tie.b_from_a = candidate.b_from_a;
    }
  }
  return tie;
}

absl::Status Contradiction(const LensCamera& a, const LensCamera& b, const Tie& tie, int shift) {
  std::string message = absl::StrFormat(
      "the images of '%s' and '%s' do not belong together: of %d boards seen at once only %d agree "
      "on how the cameras stand to each other",
      a.name, b.name, tie.shared, tie.agreeing);
  if (shift != 0) {
    absl::StrAppendFormat(&message,
                          "; with those of '%s' taken %d frame%s %s they would: the pairing looks "
                          "shifted",
                          b.name, std::abs(shift), std::abs(shift) == 1 ? "" : "s",
                          shift > 0 ? "later" : "earlier");
  }
  absl::StrAppend(&message,
                  "; images with one frame's name must be taken at once, with the board at rest");
  return InvalidArgument(message);
}

absl::StatusOr<std::vector<Tie>> AllTies(const std::vector<LensCamera>& cameras,
                                         const std::vector<StandsOfCamera>& stands) {
  std::set<std::string> names;
  for (const StandsOfCamera& each : stands) {
    for (const auto& [stand, view] : each) names.insert(stand.first);
  }
  const std::vector<std::string> frames(names.begin(), names.end());
  std::vector<Tie> ties;
  for (size_t a = 0; a < cameras.size(); ++a) {
    for (size_t b = a + 1; b < cameras.size(); ++b) {
      Tie tie = TieOf(EvidenceOf(stands[a], stands[b], 0, frames));
      tie.a = a;
      tie.b = b;
      if (tie.shared == 0) continue;
      if (tie.shared >= 4 && 2 * tie.agreeing < tie.shared) {
        for (const int shift : {1, -1, 2, -2}) {
          const Tie shifted = TieOf(EvidenceOf(stands[a], stands[b], shift, frames));
          if (shifted.shared >= 4 && 10 * shifted.agreeing > 7 * shifted.shared) {
            return Contradiction(cameras[a], cameras[b], tie, shift);
          }
        }
        return Contradiction(cameras[a], cameras[b], tie, 0);
      }
      ties.push_back(tie);
    }
  }
  return ties;
}

// Joins the cameras by the strongest ties.
void MakeGroups(size_t cameras, const std::vector<Tie>& ties, CameraTies& out) {
  out.camera_from_reference.assign(cameras, Eigen::Isometry3d::Identity());
  std::vector<bool> joined(cameras, false);
  for (size_t first = 0; first < cameras; ++first) {
    if (joined[first]) continue;
    std::vector<size_t> group = {first};
    joined[first] = true;
    while (true) {
      const Tie* best = nullptr;
      for (const Tie& tie : ties) {
        if (joined[tie.a] != joined[tie.b] && (best == nullptr || tie.agreeing > best->agreeing)) {
          best = &tie;
        }
      }
      if (best == nullptr) break;
      const bool forward = joined[best->a];
      const size_t from = forward ? best->a : best->b;
      const size_t to = forward ? best->b : best->a;
      const Eigen::Isometry3d& step = best->b_from_a;
      out.camera_from_reference[to] =
          (forward ? step : step.inverse()) * out.camera_from_reference[from];
      joined[to] = true;
      group.push_back(to);
    }
    std::ranges::sort(group);
    out.groups.push_back(group);
  }
}

}  // namespace

absl::StatusOr<CameraTies> TieCameras(const std::vector<LensCamera>& cameras,
                                      const std::vector<PosedView>& views) {
  std::vector<StandsOfCamera> stands(cameras.size());
  std::map<Stand, std::vector<size_t>> seen;
  for (size_t i = 0; i < views.size(); ++i) {
    const Stand stand(views[i].view->stand, views[i].view->board);
    stands[views[i].view->camera][stand] = &views[i];
    seen[stand].push_back(i);
  }
  ASSIGN_OR_RETURN(const std::vector<Tie> ties, AllTies(cameras, stands));
  CameraTies out;
  MakeGroups(cameras.size(), ties, out);

  std::vector<size_t> group_of(cameras.size());
  for (size_t g = 0; g < out.groups.size(); ++g) {
    for (const size_t camera : out.groups[g]) group_of[camera] = g;
  }
  for (const auto& [stand, members] : seen) {
    const size_t placings_before = out.placings.size();
    for (const size_t i : members) {
      const size_t camera = views[i].view->camera;
      const Eigen::Isometry3d pose =
          out.camera_from_reference[camera].inverse() * views[i].camera_from_board;
      const double distance = views[i].camera_from_board.translation().norm();
      const auto same =
          std::find_if(out.placings.begin() + static_cast<std::ptrdiff_t>(placings_before),
                       out.placings.end(), [&](const Placing& placing) {
                         return placing.group == group_of[camera] &&
                                Agree(placing.reference_from_board, pose, distance);
                       });
      if (same != out.placings.end()) {
        same->views.push_back(i);
        continue;
      }
      const bool contradicts = std::any_of(
          out.placings.begin() + static_cast<std::ptrdiff_t>(placings_before), out.placings.end(),
          [&](const Placing& other) { return other.group == group_of[camera]; });
      if (contradicts) {
        out.warnings.push_back(absl::StrCat(
            "frame '", stand.first, "': '", cameras[camera].name,
            "' saw the board elsewhere than the others did; its image is used for its lens only"));
      }
      out.placings.push_back(
          {.group = group_of[camera], .reference_from_board = pose, .views = {i}});
    }
  }
  return out;
}

}  // namespace silhouette
