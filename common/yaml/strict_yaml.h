// SPDX-License-Identifier: Apache-2.0
// Reading YAML files that people write. Each error names the file, the line and the nearest known
// key.
#pragma once

#include <yaml-cpp/yaml.h>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace silhouette {

// "cell.yaml:12: unknown key 'vews' in 'grid'; did you mean 'views'?"
class YamlError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// A place in a file. Copies share the file's tree.
class YamlNode {
 public:
  // `name` is what messages call the place, e.g. "views[2].mask_size".
  YamlNode(const YAML::Node& node, std::string file, std::string name);

  // Reads a file; throws YamlError if it cannot be read or is not YAML.
  static YamlNode FromFile(const std::string& path);
  // The same for a text; `file` is what messages call where it comes from.
  static YamlNode FromText(const std::string& text, const std::string& file);

  const std::string& name() const { return name_; }
  const std::string& file() const { return file_; }

  // Throws a YamlError with this place's file, line and name in front of `message`.
  [[noreturn]] void Fail(const std::string& message) const;

  bool IsMap() const { return node_.IsMap(); }
  bool IsSequence() const { return node_.IsSequence(); }
  bool IsScalar() const { return node_.IsScalar(); }

  // The scalar as T: bool, int, double, std::string. Throws YamlError, saying what was expected.
  template <typename T>
  T As() const;

  // An angle in radians, or "90 deg"; a number without a unit is radians.
  double AsAngle() const;

  // Metres, or "-5 mm".
  double AsPosition() const;
  // Either, where nothing says which it is.
  double AsAngleOrPosition() const;

  // A length in metres, or "5 mm"; not negative.
  double AsLength() const;
  // The same, at most `most` metres; `why` no more, for the message. More is likely to be in
  // millimetres or centimetres.
  double AsLengthUpTo(double most, const std::string& why) const;
  // The same, greater than 0.
  double AsPositiveLengthUpTo(double most, const std::string& why) const;

  // A time span as ParseTime takes it: "250 ms", "1 min 30 s"; a number without a unit is seconds.
  absl::Duration AsTime() const;
  double AsSeconds() const { return absl::ToDoubleSeconds(AsTime()); }
  // The same, greater than 0.
  absl::Duration AsPositiveTime() const;

  // A number greater than 0, not below 0, or from 0 to 1.
  double AsPositive() const;
  double AsNotNegative() const;
  double AsShare() const;

  // The place of the scalar among `words`, of which there are two or more.
  size_t AsWordOf(const std::vector<std::string>& words) const;

  // A number of bytes, not negative: "8 GB", "500 MB", "2 GiB"; a number without a unit is bytes.
  uint64_t AsBytes() const;

  // The items of a sequence; `count` items if given.
  std::vector<YamlNode> Items(std::optional<size_t> count = std::nullopt) const;

  // The items of a sequence as T.
  template <typename T>
  std::vector<T> Values(std::optional<size_t> count = std::nullopt) const {
    std::vector<T> values;
    for (const YamlNode& item : Items(count)) values.push_back(item.As<T>());
    return values;
  }

 private:
  friend class YamlMap;

  template <typename T>
  T Decoded(const std::string& expected) const;
  // A number with one of the units, whose factors these are, or without; at least `least`.
  double InUnit(const std::map<std::string, double>& units, double least,
                const std::string& expected) const;

  YAML::Node node_;
  std::string file_;
  std::string name_;
};

// The keys of a map. Ask for every key it may have, then call Finish().
class YamlMap {
 public:
  // Throws YamlError if the node is not a map or has a key twice.
  explicit YamlMap(const YamlNode& node);

  const YamlNode& node() const { return node_; }

  // The value of a key that must be there.
  YamlNode Required(const std::string& key);
  // The value of a key; nothing if it is not there. Fails where it was forgotten (null).
  std::optional<YamlNode> Optional(const std::string& key);

  template <typename T>
  T Get(const std::string& key) {
    return Required(key).As<T>();
  }
  template <typename T>
  T Get(const std::string& key, T default_value) {
    const std::optional<YamlNode> node = Optional(key);
    return node ? node->As<T>() : default_value;
  }

  // Sets `value` to what `read`, a function or a member of YamlNode, makes of the key's value;
  // leaves it if the key is not there.
  template <typename T, typename Reader>
  void Read(const std::string& key, T& value, const Reader& read) {
    if (const std::optional<YamlNode> node = Optional(key)) value = std::invoke(read, *node);
  }

  // All keys of a map whose keys are names of the user's, e.g. joints.
  std::vector<std::string> Keys();

  // Throws YamlError for an unknown key, with the nearest known one.
  void Finish() const;

 private:
  YamlNode node_;
  std::set<std::string> asked_;
};

// The word of `known` that `word` most likely stands for; empty if none is near.
std::string NearestWord(const std::string& word, const std::vector<std::string>& known);

// The text as a scalar in double quotes, for YAML files that are written by hand.
std::string YamlQuoted(const std::string& text);

// 'a', 'b' and 'c'.
std::string ListOfWords(const std::vector<std::string>& words);

}  // namespace silhouette
