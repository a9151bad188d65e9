// SPDX-License-Identifier: Apache-2.0
#include "common/yaml/strict_yaml.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <sstream>
#include <system_error>
#include <utility>

#include "common/text/utf8.h"
#include "common/times/times.h"

namespace silhouette {
namespace {

// How many letters are missing, too many, wrong, or exchanged with the next one.
size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<size_t> before(b.size() + 1);  // the row before the last
  std::vector<size_t> last(b.size() + 1);
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    before = std::exchange(last, row);
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t substitution = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, substitution});
      const bool can_exchange = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (can_exchange) row[j] = std::min(row[j], before[j - 2] + 1);
    }
  }
  return row.back();
}

// "<number> <unit>" with the unit's factor; a bare number has factor 1.
std::optional<double> NumberWithUnit(const std::string& text,
                                     const std::map<std::string, double>& units) {
  std::istringstream in(text);
  double number = 0;
  std::string unit;
  std::string rest;
  if (!(in >> number) || !std::isfinite(number)) return std::nullopt;
  if (!(in >> unit)) return number;
  const auto factor = units.find(unit);
  if (factor == units.end() || (in >> rest)) return std::nullopt;
  return number * factor->second;
}

}  // namespace

YamlNode::YamlNode(const YAML::Node& node, std::string file, std::string name)
    : node_(node), file_(std::move(file)), name_(std::move(name)) {}

YamlNode YamlNode::FromFile(const std::string& path) {
  std::error_code unreadable;
  if (std::filesystem::is_directory(path, unreadable)) {
    throw YamlError(path + " is a folder; name a file");
  }
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file) throw YamlError(path + ": the file does not exist or cannot be read");
  return FromText(text, path);
}

namespace {

// Refuses bytes that are no UTF-8: names go into messages and databases. The library itself
// converts UTF-16 and UTF-32 that begin with a mark, or with a character of ASCII.
void RequireUtf8(const std::string& text, const std::string& file) {
  const bool is_wide =
      text.find('\0') < 4 || text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff");
  if (is_wide || IsUtf8(text)) return;
  int line = 1;
  std::istringstream lines(text);
  for (std::string one; std::getline(lines, one) && IsUtf8(one); ++line) {
  }
  throw YamlError(
      file + ":" + std::to_string(line) +
      ": the text is not UTF-8; convert it, as in: iconv -f ISO-8859-1 -t UTF-8 OLD > NEW");
}

// The number of the last line up to `last` whose indentation has a tab; 0: none.
int LineWithTab(const std::string& text, int last) {
  std::istringstream lines(text);
  std::string line;
  int found = 0;
  for (int number = 1; number <= last && std::getline(lines, line); ++number) {
    const size_t content = line.find_first_not_of(" \t");
    if (content != std::string::npos && line.find('\t') < content) found = number;
  }
  return found;
}

}  // namespace

YamlNode YamlNode::FromText(const std::string& text, const std::string& file) {
  RequireUtf8(text, file);
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.empty() || documents.front().IsNull()) {
      throw YamlError(file + ": the file is empty");
    }
    for (size_t i = 1; i < documents.size(); ++i) {
      if (documents[i].IsNull()) continue;
      throw YamlError(file + ":" + std::to_string(documents[i].Mark().line + 1) +
                      ": a second document begins here and would not count; write all into one");
    }
    return {documents.front(), file, ""};
  } catch (const YAML::ParserException& error) {
    if (const int line = LineWithTab(text, error.mark.line + 1); line > 0) {
      throw YamlError(file + ":" + std::to_string(line) +
                      ": the line is indented by a tab; YAML wants spaces");
    }
    throw YamlError(file + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg);
  }
}

void YamlNode::Fail(const std::string& message) const {
  std::string place = file_;
  if (node_.IsDefined() && node_.Mark().line >= 0) {
    place += ":" + std::to_string(node_.Mark().line + 1);
  }
  throw YamlError(place + ": " + (name_.empty() ? "" : name_ + ": ") + message);
}

template <>
std::string YamlNode::As<std::string>() const {
  if (!node_.IsScalar()) Fail("a text is expected");
  return node_.Scalar();
}

