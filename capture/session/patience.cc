#include "capture/session/patience.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"

namespace silhouette {
namespace {

constexpr absl::Duration kBetween = absl::Seconds(3);
constexpr absl::Duration kMoment = absl::Milliseconds(50);

// Returns whether to go on waiting.
bool Wait(absl::Duration duration, const CaptureObserver& observer) {
  const absl::Time end = absl::Now() + duration;
  while (absl::Now() < end) {
    if (observer.stop_requested()) return false;
    absl::SleepFor(std::min(kMoment, end - absl::Now()));
  }
  return !observer.stop_requested();
}

}  // namespace

absl::Status WithPatience(absl::Duration retry, const std::function<absl::Status()>& work,
                          const std::function<void()>& lost, const CaptureObserver& observer,
                          CaptureReport& report) {
  absl::Status status = work();
  if (!absl::IsUnavailable(status) || retry <= absl::ZeroDuration()) return status;
  const absl::Time begin = absl::Now();
  ++report.losses;
  observer.say(absl::StrCat(status.message(), "; waiting up to ", absl::FormatDuration(retry),
                            " for it to come back"));
  while (absl::IsUnavailable(status) && absl::Now() - begin < retry) {
    lost();
    if (!Wait(std::min(kBetween, retry / 10), observer)) break;
    status = work();
  }
  const absl::Duration waited = absl::Now() - begin;
  report.waited += waited;
  const std::string spoken = absl::FormatDuration(absl::Trunc(waited, absl::Milliseconds(100)));
  if (absl::IsUnavailable(status)) {
    return absl::UnavailableError(
        absl::StrCat(status.message(), "; it did not come back within ", spoken));
  }
  if (status.ok()) observer.say(absl::StrCat("it is back, after ", spoken));
  return status;
}

}  // namespace silhouette
