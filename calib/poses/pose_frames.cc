// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_frames.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr char kRow[] = "row ";

using Frames = std::vector<std::string>;

size_t EndOfDigits(const std::string& text, size_t from) {
  while (from < text.size() && absl::ascii_isdigit(static_cast<unsigned char>(text[from]))) ++from;
  return from;
}

// The last number in a name; nothing if there is none, or it is a fraction's.
std::optional<int64_t> NumberIn(const std::string& name) {
  double whole = 0;
  if (absl::SimpleAtod(name, &whole) && absl::StrContains(name, ".")) return std::nullopt;
  std::optional<int64_t> number;
  for (size_t i = 0; i < name.size(); ++i) {
    const size_t end = EndOfDigits(name, i);
    if (end == i) continue;
    int64_t value = 0;
    number =
        absl::SimpleAtoi(name.substr(i, end - i), &value) ? std::optional(value) : std::nullopt;
    i = end;
  }
  return number;
}

// Names by the numbers in them.
using Numbered = std::map<int64_t, std::string>;

// Of names with numbers that differ; empty if some have none, or two have the same.
Numbered ByNumber(const Frames& names) {
  Numbered by_number;
  for (const std::string& name : names) {
    const std::optional<int64_t> number = NumberIn(name);
    if (!number || !by_number.emplace(*number, name).second) return {};
  }
  return by_number;
}

std::string StemOf(const std::string& name) {
  const std::filesystem::path path(absl::StrReplaceAll(name, {{"\\", "/"}}));
  const std::string extension = path.extension().string();
  const bool of_file =
      extension.size() > 1 &&
      std::ranges::all_of(
          extension.substr(1),
          [](char c) { return absl::ascii_isalnum(static_cast<unsigned char>(c)); }) &&
      absl::ascii_isalpha(static_cast<unsigned char>(extension[1]));
  return of_file ? path.stem().string() : path.filename().string();
}

size_t CountKnown(const std::vector<RobotPose>& poses, const Frames& frames) {
  return static_cast<size_t>(std::ranges::count_if(poses, [&](const RobotPose& pose) {
    return std::ranges::find(frames, pose.frame) != frames.end();
  }));
}

bool AreDifferent(const std::vector<RobotPose>& poses) {
  std::set<std::string> names;
  return std::ranges::all_of(
      poses, [&](const RobotPose& pose) { return names.insert(pose.frame).second; });
}

absl::StatusOr<std::string> NameRows(const Frames& frames, std::vector<RobotPose>& poses) {
  const std::string order =
      absl::StrCat("rows of robot poses have no frames; they are taken in the order of '",
                   frames.front(), "' to '", frames.back(), "'");
  const Numbered by_number = ByNumber(frames);
  const auto rows = static_cast<int64_t>(poses.size());
  const int64_t first = by_number.empty() ? -1 : by_number.begin()->first;
  const int64_t last = by_number.empty() ? -1 : by_number.rbegin()->first;
  if (frames.size() == poses.size()) {
    if (!by_number.empty() && last - first != rows - 1) {
      return InvalidArgument("robot poses have no frames, and numbers are missing between '",
                             by_number.begin()->second, "' and '", by_number.rbegin()->second,
                             "'; put the frame first in each line of the poses");
    }
    for (size_t i = 0; i < poses.size(); ++i) poses[i].frame = frames[i];
    return order;
  }
  if (!(first == 0 && last == rows - 1) && !(first > 0 && last == rows)) {
    return InvalidArgument("there are ", poses.size(), " robot poses without frames, but ",
                           frames.size(), " frames with sightings, '", frames.front(), "' to '",
                           frames.back(), "'; put the frame first in each line of the poses");
  }
  for (size_t i = 0; i < poses.size(); ++i) {
    const auto found = by_number.find(static_cast<int64_t>(i) + (first == 0 ? 0 : 1));
    if (found != by_number.end()) poses[i].frame = found->second;
  }
  return absl::StrCat(order, ", by their numbers");
}

// A name whose number the others do not have; empty if there is none.
std::string Unmatched(const Numbered& names, const Numbered& others) {
  const auto found =
      std::ranges::find_if(names, [&](const auto& named) { return !others.contains(named.first); });
  return found == names.end() ? std::string() : found->second;
}

// Numbers are certain if all of one list are in the other, and not one counts from 0, the other
// from 1.
absl::Status CheckNumbers(const Numbered& poses, const Numbered& frames) {
  const int64_t first_pose = poses.begin()->first;
  const int64_t first_frame = frames.begin()->first;
  const bool same_start = first_pose == first_frame || std::min(first_pose, first_frame) != 0 ||
                          std::max(first_pose, first_frame) != 1;
  const std::string pose = Unmatched(poses, frames);
  const std::string frame = Unmatched(frames, poses);
  const bool uncertain = !pose.empty() && !frame.empty();
  if (same_start && !uncertain) return absl::OkStatus();
  return InvalidArgument(
      "robot poses are numbered ", first_pose, " to ", poses.rbegin()->first, ", images ",
      first_frame, " to ", frames.rbegin()->first,
      uncertain ? absl::StrCat("; pose '", pose, "' and image '", frame, "' have no counterpart")
                : std::string(),
      "; use the same names for both");
}

// The names as time stamps; empty if one is none.
std::vector<double> StampsOf(const Frames& names) {
  constexpr double kLeastWhole = 1e8;  // smaller whole numbers count images
  std::vector<double> stamps;
  for (const std::string& name : names) {
    double stamp = 0;
    if (!absl::SimpleAtod(name, &stamp) || !std::isfinite(stamp)) return {};
    if (!absl::StrContains(name, ".") && stamp < kLeastWhole) return {};
    stamps.push_back(stamp);
  }
  return stamps;
}