template <typename T>
T YamlNode::Decoded(const std::string& expected) const {
  T value{};
  if (!node_.IsScalar() || !YAML::convert<T>::decode(node_, value)) Fail(expected);
  return value;
}

template <>
bool YamlNode::As<bool>() const {
  return Decoded<bool>("true or false is expected");
}

template <>
int YamlNode::As<int>() const {
  const char* expected = "a whole number is expected, in decimal digits";
  // The library takes 0x10, and 010 as 8.
  const std::string digits = node_.IsScalar() ? node_.Scalar() : "";
  const size_t first = digits.find_first_not_of("+-");
  if (first < digits.size() - 1 && digits[first] == '0') Fail(expected);
  return Decoded<int>(expected);
}

template <>
double YamlNode::As<double>() const {
  const auto value = Decoded<double>("a number is expected");
  if (!std::isfinite(value)) Fail("a number is expected");
  return value;
}

double YamlNode::InUnit(const std::map<std::string, double>& units, double least,
                        const std::string& expected) const {
  constexpr double kMost = 1e18;
  const std::optional<double> value =
      node_.IsScalar() ? NumberWithUnit(node_.Scalar(), units) : std::nullopt;
  if (!value || !(*value >= least && *value <= kMost)) Fail(expected);
  return *value;
}

double YamlNode::AsAngle() const {
  return InUnit({{"rad", 1}, {"deg", std::numbers::pi / 180}},
                -std::numeric_limits<double>::infinity(),
                "an angle is expected: radians, or e.g. '90 deg'");
}

double YamlNode::AsPosition() const {
  return InUnit({{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1}}, -std::numeric_limits<double>::infinity(),
                "a position is expected: metres, or e.g. '-50 mm'");
}

double YamlNode::AsAngleOrPosition() const {
  return InUnit({{"rad", 1}, {"deg", std::numbers::pi / 180}, {"mm", 1e-3}, {"cm", 1e-2}, {"m", 1}},
                -std::numeric_limits<double>::infinity(),
                "a joint value is expected: radians or metres, or e.g. '90 deg' or '-50 mm'");
}

double YamlNode::AsLength() const {
  return InUnit({{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1}}, 0,
                "a length is expected: metres, or e.g. '5 mm'");
}

double YamlNode::AsLengthUpTo(double most, const std::string& why) const {
  const double length = AsLength();
  if (length <= most) return length;
  const auto number = [](double value) {
    std::ostringstream text;
    text << value;
    return text.str();
  };
  Fail("that is " + number(length) + " m; at most " + number(most) + " m is expected: " + why +
       "; a number without a unit is in metres, others are written as '35 cm' or '350 mm'");
}

double YamlNode::AsPositiveLengthUpTo(double most, const std::string& why) const {
  const double length = AsLengthUpTo(most, why);
  if (!(length > 0)) Fail("a length greater than 0 is expected");
  return length;
}

absl::Duration YamlNode::AsTime() const {
  const std::optional<absl::Duration> time =
      node_.IsScalar() ? ParseTime(node_.Scalar()) : std::nullopt;
  if (!time) Fail(std::string("a time is expected: ") + kTimeExamples);
  return *time;
}

absl::Duration YamlNode::AsPositiveTime() const {
  const absl::Duration time = AsTime();
  if (time <= absl::ZeroDuration()) Fail("a time greater than 0 is expected");
  return time;
}

double YamlNode::AsPositive() const {
  const double value = As<double>();
  if (!(value > 0)) Fail("a number greater than 0 is expected");
  return value;
}

double YamlNode::AsNotNegative() const {
  const double value = As<double>();
  if (!(value >= 0)) Fail("a number not below 0 is expected");
  return value;
}

double YamlNode::AsShare() const {
  const double value = As<double>();
  if (!(value >= 0 && value <= 1)) Fail("a number from 0 to 1 is expected");
  return value;
}

size_t YamlNode::AsWordOf(const std::vector<std::string>& words) const {
  const auto found = std::ranges::find(words, As<std::string>());
  if (found != words.end()) return static_cast<size_t>(found - words.begin());
  std::string expected;
  for (size_t i = 0; i < words.size(); ++i) {
    expected += (i == 0 ? "'" : i + 1 == words.size() ? " or '" : ", '") + words[i] + "'";
  }
  Fail(expected + " is expected");
}

