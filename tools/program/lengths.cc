// SPDX-License-Identifier: Apache-2.0
#include "tools/program/lengths.h"

#include <CLI/CLI.hpp>
#include <stdexcept>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tools/program/joint_values.h"

namespace silhouette {

CLI::Option* TakeLengths(CLI::Option* option, LengthUnit unit) {
  const bool in_metres = unit == LengthUnit::kMetres;
  const auto convert = [in_metres](std::string& text) {
    double bare = 0;
    if (IsDecimal(text, bare)) return std::string();
    try {
      const double metres = ParseJointValue(text, AngleUnit::kRadians, /*slides=*/true);
      text = absl::StrFormat("%.17g", in_metres ? metres : metres * 1000);
      return std::string();
    } catch (const std::invalid_argument&) {
      return absl::StrCat("'", text, "' is not a length; write ",
                          in_metres ? "metres" : "millimetres",
                          ", or e.g. '30 mm', '3 cm' or '0.03 m'");
    }
  };
  return option->transform(CLI::Validator(convert, /*description=*/""))->type_name("LENGTH");
}

}  // namespace silhouette
