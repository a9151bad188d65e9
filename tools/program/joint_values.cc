// SPDX-License-Identifier: Apache-2.0
#include "tools/program/joint_values.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

namespace silhouette {
namespace {

absl::string_view View(std::string_view text) { return {text.data(), text.size()}; }

}  // namespace

bool IsDecimal(std::string_view text, double& value) {
  // The library takes 0x10, too.
  return text.find_first_of("xX") == text.npos && absl::SimpleAtod(View(text), &value) &&
         std::isfinite(value);
}

double ParseJointValue(std::string_view text, AngleUnit unit) {
  absl::string_view number = View(text);
  bool degrees = unit == AngleUnit::kDegrees;
  if (absl::ConsumeSuffix(&number, "deg")) {
    degrees = true;
  } else if (absl::ConsumeSuffix(&number, "rad") || absl::ConsumeSuffix(&number, "m")) {
    degrees = false;
  }
  double value = 0;
  if (!IsDecimal({number.data(), number.size()}, value)) {
    throw std::invalid_argument(
        absl::StrCat("'", View(text), "' is no joint value; 0.5, -30deg and 0.2m are"));
  }
  return degrees ? value * std::numbers::pi / 180 : value;
}

std::vector<double> ParseConfiguration(std::string_view text, AngleUnit unit) {
  std::vector<double> values;
  for (const absl::string_view part : absl::StrSplit(View(text), ',')) {
    values.push_back(ParseJointValue({part.data(), part.size()}, unit));
  }
  return values;
}

std::pair<std::string, double> ParseJoint(std::string_view text, AngleUnit unit) {
  const size_t equals = text.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    throw std::invalid_argument(
        absl::StrCat("'", View(text), "' is not name=value, as in joint_1=0.5"));
  }
  return {std::string(text.substr(0, equals)), ParseJointValue(text.substr(equals + 1), unit)};
}

std::string DegreesHint(std::span<const double> radians, std::string_view or_else) {
  constexpr double kNoAngle = 4 * std::numbers::pi;  // joints hardly turn twice
  constexpr double kMost = 720;
  const auto seems_degrees = [](double value) {
    return std::abs(value) > kNoAngle && std::abs(value) <= kMost;
  };
  if (std::ranges::none_of(radians, seems_degrees)) return "";
  return absl::StrCat(" (joint values are radians; did you mean degrees? Write 90deg",
                      View(or_else), ")");
}

}  // namespace silhouette
