#include "tools/silhouette/formats/configuration_text.h"

#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

Configuration ParseParts(const std::vector<std::string>& parts, AngleUnit unit) {
  Configuration configuration;
  for (const std::string& part : parts) configuration.push_back(ParseJointValue(part, unit));
  return configuration;
}

absl::StatusOr<std::string> ReadText(const std::string& file) {
  if (file != "-") return ReadWholeFile(file);
  return std::string(std::istreambuf_iterator<char>(std::cin), {});
}

}  // namespace

absl::StatusOr<std::vector<Configuration>> ReadConfigurations(const std::string& file,
                                                              AngleUnit unit) {
  ASSIGN_OR_RETURN(const std::string text, ReadText(file));
  std::vector<Configuration> configurations;
  int line_number = 0;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    ++line_number;
    try {
      std::optional<Configuration> configuration = ParseLine(line, unit);
      if (configuration) configurations.push_back(*std::move(configuration));
    } catch (const std::invalid_argument& error) {
      return absl::InvalidArgumentError(absl::StrCat(file, ":", line_number, ": ", error.what()));
    }
  }
  return configurations;
}

std::optional<Configuration> ParseLine(absl::string_view line, AngleUnit unit) {
  const absl::string_view content =
      absl::StripAsciiWhitespace(line.substr(0, std::min(line.find('#'), line.size())));
  if (content.empty()) return std::nullopt;
  return ParseParts(absl::StrSplit(content, absl::ByAnyChar(", \t"), absl::SkipEmpty()), unit);
}

absl::StatusOr<std::vector<Configuration>> ReadWaypoints(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadText(file));
  try {
    auto waypoints = nlohmann::json::parse(text).at("waypoints").get<std::vector<Configuration>>();
    if (waypoints.empty()) return absl::InvalidArgumentError(file + ": the path has no waypoint");
    return waypoints;
  } catch (const nlohmann::json::parse_error& error) {
    return absl::InvalidArgumentError(absl::StrCat(file, ": not JSON, at byte ", error.byte));
  } catch (const nlohmann::json::exception&) {
    return absl::InvalidArgumentError(
        file + ": a list of configurations under the key \"waypoints\" is expected");
  }
}

std::string Spoken(const Configuration& configuration) {
  return absl::StrJoin(configuration, ",", [](std::string* out, double value) {
    absl::StrAppendFormat(out, "%.6g", value);
  });
}

}  // namespace silhouette
