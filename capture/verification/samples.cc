// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/samples.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/time.h"
#include "db/status/status_macros.h"
#include "db/store/suspects.h"

namespace silhouette {
namespace {

constexpr int kMostMisses = 3;

std::vector<std::string> JointsOf(const storage::v1::CellDescription& cell) {
  std::vector<std::string> names;
  for (const auto& joint : cell.grid_joints()) names.push_back(joint.name());
  for (const auto& joint : cell.fixed_joints()) names.push_back(joint.name());
  return names;
}

absl::StatusOr<size_t> PlaceOf(const std::string& name, const std::vector<std::string>& names,
                               const std::string& what, const Database& captured) {
  const auto found = std::ranges::find(names, name);
  if (found != names.end()) return static_cast<size_t>(found - names.begin());
  return absl::InvalidArgumentError(absl::StrCat("the captured database '", captured.path(),
                                                 "' has no ", what, " '", name,
                                                 "'; take one of this cell"));
}

// InvalidArgument: the joint of a cell goes where the captured one, at `place`, does not.
absl::Status RequireRange(const storage::v1::GridJoint& joint, size_t place,
                          const Database& captured, double fixed_joint_tolerance) {
  const storage::v1::CellDescription& cell = captured.cell();
  const auto moving = static_cast<size_t>(cell.grid_joints_size());
  double lower = 0;
  double upper = 0;
  if (place >= moving) {
    const double at = cell.fixed_joints(static_cast<int>(place - moving)).position();
    lower = at - fixed_joint_tolerance;
    upper = at + fixed_joint_tolerance;
  } else {
    const storage::v1::GridJoint& there = cell.grid_joints(static_cast<int>(place));
    const bool in_the_middle = there.steps() == 1;
    lower = in_the_middle ? std::midpoint(there.lower(), there.upper()) : there.lower();
    upper = in_the_middle ? lower : there.upper();
    const double step = in_the_middle ? 0 : (upper - lower) / (there.steps() - 1);
    // The last value may be a step before the first, a turn on.
    const bool whole_turn =
        there.continuous() && upper - lower + step >= 2 * std::numbers::pi - kLimitTolerance;
    if (whole_turn) return absl::OkStatus();
  }
  if (joint.lower() >= lower - kLimitTolerance && joint.upper() <= upper + kLimitTolerance) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "the joint '%s' moves from %g to %g, but in the captured database '%s' only from %g to %g: "
      "capture all of its range, verify the model by driving the robot, or state the captured "
      "range in the cell file",
      joint.name(), joint.lower(), joint.upper(), captured.path(), lower, upper));
}

// Where the joints and views of a cell are in captured records.
struct CapturedPlaces {
  std::vector<size_t> joints;
  std::vector<std::pair<size_t, double>> fixed;  // and where they must stand
  std::vector<size_t> views;
};

absl::StatusOr<CapturedPlaces> PlacesIn(const Database& captured,
                                        const storage::v1::CellDescription& cell,
                                        double fixed_joint_tolerance) {
  CapturedPlaces places;
  const std::vector<std::string> joints = JointsOf(captured.cell());
  for (const auto& joint : cell.grid_joints()) {
    ASSIGN_OR_RETURN(const size_t place, PlaceOf(joint.name(), joints, "joint", captured));
    RETURN_IF_ERROR(RequireRange(joint, place, captured, fixed_joint_tolerance));
    places.joints.push_back(place);
  }
  for (const auto& joint : cell.fixed_joints()) {
    ASSIGN_OR_RETURN(const size_t place, PlaceOf(joint.name(), joints, "joint", captured));
    places.fixed.emplace_back(place, joint.position());
  }
  std::vector<std::string> views;
  for (const auto& view : captured.cell().views()) views.push_back(view.name());
  for (const auto& view : cell.views()) {
    ASSIGN_OR_RETURN(const size_t place, PlaceOf(view.name(), views, "view", captured));
    const auto& there = captured.cell().views(static_cast<int>(place));
    if (there.mask_width() != view.mask_width() || there.mask_height() != view.mask_height()) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "the captured database '%s' has masks of %dx%d pixels of the view '%s', the cell of "
          "%dx%d; rebuild them with 'silhouette-capture remask --into', or capture them again",
          captured.path(), there.mask_width(), there.mask_height(), view.name(), view.mask_width(),
          view.mask_height()));
    }
    places.views.push_back(place);
  }
  return places;
}

}  // namespace