double MedianSpacing(std::vector<double> stamps) {
  if (stamps.size() < 2) return 0;
  std::ranges::sort(stamps);
  std::vector<double> gaps;
  for (size_t i = 1; i < stamps.size(); ++i) gaps.push_back(stamps[i] - stamps[i - 1]);
  std::ranges::nth_element(gaps, gaps.begin() + static_cast<ptrdiff_t>(gaps.size() / 2));
  return gaps[gaps.size() / 2];
}

// Names each image's nearest pose in time as the image. Nothing if names are no stamps, none is
// near, or two images have the same nearest one.
std::optional<std::string> NameByStamps(const Frames& frames, std::vector<RobotPose>& poses) {
  constexpr double kNear = 0.1;  // of the spacing of images
  Frames names;
  for (const RobotPose& pose : poses) names.push_back(pose.frame);
  const std::vector<double> images = StampsOf(frames);
  const std::vector<double> stamps = StampsOf(names);
  if (images.empty() || stamps.empty()) return std::nullopt;
  const double limit = kNear * MedianSpacing(images);
  double most = 0;
  std::map<size_t, std::string> named;
  for (size_t i = 0; i < images.size(); ++i) {
    const auto apart = [&](double stamp) { return std::abs(stamp - images[i]); };
    const auto nearest = std::ranges::min_element(stamps, std::less(), apart);
    if (apart(*nearest) > limit) continue;
    most = std::max(most, apart(*nearest));
    if (!named.emplace(nearest - stamps.begin(), frames[i]).second) return std::nullopt;
  }
  if (named.empty()) return std::nullopt;
  for (const auto& [pose, frame] : named) poses[pose].frame = frame;
  if (most == 0) return std::string();
  return absl::StrFormat(
      "%d of %d images are matched with the robot's pose that is nearest in time, %.3g apart at "
      "most, in the unit of the stamps; see that the robot stood still that long",
      named.size(), frames.size(), most);
}

}  // namespace

bool IsBefore(const std::string& name, const std::string& other) {
  size_t i = 0;
  size_t k = 0;
  while (i < name.size() && k < other.size()) {
    const size_t i_end = EndOfDigits(name, i);
    const size_t k_end = EndOfDigits(other, k);
    if (i_end == i || k_end == k) {
      if (name[i] != other[k]) return name[i] < other[k];
      ++i;
      ++k;
      continue;
    }
    const auto digits = [](const std::string& text, size_t from, size_t to) {
      const size_t value = std::min(text.find_first_not_of('0', from), to);
      return text.substr(value, to - value);
    };
    const std::string number = digits(name, i, i_end);
    const std::string other_number = digits(other, k, k_end);
    if (number.size() != other_number.size()) return number.size() < other_number.size();
    if (number != other_number) return number < other_number;
    i = i_end;
    k = k_end;
  }
  return name.size() - i != other.size() - k ? name.size() - i < other.size() - k : name < other;
}

std::string NameOfRow(size_t row) { return absl::StrCat(kRow, row); }

absl::StatusOr<std::string> NamePosesByFrames(std::span<const TagSighting> sightings,
                                              std::vector<RobotPose>& poses) {
  std::set<std::string> seen;
  for (const TagSighting& sighting : sightings) seen.insert(sighting.frame);
  Frames frames(seen.begin(), seen.end());
  std::ranges::sort(frames, IsBefore);
  if (poses.empty() || frames.empty()) return std::string();
  if (std::optional<std::string> said = NameByStamps(frames, poses)) return *std::move(said);
  if (CountKnown(poses, frames) > 0) return std::string();
  if (absl::StartsWith(poses.front().frame, kRow)) return NameRows(frames, poses);
  std::vector<RobotPose> renamed = poses;
  for (RobotPose& pose : renamed) pose.frame = StemOf(pose.frame);
  if (CountKnown(renamed, frames) > 0 && AreDifferent(renamed)) {
    poses = std::move(renamed);
    return std::string();
  }
  Frames names;
  for (const RobotPose& pose : poses) names.push_back(StemOf(pose.frame));
  const Numbered poses_by_number = ByNumber(names);
  const Numbered frames_by_number = ByNumber(frames);
  if (poses_by_number.empty() || frames_by_number.empty()) return std::string();
  RETURN_IF_ERROR(CheckNumbers(poses_by_number, frames_by_number));
  size_t matched = 0;
  std::string example;
  for (size_t i = 0; i < poses.size(); ++i) {
    const auto found = frames_by_number.find(*NumberIn(names[i]));
    if (found == frames_by_number.end()) continue;
    if (matched == 0) example = absl::StrCat("'", poses[i].frame, "' to '", found->second, "'");
    poses[i].frame = found->second;
    ++matched;
  }
  return absl::StrCat(
      matched, " of ", poses.size(),
      " robot poses are matched with images by the numbers in their names: ", example);
}

std::vector<RobotPose> SortedOtherwise(const std::vector<RobotPose>& poses, bool people) {
  Frames counted;
  for (const RobotPose& pose : poses) counted.push_back(pose.frame);
  Frames text = counted;
  std::ranges::sort(counted, IsBefore);
  std::ranges::sort(text);
  if (counted == text) return {};
  std::map<std::string, std::string> names;
  for (size_t i = 0; i < text.size(); ++i) {
    names.emplace(people ? text[i] : counted[i], people ? counted[i] : text[i]);
  }
  std::vector<RobotPose> renamed = poses;
  for (RobotPose& pose : renamed) pose.frame = names.at(pose.frame);
  return renamed;
}

}  // namespace silhouette