uint64_t YamlNode::AsBytes() const {
  return static_cast<uint64_t>(InUnit({{"B", 1},
                                       {"kB", 1e3},
                                       {"MB", 1e6},
                                       {"GB", 1e9},
                                       {"TB", 1e12},
                                       {"KiB", 0x1p10},
                                       {"MiB", 0x1p20},
                                       {"GiB", 0x1p30},
                                       {"TiB", 0x1p40}},
                                      0, "a number of bytes is expected, e.g. '8 GB'"));
}

std::vector<YamlNode> YamlNode::Items(std::optional<size_t> count) const {
  if (!node_.IsSequence()) Fail("a list is expected");
  if (count && node_.size() != *count) {
    Fail("a list of " + std::to_string(*count) + " is expected, not of " +
         std::to_string(node_.size()));
  }
  std::vector<YamlNode> items;
  for (size_t i = 0; i < node_.size(); ++i) {
    items.emplace_back(node_[i], file_, name_ + "[" + std::to_string(i) + "]");
  }
  return items;
}

YamlMap::YamlMap(const YamlNode& node) : node_(node) {
  if (!node.IsMap()) node.Fail("keys with values are expected");
  std::set<std::string> seen;
  for (const auto& entry : node.node_) {
    const YamlNode key(entry.first, node.file_, node.name_);
    if (key.As<std::string>() == "<<") {
      key.Fail("merge keys ('<<') are not supported; write the keys out");
    }
    if (!seen.insert(key.As<std::string>()).second) {
      key.Fail("the key '" + key.As<std::string>() + "' stands there twice");
    }
  }
}

YamlNode YamlMap::Required(const std::string& key) {
  const std::optional<YamlNode> value = Optional(key);
  if (value) return *value;
  // An unknown key with a similar spelling is the better clue.
  for (const auto& entry : node_.node_) {
    const std::string there = entry.first.as<std::string>();
    if (!asked_.contains(there) && 3 * EditDistance(there, key) <= key.size()) {
      YamlNode(entry.first, node_.file_, node_.name_)
          .Fail("unknown key '" + there + "'; did you mean '" + key + "'?");
    }
  }
  node_.Fail("the key '" + key + "' is missing");
}

std::optional<YamlNode> YamlMap::Optional(const std::string& key) {
  asked_.insert(key);
  const YAML::Node value = std::as_const(node_.node_)[key];
  if (!value.IsDefined()) return std::nullopt;
  YamlNode node(value, node_.file_, node_.name_.empty() ? key : node_.name_ + "." + key);
  if (value.IsNull()) node.Fail("it has no value; write one, or leave the key out");
  return node;
}

std::vector<std::string> YamlMap::Keys() {
  std::vector<std::string> keys;
  for (const auto& entry : node_.node_) {
    keys.push_back(entry.first.as<std::string>());
    asked_.insert(keys.back());
  }
  return keys;
}

void YamlMap::Finish() const {
  for (const auto& entry : node_.node_) {
    const std::string key = entry.first.as<std::string>();
    if (asked_.contains(key)) continue;
    const std::vector<std::string> known(asked_.begin(), asked_.end());
    const std::string nearest = NearestWord(key, known);
    YamlNode(entry.first, node_.file_, node_.name_)
        .Fail("unknown key '" + key + "'; " +
              (nearest.empty() ? "known are " + ListOfWords(known)
                               : "did you mean '" + nearest + "'?"));
  }
}

std::string NearestWord(const std::string& word, const std::vector<std::string>& known) {
  std::string nearest;
  size_t least = std::max<size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : known) {
    const size_t distance = EditDistance(word, candidate);
    if (distance < least) {
      least = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

std::string YamlQuoted(const std::string& text) {
  YAML::Emitter quoted;
  quoted << YAML::DoubleQuoted << text;
  return quoted.c_str();
}

std::string ListOfWords(const std::vector<std::string>& words) {
  std::string list;
  for (size_t i = 0; i < words.size(); ++i) {
    if (i > 0) list += i + 1 == words.size() ? " and " : ", ";
    list += "'" + words[i] + "'";
  }
  return list;
}

}  // namespace silhouette
