// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/formats/typed_joints.h"

#include <stdexcept>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/formats/output.h"

namespace silhouette {

TypedJoints::TypedJoints(AngleUnit unit,
                         std::function<absl::StatusOr<v1::GetDatabaseResponse>()> database)
    : unit_(unit), database_(std::move(database)) {}

absl::StatusOr<Configuration> TypedJoints::Parse(absl::string_view text) {
  return Parse(std::vector<std::string>(absl::StrSplit(text, ',')));
}

absl::StatusOr<Configuration> TypedJoints::Parse(const std::vector<std::string>& values,
                                                 absl::string_view place) {
  Configuration configuration;
  for (const std::string& value : values) {
    RETURN_IF_ERROR(AskIfItMatters(value));
    try {
      configuration.push_back(ParseJointValue(value, unit_, Slides(configuration.size())));
    } catch (const std::invalid_argument& error) {
      return absl::InvalidArgumentError(absl::StrCat(place, error.what()));
    }
  }
  return configuration;
}

absl::StatusOr<std::pair<std::string, double>> TypedJoints::ParseNamed(const std::string& text) {
  const std::string name = text.substr(0, text.find('='));
  RETURN_IF_ERROR(AskIfItMatters(text.substr(name.size())));
  std::optional<bool> slides;
  for (int j = 0; grid_ && j < grid_->joints_size(); ++j) {
    if (grid_->joints(j).name() == name) slides = Slides(static_cast<size_t>(j));
  }
  try {
    return ParseJoint(text, unit_, slides);
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(error.what());
  }
}

std::vector<std::optional<bool>> TypedJoints::Slides() {
  if (!grid_) Ask().IgnoreError();
  std::vector<std::optional<bool>> slides;
  for (int j = 0; grid_ && j < grid_->joints_size(); ++j) {
    slides.push_back(Slides(static_cast<size_t>(j)));
  }
  return slides;
}

std::string TypedJoints::Spoken(absl::string_view text) const {
  std::vector<std::string> values = absl::StrSplit(text, ',');
  for (size_t j = 0; j < values.size(); ++j) {
    absl::StripAsciiWhitespace(&values[j]);
    if (unit_ != AngleUnit::kDegrees || StatesUnit(values[j])) continue;
    values[j] += Slides(j).value_or(false) ? "m" : "deg";
  }
  return absl::StrJoin(values, ",");
}

absl::Status TypedJoints::AskIfItMatters(absl::string_view text) {
  if (grid_ || (unit_ == AngleUnit::kRadians && !StatesUnit({text.data(), text.size()}))) {
    return absl::OkStatus();
  }
  return Ask();
}

absl::Status TypedJoints::Ask() {
  ASSIGN_OR_RETURN(v1::GetDatabaseResponse database, database_());
  grid_ = std::move(*database.mutable_grid());
  return absl::OkStatus();
}

std::optional<bool> TypedJoints::Slides(size_t joint) const {
  if (!grid_ || joint >= static_cast<size_t>(grid_->joints_size())) return std::nullopt;
  const v1::GridJoint& known = grid_->joints(static_cast<int>(joint));
  return known.has_slides() ? std::optional(known.slides()) : std::nullopt;
}

}  // namespace silhouette
