// SPDX-License-Identifier: Apache-2.0
#include "silhouette/path_watch.h"

#include <algorithm>
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

constexpr absl::Duration kPathWatchVeryLong = absl::Hours(24 * 3650);

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
    const absl::Duration bounded = std::clamp(timeout, absl::ZeroDuration(), kPathWatchVeryLong);
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, absl::ToChronoNanoseconds(bounded),
                           [this] { return newest_ || ended_; })) {
      return absl::DeadlineExceededError(
          absl::StrCat("no new verdict on the path came within ", SpokenTimeout(timeout)));
    }
    // An update from before the end is outdated.
    if (ended_) return *ended_;
    returned_scene_ = newest_->check.basis.scene_id;
    return *std::exchange(newest_, std::nullopt);
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
        *reader, context, timeout_, [&](const auto& response) { return Take(response, clock); });
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
        const bool skipped = scene != returned_scene_ && scene != update.check.basis.scene_id;
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
  std::optional<PathUpdate> newest_;  // that was not returned yet
  uint64_t returned_scene_ = 0;
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
    const std::optional<SeparationPolicy>& separation) const {
  if (waypoints.empty()) return absl::InvalidArgumentError("a path has at least one waypoint");
  v1::CheckPathRequest request = QuestionOf(waypoints, policy, clearance, separation);
  request.set_variant(variant_);
  return PathWatch(
      std::make_unique<PathWatch::Impl>(connection_, timeout_, std::move(request), clearance));
}

}  // namespace silhouette::client
