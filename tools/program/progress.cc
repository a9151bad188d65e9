// SPDX-License-Identifier: Apache-2.0
#include "tools/program/progress.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <utility>

#include "absl/strings/str_format.h"
#include "absl/time/clock.h"

namespace silhouette {
namespace {

constexpr absl::Duration kRedraw = absl::Milliseconds(100);
constexpr absl::Duration kPlainLine = absl::Seconds(5);
constexpr int kBarWidth = 24;
// Who waits so long looks at the clock.
constexpr absl::Duration kClockFrom = absl::Minutes(2);

// By a monotonic clock: setting the time of day does not change it.
absl::Duration Running() {
  return absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
}

}  // namespace

Progress::Progress(std::string what, uint64_t total, std::string unit)
    : what_(std::move(what)),
      total_(total),
      unit_(std::move(unit)),
      terminal_(isatty(STDERR_FILENO) == 1),
      start_(Running()),
      next_(start_ + (terminal_ ? kRedraw : kPlainLine)) {}

Progress::~Progress() {
  Draw(Line(Running()));
  if (terminal_) std::cerr << std::endl;
}

void Progress::Update(uint64_t done, uint64_t kept) {
  done_ = done;
  kept_ = kept;
  const absl::Duration now = Running();
  if (now < next_) return;
  next_ = now + (terminal_ ? kRedraw : kPlainLine);
  Draw(Line(now));
}

void Progress::Say(const std::string& line) {
  if (terminal_ && drawn_) std::cerr << "\r\033[K";
  std::cerr << line << std::endl;
}

std::string Progress::Line(absl::Duration now) const {
  const double share = total_ == 0 ? 1 : static_cast<double>(done_) / static_cast<double>(total_);
  const absl::Duration spent = now - start_;
  std::string line = absl::StrFormat("%s ", what_);
  if (terminal_) {
    const int filled = static_cast<int>(std::lround(std::min(share, 1.0) * kBarWidth));
    line += "[" + std::string(static_cast<size_t>(filled), '#') +
            std::string(static_cast<size_t>(kBarWidth - filled), '.') + "] ";
  }
  line += absl::StrFormat("%d of %d %s (%.0f %%)", done_, total_, unit_, 100 * share);
  if (done_ > kept_ && done_ < total_) {
    const absl::Duration left =
        spent * (static_cast<double>(total_ - done_) / static_cast<double>(done_ - kept_));
    line += ", " + Spoken(left) + " left";
    const absl::Time clock = absl::Now();
    if (left >= kClockFrom) line += ", done about " + ClockTime(clock + left, clock);
  } else {
    line += ", " + Spoken(spent);
  }
  return line;
}

void Progress::Draw(const std::string& line) {
  if (terminal_) {
    std::cerr << "\r\033[K" << line << std::flush;
  } else {
    std::cerr << line << std::endl;
  }
  drawn_ = true;
}

Steps::Steps(std::string what)
    : what_(std::move(what)),
      terminal_(isatty(STDERR_FILENO) == 1),
      start_(Running()),
      next_(terminal_ ? start_ : start_ + kPlainLine) {}

Steps::~Steps() {
  if (terminal_) std::cerr << "\r\033[K" << std::flush;
}

void Steps::Begin(const std::string& step) {
  const absl::Duration now = Running();
  if (now < next_) return;
  if (!terminal_) next_ = now + kPlainLine;
  const std::string line = absl::StrFormat("%s: %s, %s", what_, step, Spoken(now - start_));
  if (terminal_) {
    std::cerr << "\r\033[K" << line << std::flush;
  } else {
    std::cerr << line << std::endl;
  }
}

std::string ClockTime(absl::Time time, absl::Time now) {
  const absl::TimeZone here = absl::LocalTimeZone();
  const char* format = "%a %H:%M";
  if (absl::ToCivilDay(time, here) == absl::ToCivilDay(now, here)) format = "%H:%M";
  if (time - now > absl::Hours(6 * 24)) format = "%Y-%m-%d %H:%M";
  return absl::FormatTime(format, time, here);
}

std::string Spoken(absl::Duration duration) {
  const double seconds = absl::ToDoubleSeconds(duration);
  if (seconds < 10) return absl::StrFormat("%.1f s", seconds);
  const int64_t whole = std::llround(seconds);
  if (whole < 60) return absl::StrFormat("%d s", whole);
  if (whole < 3600) return absl::StrFormat("%d min %d s", whole / 60, whole % 60);
  return absl::StrFormat("%d h %d min", whole / 3600, whole % 3600 / 60);
}

}  // namespace silhouette
