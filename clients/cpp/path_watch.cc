// SPDX-License-Identifier: Apache-2.0
#include "silhouette/path_watch.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "clients/cpp/check_answers.h"
#include "clients/cpp/connection.h"
#include "clients/cpp/server_clock.h"
#include "clients/cpp/space_snapshot.h"
#include "silhouette/client.h"
#include "silhouette/messages.h"

namespace silhouette::client {

namespace {

// When the next thing of it expires that lets the robot move; max: it has none.
RunningClock::time_point ExpiryOf(const PathCheck& check) {
  RunningClock::time_point expiry = RunningClock::time_point::max();
  if (check.verdict.free()) expiry = check.basis.valid_until;
  if (check.separation && check.separation->lets_move()) {
    expiry = std::min(expiry, check.separation->valid_until);
  }
  return expiry;
}

// Makes unknown what lets the robot move and has expired. Returns whether there is such a thing.
bool Expire(PathCheck& check) {
  const RunningClock::time_point now = RunningClock::now();
  if (now < ExpiryOf(check)) return false;
  if (check.separation && check.separation->lets_move() && now >= check.separation->valid_until) {
    check.separation = Separation{.unknown_reason = Reason::kUpdateExpired};
  }
  if (check.verdict.free() && now >= check.basis.valid_until) {
    MakeUnknown(check, Reason::kUpdateExpired);
  }
  return true;
}

}  // namespace

class PathWatch::Impl {
 public:
  // Begins at once.
  Impl(std::shared_ptr<const Connection> connection, absl::Duration timeout,
       v1::CheckPathRequest request, Clearance clearance)
      : connection_(std::move(connection)),
        timeout_(timeout),
        request_(std::move(request)),
        clearance_(clearance) {
    thread_ = std::jthread([this] {
      const absl::Status ended = Run();
      {
        const std::lock_guard lock(mutex_);
        ended_ =
            cancellation_.cancelled() ? absl::CancelledError("the watch was cancelled") : ended;
      }
      changed_.notify_all();
    });
  }

  ~Impl() { Cancel(); }

  absl::StatusOr<PathUpdate> Next(absl::Duration timeout) {
    // The clock of one wait stands still while the computer sleeps.
    constexpr std::chrono::milliseconds kLongestWait(50);
    const RunningClock::time_point deadline = After(RunningClock::now(), timeout);
    std::unique_lock lock(mutex_);
    while (!newest_ && !ended_) {
      if (Expire(returned_.check)) {
        returned_.skipped_scenes = 0;
        returned_.repeated = true;
        return returned_;
      }
      const RunningClock::time_point now = RunningClock::now();
      if (now >= deadline) {
        return absl::DeadlineExceededError(
            absl::StrCat("no new verdict on the path came within ", SpokenTimeout(timeout)));
      }
      const auto wake = std::min({deadline, ExpiryOf(returned_.check), now + kLongestWait});
      changed_.wait_for(lock, wake - now);
    }
    // An update from before the end is outdated.
    if (ended_) return *ended_;
    returned_ = *std::exchange(newest_, std::nullopt);
    Expire(returned_.check);
    return returned_;
  }

  void Cancel() { cancellation_.Cancel(); }

 private:
  // Runs the call to its end. Returns why it ended.
  absl::Status Run() {
    if (absl::Status usable = RequireCallable(timeout_); !usable.ok()) return usable;
    grpc::ClientContext context;
    const Cancellation::Call call(cancellation_, context);
    const auto reader = connection_->collisions().WatchPath(&context, request_);
    ServerClock clock(connection_, timeout_, cancellation_);
    const absl::Status ended = connection_->ReadAll<v1::WatchPathResponse>(
        *reader, context, absl::InfiniteDuration(),
        [&](const auto& response) { return Take(response, clock); });
    if (!ended.ok()) return ended;
    return absl::UnavailableError(
        absl::StrCat("the server at ", connection_->address(), " ended the watch"));
  }

  // Stores an update. Returns an error if the call must end.
  absl::Status Take(const v1::WatchPathResponse& response, ServerClock& clock) {
    const RunningClock::time_point received = RunningClock::now();
    const v1::Basis& basis = response.check().basis();
    const absl::Status usable = RequireBasis(request_.variant(), basis, *connection_);
    if (!usable.ok()) return usable;
    const absl::StatusOr<RunningClock::time_point> made = clock.MadeAt(basis, received);
    if (!made.ok()) return made.status();
    if (request_.has_separation() && !response.check().has_separation()) {
      return NoSeparation(connection_->address());
    }
    absl::StatusOr<PathCheck> check =
        AnswerFrom(response.check(), clearance_, *made, connection_->address());
    if (!check.ok()) return check.status();
    PathUpdate update{.check = *std::move(check), .skipped_scenes = response.skipped_scenes()};
    {
      const std::lock_guard lock(mutex_);
      if (newest_) {
        // The stored one will not be returned.
        const uint64_t scene = newest_->check.basis.scene_id;
        const bool skipped =
            scene != returned_.check.basis.scene_id && scene != update.check.basis.scene_id;
        update.skipped_scenes += newest_->skipped_scenes + (skipped ? 1 : 0);
      }
      newest_ = std::move(update);
    }
    changed_.notify_all();
    return absl::OkStatus();
  }

  const std::shared_ptr<const Connection> connection_;
  const absl::Duration timeout_;
  const v1::CheckPathRequest request_;
  const Clearance clearance_;
  Cancellation cancellation_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<PathUpdate> newest_;   // that was not returned yet
  PathUpdate returned_;                // the last one
  std::optional<absl::Status> ended_;  // never OK
  std::jthread thread_;                // last: it uses the others
};

bool PathUpdate::FreeNow() const {
  return check.verdict.free() && RunningClock::now() < check.basis.valid_until;
}

PathWatch::PathWatch(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PathWatch::~PathWatch() = default;
PathWatch::PathWatch(PathWatch&&) noexcept = default;
PathWatch& PathWatch::operator=(PathWatch&&) noexcept = default;
absl::StatusOr<PathUpdate> PathWatch::Next(absl::Duration timeout) { return impl_->Next(timeout); }
void PathWatch::Cancel() { impl_->Cancel(); }

absl::StatusOr<PathWatch> Client::WatchPath(
    std::span<const Configuration> waypoints, const Policy& policy, Clearance clearance,
    std::optional<double> resolution, const std::optional<SeparationPolicy>& separation) const {
  if (waypoints.empty()) return absl::InvalidArgumentError("a path has at least one waypoint");
  v1::CheckPathRequest request = QuestionOf(waypoints, policy, clearance, resolution, separation);
  request.set_variant(variant_);
  return PathWatch(
      std::make_unique<PathWatch::Impl>(connection_, timeout_, std::move(request), clearance));
}

}  // namespace silhouette::client
