// SPDX-License-Identifier: Apache-2.0
// Progress of long work: on a terminal a bar with rate and time left that redraws itself, otherwise
// a plain line every few seconds. Writes to stderr, so that stdout stays free for results.
#pragma once

#include <cstdint>
#include <string>

#include "absl/time/time.h"

namespace silhouette {

class Progress {
 public:
  // `what` names the work, `total` its parts, `unit` what a part is called, e.g. "configurations".
  Progress(std::string what, uint64_t total, std::string unit);
  // Ends the line.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // `done` parts are done; cheap enough to call for each. `kept`: of these, what an earlier run
  // did: the time left does not rest on them.
  void Update(uint64_t done, uint64_t kept = 0);

  // One line of text above the bar.
  void Say(const std::string& line);

 private:
  std::string Line(absl::Duration now) const;
  void Draw(const std::string& line);

  const std::string what_;
  const uint64_t total_;
  const std::string unit_;
  const bool terminal_;
  const absl::Duration start_;
  absl::Duration next_;
  uint64_t done_ = 0;
  uint64_t kept_ = 0;
  bool drawn_ = false;
};

// What long work does now, where its share is not known: on a terminal a line that replaces itself
// and goes in the end, otherwise a plain line every few seconds. On stderr.
class Steps {
 public:
  // `what` names the work.
  explicit Steps(std::string what);
  ~Steps();
  Steps(const Steps&) = delete;
  Steps& operator=(const Steps&) = delete;

  void Begin(const std::string& step);

 private:
  const std::string what_;
  const bool terminal_;
  const absl::Duration start_;
  absl::Duration next_;
};

// A moment as people say it, in local time: "06:12", "Mon 06:12" if it is not today, with the date
// if it is more than six days away.
std::string ClockTime(absl::Time time, absl::Time now);

// "1 h 12 min", "3 min 20 s", "4.2 s": a duration as people say it.
std::string Spoken(absl::Duration duration);

}  // namespace silhouette