absl::StatusOr<std::vector<ModelSample>> SamplesIn(const Database& captured,
                                                   const storage::v1::CellDescription& cell,
                                                   size_t count, double fixed_joint_tolerance,
                                                   uint64_t seed) {
  ASSIGN_OR_RETURN(const CapturedPlaces places, PlacesIn(captured, cell, fixed_joint_tolerance));
  ASSIGN_OR_RETURN(const Snapshot snapshot, captured.Read());
  ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
  const SuspectSpans suspects(history);
  std::vector<ConfigurationNumber> numbers;
  size_t suspect = 0;
  RETURN_IF_ERROR(
      snapshot.ForEach([&](ConfigurationNumber number, const absl::StatusOr<RobotImage>& image) {
        if (!image.ok() || image->excluded || image->measured.empty()) return true;
        if (suspects.Contain(image->captured)) {
          ++suspect;
        } else {
          numbers.push_back(number);
        }
        return true;
      }));
  if (numbers.empty() && suspect > 0) {
    return absl::FailedPreconditionError(absl::StrCat(
        "all ", suspect, " robot images of the captured database '", captured.path(),
        "' are suspect: the cell may have changed; capture them again with: silhouette-capture run "
        "--only suspect"));
  }
  if (numbers.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("the captured database '", captured.path(),
                     "' has no robot images with their joint values; capture some"));
  }
  std::mt19937_64 random(seed);
  std::ranges::shuffle(numbers, random);
  if (numbers.size() > count) numbers.resize(count);
  std::vector<ModelSample> samples;
  for (const ConfigurationNumber number : numbers) {
    ASSIGN_OR_RETURN(const auto image, snapshot.Find(number));
    for (const auto& [place, position] : places.fixed) {
      const double off = std::abs(image->measured[place] - position);
      if (off <= fixed_joint_tolerance) continue;
      return absl::InvalidArgumentError(absl::StrFormat(
          "the captured database '%s' has the fixed joint '%s' at %g, the cell at %g; state it "
          "there as it was captured",
          captured.path(), JointsOf(captured.cell())[place], image->measured[place], position));
    }
    ModelSample& sample = samples.emplace_back();
    for (const size_t place : places.joints) sample.q.push_back(image->measured[place]);
    for (const size_t view : places.views) sample.captured.push_back(image->masks[view]);
  }
  return samples;
}

std::string FaceName(int face) {
  return absl::StrCat("the ", face < 3 ? "lower" : "upper", " face of 'workspace' across ",
                      std::string(1, "xyz"[face % 3]));
}

std::string AlwaysNarrowText(const ModelSampler& sampler, std::span<const std::string> link_names) {
  std::string pairs;
  std::string options;
  std::string beyond;
  for (const NarrowGap& gap : sampler.AlwaysNarrow()) {
    const std::string& link = link_names[gap.link];
    if (gap.face >= 0) {
      absl::StrAppendFormat(&beyond,
                            "%s'%s' with its tolerance is beyond %s, or nearer than %.0f mm to it, "
                            "at all joint values that were tried: correct 'workspace' in the cell "
                            "file, so that it holds the whole robot with room to spare",
                            beyond.empty() ? "" : "; ", link, FaceName(gap.face),
                            1000 * kLeastKept);
      continue;
    }
    const std::string& other = link_names[gap.other];
    absl::StrAppend(&pairs, pairs.empty() ? "" : ", ", "'", link, "' and '", other, "'");
    absl::StrAppend(&options, " --not-checked '", link, "' '", other, "'");
  }
  if (pairs.empty()) return beyond;
  return absl::StrCat(
      "by the model these links touch at all joint values that were tried, so it cannot show "
      "whether they meet: ",
      pairs,
      "; mend the model, or, where they cannot meet on the robot, let verify-model leave "
      "them out:",
      options, beyond.empty() ? "" : "; ", beyond);
}

namespace {

class SampleDrive {
 public:
  SampleDrive(SessionParts& parts, ModelSampler& sampler, std::span<const std::string> link_names,
              Database& kept, RobotImageWriter& writer, const CaptureObserver& observer)
      : parts_(parts),
        sampler_(sampler),
        link_names_(link_names),
        kept_(kept),
        writer_(writer),
        visitor_(parts, observer),
        observer_(observer) {}

  // An error stops the robot.
  absl::Status Go(size_t count, std::vector<ModelSample>& samples);

 private:
  absl::Status Drive(size_t count, std::vector<ModelSample>& samples);
  absl::Status VisitOne(const Configuration& place, std::vector<ModelSample>& samples);
  // AlreadyExists: what is kept has the grid value.
  absl::Status Keep(const Configuration& place, const Visit& visit, const std::vector<Mask>& masks);
  // Aborted: it is one in a row too many.
  absl::Status Missed(absl::string_view why);
  absl::StatusOr<Configuration> Here();
  // Why the robot cannot leave.
  absl::Status NoWayFrom(const Configuration& here);

