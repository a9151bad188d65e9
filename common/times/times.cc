// SPDX-License-Identifier: Apache-2.0
#include "common/times/times.h"

#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "absl/strings/ascii.h"
#include "absl/strings/charconv.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

namespace silhouette {
namespace {

// Seconds of the unit that the text begins with, which it then loses; 0 if it begins with none.
double ConsumeUnit(absl::string_view& text) {
  if (absl::ConsumePrefix(&text, "ms")) return 1e-3;
  if (absl::ConsumePrefix(&text, "min")) return 60;
  if (absl::ConsumePrefix(&text, "s")) return 1;
  if (absl::ConsumePrefix(&text, "h")) return 3600;
  return 0;
}

// A number from 0, which the text then loses.
std::optional<double> ConsumeNumber(absl::string_view& text) {
  if (text.find_first_of("xX") != text.npos) return std::nullopt;  // from_chars takes 0x10, too
  double number = 0;
  const auto [end, error] = absl::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || !std::isfinite(number) || std::signbit(number)) return std::nullopt;
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return number;
}

// "6 min 32 s": `large` and `small` in their units, without a small part of 0.
std::string TwoParts(int64_t large, const char* large_unit, int64_t small, const char* small_unit) {
  const std::string first = absl::StrCat(large, " ", large_unit);
  return small == 0 ? first : absl::StrCat(first, " ", small, " ", small_unit);
}

}  // namespace

std::optional<absl::Duration> ParseTime(std::string_view text) {
  absl::string_view rest = absl::StripAsciiWhitespace(absl::string_view(text.data(), text.size()));
  bool is_first = true;
  double seconds = 0;
  do {
    const std::optional<double> number = ConsumeNumber(rest);
    if (!number) return std::nullopt;
    rest = absl::StripLeadingAsciiWhitespace(rest);
    const bool is_bare = is_first && rest.empty();
    const double unit = is_bare ? 1 : ConsumeUnit(rest);
    if (unit == 0) return std::nullopt;
    rest = absl::StripLeadingAsciiWhitespace(rest);
    seconds += *number * unit;
    is_first = false;
  } while (!rest.empty());
  const absl::Duration time = absl::Seconds(seconds);
  if (time == absl::InfiniteDuration()) return std::nullopt;
  return time;
}

std::string SpokenTime(absl::Duration time) {
  if (time < absl::ZeroDuration()) return absl::StrCat("-", SpokenTime(-time));
  if (time == absl::InfiniteDuration()) return "infinitely long";
  const double seconds = absl::ToDoubleSeconds(time);
  if (seconds == 0) return "0 s";
  if (seconds < 1) return absl::StrFormat("%.5g ms", seconds * 1e3);
  const int64_t whole = absl::ToInt64Seconds(time);
  if (whole < 60) return absl::StrFormat("%.5g s", seconds);
  if (whole < 3600) return TwoParts(whole / 60, "min", whole % 60, "s");
  return TwoParts(whole / 3600, "h", whole % 3600 / 60, "min");
}

std::string SpokenTimeAbove(absl::Duration limit, absl::Duration time) {
  const std::string text = SpokenTime(time);
  if (text != SpokenTime(limit)) return text;
  return time < absl::Minutes(1)
             ? absl::StrCat(absl::Ceil(time, absl::Milliseconds(1)) / absl::Milliseconds(1), " ms")
             : absl::StrCat(absl::Ceil(time, absl::Seconds(1)) / absl::Seconds(1), " s");
}

}  // namespace silhouette
