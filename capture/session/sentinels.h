// SPDX-License-Identifier: Apache-2.0
// Sentinels: a few configurations that a session visits again and again. If one no longer looks as
// it did at first, a camera, the light or the robot has changed, and what was captured since the
// last time is suspect.
#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/session/capture_plan.h"
#include "capture/session/sentinel_sight.h"
#include "capture/session/visitor.h"

namespace silhouette {

// The first `count` of `chosen`, or these and, up to `count`, configurations `among`: each as far
// from the others as can be. Without `chosen` it begins with the first `among`. Fewer if there are
// fewer.
std::vector<ConfigurationNumber> WellSpread(const ConfigurationGrid& grid,
                                            const std::vector<ConfigurationNumber>& among,
                                            int count,
                                            std::vector<ConfigurationNumber> chosen = {});

class Sentinels {
 public:
  using Go = std::function<absl::StatusOr<Visit>(ConfigurationNumber)>;

  // Those that the database knows, up to as many as the settings say; more, or with
  // plan.new_sentinels others, out of what `plan` captures. If `plan` recaptures all that are known
  // and new ones are not asked for, they are compared as they were before. A suspect span that a
  // killed session left without an end ends now. `parts` must outlive it.
  static absl::StatusOr<Sentinels> Open(SessionParts& parts, const CapturePlan& plan);

  // In the order of visits.
  const std::vector<ConfigurationNumber>& numbers() const { return numbers_; }

  // Sentinels that `plan` captures, for the first time or again: before everything else.
  std::vector<ConfigurationNumber> ToCapture() const { return to_capture_; }

  // Tells of each configuration that was just captured.
  void Captured(absl::Time captured);
  // Then, of a sentinel out of ToCapture(): how it looks.
  void CapturedSentinel(ConfigurationNumber number, const Visit& visit,
                        const std::vector<Mask>& masks);

  // Keeps in the database which they are, once their robot images are there.
  absl::Status Remember();

  // A session that began at `begun` is about to write the first of the robot images that replace
  // all there are: these are suspect until then, and the sentinels are numbers().
  absl::Status ReplaceAll(absl::Time begun);

  // Whether there is something to compare with, and whether it is time.
  bool Known() const { return !firsts_.empty(); }
  bool Due(absl::Duration now) const;  // running clock

  // Visits all that are known, compares, and keeps in the database what came out. In plain words
  // what no longer matches, or that none could be visited; empty: all match. Errors: those of `go`
  // and of the database. If the robot gets to some, those it cannot get to are left out. Empty,
  // too, if it has a way to none of them, but others are ToCapture(): those of another part of the
  // grid.
  //
  // Unless all match, what was captured since the last check that found nothing is suspect: the
  // database keeps that together with the check. Where the clock leaves open what that is, more is
  // suspect rather than less: all, if the last check lies in the future, and images with a time
  // in the future.
  absl::StatusOr<std::string> Check(const Go& go);
  // Whether it could visit none the last time.
  bool none_visited() const { return none_visited_; }

  // Whether robot images are stored that were captured after the last check that found nothing, or
  // may have been: it lies in the future.
  absl::StatusOr<bool> Unchecked() const;

  // Somebody goes on although they do not match: what is captured until EndGoingOn() is suspect,
  // whatever later checks find, and also if the session is killed before.
  absl::Status GoOn();
  bool going_on() const { return going_on_; }
  absl::Status EndGoingOn();

  // The robot image that was captured then is suspect, also one that is yet to be written.
  absl::Status SuspectOne(absl::Time captured, const std::string& why);

  // What the last check saw, in a sentence.
  const std::string& summary() const { return summary_; }

 private:
  // How a sentinel looked at first.
  struct First {
    std::vector<SentinelImage> views;
    std::vector<double> measured;
    absl::Time captured;
  };

  explicit Sentinels(SessionParts& parts) : parts_(&parts) {}
  // What was captured up to `begin` matches.
  void NoteGood(absl::Time begin);
  // What was captured since the last check that found nothing; without an end while going on.
  absl::StatusOr<storage::v1::SuspectSpan> SpanSinceGood(const std::string& why) const;
  absl::Status Suspect(const std::string& why);
  // Keeps it in the database.
  absl::Status Keep(storage::v1::SentinelCheck check);
  // Of those that are `planned` only with `compare_planned`, and of none that `history` says is to
  // be replaced.
  absl::Status ReadFirsts(const Snapshot& snapshot, const storage::v1::CaptureHistory& history,
                          const std::set<ConfigurationNumber>& planned, bool compare_planned);
  std::vector<SentinelImage> Look(const Visit& visit) const;
  // The image with its mask as it is if shadows are foreground: whether a place is a shadow is a
  // close decision, and may be another in the next image.
  SentinelImage WithShadows(size_t view, SentinelImage image) const;
  // What is said against a view: at how many sentinels, and the first of it.
  struct Complaints {
    int count = 0;
    std::string first;
  };
  void Note(ConfigurationNumber number, First& first, const Visit& visit,
            storage::v1::SentinelCheck& check, std::vector<Complaints>& complaints);
  std::string Alarm(const std::vector<Complaints>& complaints, int visited) const;
  std::string Summarise(const storage::v1::SentinelCheck& check) const;

  SessionParts* parts_;
  std::vector<ConfigurationNumber> numbers_;
  std::vector<ConfigurationNumber> to_capture_;
  std::map<ConfigurationNumber, First> firsts_;
  absl::Duration last_check_ = -absl::InfiniteDuration();
  // No sentinel was known: what they look like when they are captured is the baseline.
  bool first_baseline_ = false;
  absl::Time last_good_ = absl::InfinitePast();
  bool none_visited_ = false;
  bool going_on_ = false;
  // The least capture time since, in this session.
  absl::Time earliest_since_ = absl::InfiniteFuture();
  // Something was captured at an earlier time than the last good check: a check is due at once, so
  // that the next session knows the time by the clock as it is now.
  bool set_back_ = false;
  std::string summary_;
};

}  // namespace silhouette