  SessionParts& parts_;
  ModelSampler& sampler_;
  const std::span<const std::string> link_names_;
  Database& kept_;
  RobotImageWriter& writer_;
  Visitor visitor_;
  const CaptureObserver& observer_;
  int misses_ = 0;
};

absl::StatusOr<Configuration> SampleDrive::Here() {
  ASSIGN_OR_RETURN(Configuration here, parts_.robot.Measure());
  here.resize(static_cast<size_t>(parts_.travel->grid().dimensions()));
  return here;
}

absl::Status SampleDrive::NoWayFrom(const Configuration& here) {
  std::string gaps;
  bool touches = false;
  bool links_touch = false;
  for (const NarrowGap& gap : sampler_.NarrowGapsAt(here)) {
    const bool to_face = gap.face >= 0;
    if (gap.width < kLeastKept) (to_face ? touches : links_touch) = true;
    absl::StrAppend(&gaps, "\n  '", link_names_[gap.link], "' and ",
                    to_face ? FaceName(gap.face) : absl::StrCat("'", link_names_[gap.other], "'"),
                    absl::StrFormat(": %.1f mm apart by the model, %.1f mm are kept",
                                    1000 * gap.width, 1000 * gap.kept));
  }
  touches = touches || links_touch;
  return absl::FailedPreconditionError(absl::StrCat(
      touches ? absl::StrFormat("the robot is not driven from where it stands: by the model it is "
                                "nearer than %.0f mm to itself or to a face of 'workspace'",
                                1000 * kLeastKept)
              : "no configuration was found to which the robot can go straight, within its limits "
                "and 'workspace', past itself and the forbidden regions",
      gaps, "\nmove the robot by hand",
      links_touch ? "; where links touch by the model and cannot on the robot, mend the model, or "
                    "name them: --not-checked LINK OTHER_LINK"
                  : ""));
}

absl::Status SampleDrive::Go(size_t count, std::vector<ModelSample>& samples) {
  absl::Status status = Drive(count, samples);
  if (!status.ok()) visitor_.StopRobot();
  return status;
}

absl::Status SampleDrive::Drive(size_t count, std::vector<ModelSample>& samples) {
  if (samples.size() >= count) return absl::OkStatus();
  if (std::string always = AlwaysNarrowText(sampler_, link_names_); !always.empty()) {
    return absl::FailedPreconditionError(always);
  }
  while (samples.size() < count && !observer_.stop_requested()) {
    ASSIGN_OR_RETURN(const Configuration here, Here());
    const std::optional<Configuration> next = sampler_.Next(here);
    if (!next) return NoWayFrom(here);
    RETURN_IF_ERROR(VisitOne(*next, samples));
    observer_.progress(samples.size());
  }
  return absl::OkStatus();
}

absl::Status SampleDrive::VisitOne(const Configuration& place, std::vector<ModelSample>& samples) {
  ASSIGN_OR_RETURN(const Visit visit, visitor_.GoStraight(place));
  if (visit.outcome != Visit::Outcome::kTaken) return Missed(visit.why);
  std::vector<Mask> masks = RobotMasks(parts_, visit);
  const absl::Status kept = Keep(place, visit, masks);
  if (absl::IsAlreadyExists(kept)) return Missed(kept.message());
  RETURN_IF_ERROR(kept);
  misses_ = 0;
  Configuration q(visit.measured.begin(),
                  visit.measured.begin() + parts_.travel->grid().dimensions());
  samples.push_back({.q = std::move(q), .captured = std::move(masks)});
  return absl::OkStatus();
}

absl::Status SampleDrive::Missed(absl::string_view why) {
  if (++misses_ == kMostMisses) return absl::AbortedError(why);
  observer_.say(std::string(why));
  return absl::OkStatus();
}

absl::Status SampleDrive::Keep(const Configuration& place, const Visit& visit,
                               const std::vector<Mask>& masks) {
  RobotImage image;
  const std::optional<ConfigurationNumber> number = kept_.grid().Nearest(place);
  if (!number) return absl::InternalError("the robot was driven beyond its joints' ranges");
  image.number = *number;
  image.masks = masks;
  image.captured = visit.images.captured;
  image.commanded = parts_.robot.Commanded(place);
  image.measured = visit.measured;
  return writer_.Put(image);
}

}  // namespace

absl::Status TakeSamples(SessionParts& parts, ModelSampler& sampler,
                         std::span<const std::string> link_names, size_t count,
                         const std::string& program, Database& kept,
                         std::vector<ModelSample>& samples, const CaptureObserver& observer) {
  ASSIGN_OR_RETURN(RobotImageWriter writer, kept.Write(program, absl::ZeroDuration()));
  return SampleDrive(parts, sampler, link_names, kept, writer, observer).Go(count, samples);
}

}  // namespace silhouette
