// SPDX-License-Identifier: Apache-2.0
#include "server/live/calibration_watch.h"

#include <spdlog/spdlog.h>

#include <condition_variable>
#include <mutex>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/files/calibration_check_file.h"
#include "common/picture/files.h"

namespace silhouette {
namespace {

constexpr std::chrono::milliseconds kPeriod{500};
// A check may be stamped this much ahead of the server's clock.
constexpr absl::Duration kTolerance = absl::Seconds(60);
// A check that ends earlier by less than this is not reported again.
constexpr absl::Duration kSameEnd = absl::Seconds(1);

CalibrationTrust Doubt(std::string message) {
  CalibrationTrust doubt;
  doubt.message = std::move(message);
  return doubt;
}

CalibrationTrust TrustFrom(const absl::StatusOr<std::string>& text,
                           const CalibrationWatchSettings& settings, const Moment& now) {
  if (!text.ok()) return Doubt(std::string(text.status().message()));
  const absl::StatusOr<CalibrationCheck> check = CheckFromText(*text, settings.file);
  if (!check.ok()) return Doubt(std::string(check.status().message()));
  const std::string when = absl::FormatTime(absl::RFC3339_sec, check->time, absl::UTCTimeZone());
  const absl::Duration age = now.time - check->time;
  if (age < -kTolerance) {
    return Doubt(
        absl::StrCat("the check is from the future, ", when, "; set the clocks of both machines"));
  }
  CalibrationTrust trust;
  trust.holds = check->Holds();
  trust.fingerprint = check->calibration;
  for (const CheckedView& view : check->views) trust.views.push_back(view.name);
  trust.limit = check->limit_mask_px;
  trust.message = absl::StrCat(check->Summary(), ", as checked at ", when);
  if (settings.max_age != absl::InfiniteDuration()) {
    trust.max_age = settings.max_age;
    trust.until = now.running + settings.max_age - std::max(age, absl::ZeroDuration());
  }
  return trust;
}

}  // namespace

CalibrationTrust ReadTrust(const CalibrationWatchSettings& settings, const Moment& now) {
  return TrustFrom(ReadWholeFile(settings.file), settings, now);
}

CalibrationWatch::CalibrationWatch(CalibrationWatchSettings settings, Clock clock, Tell tell)
    : settings_(std::move(settings)), clock_(std::move(clock)), tell_(std::move(tell)) {
  Look();
  thread_ = std::jthread([this](const std::stop_token& stop) {
    std::mutex mutex;
    std::condition_variable_any never;
    std::unique_lock lock(mutex);
    while (!never.wait_for(lock, stop, kPeriod, [&] { return stop.stop_requested(); })) Look();
  });
}

void CalibrationWatch::Look() {
  const absl::StatusOr<std::string> text = ReadWholeFile(settings_.file);
  auto trust = std::make_shared<const CalibrationTrust>(TrustFrom(text, settings_, clock_()));
  std::string said = absl::StrCat(trust->message, "\n", text.value_or(""));
  if (said == told_ && trust->until >= told_until_ - kSameEnd) return;
  told_ = std::move(said);
  told_until_ = trust->until;
  if (trust->holds) {
    spdlog::info("calibration: {}", trust->message);
  } else {
    spdlog::warn("presets that rest on the calibration are unknown: {}", trust->message);
  }
  tell_(std::move(trust));
}

}  // namespace silhouette
