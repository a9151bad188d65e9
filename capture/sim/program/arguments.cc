#include "capture/sim/program/arguments.h"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

namespace silhouette {

double ParseJointValue(const std::string& text) {
  absl::string_view number = text;
  const bool degrees = absl::ConsumeSuffix(&number, "deg");
  if (!degrees) absl::ConsumeSuffix(&number, "rad");
  double value = 0;
  if (!absl::SimpleAtod(number, &value) || !std::isfinite(value)) {
    throw std::invalid_argument("'" + text + "' is no joint value; 0.5 and -30deg are");
  }
  return degrees ? value * std::numbers::pi / 180 : value;
}

std::vector<double> ParseConfiguration(const std::string& text) {
  std::vector<double> values;
  for (const absl::string_view part : absl::StrSplit(text, ',')) {
    values.push_back(ParseJointValue(std::string(part)));
  }
  return values;
}

std::pair<std::string, double> ParseJoint(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw std::invalid_argument("'" + text + "' is not name=value, e.g. joint_1=0.5");
  }
  return {text.substr(0, equals), ParseJointValue(text.substr(equals + 1))};
}

}  // namespace silhouette
