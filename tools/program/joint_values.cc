// SPDX-License-Identifier: Apache-2.0
#include "tools/program/joint_values.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
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

bool StatesUnit(std::string_view text) {
  const absl::string_view value = absl::StripTrailingAsciiWhitespace(View(text));
  return absl::EndsWith(value, "deg") || absl::EndsWith(value, "rad") || absl::EndsWith(value, "m");
}

double ParseJointValue(std::string_view text, AngleUnit unit, std::optional<bool> slides) {
  absl::string_view number = absl::StripTrailingAsciiWhitespace(View(text));
  const double metres = absl::ConsumeSuffix(&number, "mm")   ? 1e-3
                        : absl::ConsumeSuffix(&number, "cm") ? 1e-2
                        : absl::ConsumeSuffix(&number, "m")  ? 1
                                                             : 0;
  const bool is_length = metres > 0;
  const bool in_degrees = !is_length && absl::ConsumeSuffix(&number, "deg");
  const bool is_angle = in_degrees || (!is_length && absl::ConsumeSuffix(&number, "rad"));
  double value = 0;
  if (!IsDecimal({number.data(), number.size()}, value)) {
    throw std::invalid_argument(
        absl::StrCat("'", View(text), "' is no joint value; 0.5, -30deg and 0.2m are"));
  }
  const bool slides_surely = slides.value_or(false);
  if (is_angle && slides_surely) {
    throw std::invalid_argument(
        absl::StrCat("'", View(text), "' is an angle, but the joint slides: write 0.2 or 0.2m"));
  }
  if (is_length && !slides.value_or(true)) {
    throw std::invalid_argument(
        absl::StrCat("'", View(text), "' is a length, but the joint turns: write 0.5 or 30deg"));
  }
  const bool bare = !is_length && !is_angle;
  const bool degrees = in_degrees || (bare && unit == AngleUnit::kDegrees && !slides_surely);
  if (is_length) return value * metres;
  return degrees ? value * std::numbers::pi / 180 : value;
}

std::vector<double> ParseConfiguration(std::string_view text,
                                       std::span<const std::optional<bool>> slides) {
  std::vector<double> values;
  for (const absl::string_view part : absl::StrSplit(View(text), ',')) {
    const bool known = values.size() < slides.size();
    values.push_back(ParseJointValue({part.data(), part.size()}, AngleUnit::kRadians,
                                     known ? slides[values.size()] : std::nullopt));
  }
  return values;
}

std::pair<std::string, double> ParseJoint(std::string_view text, AngleUnit unit,
                                          std::optional<bool> slides) {
  const size_t equals = text.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    throw std::invalid_argument(
        absl::StrCat("'", View(text), "' is not name=value, as in joint_1=0.5"));
  }
  return {std::string(text.substr(0, equals)),
          ParseJointValue(text.substr(equals + 1), unit, slides)};
}

}  // namespace silhouette
