// SPDX-License-Identifier: Apache-2.0
#include "silhouette/scene_watch.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "clients/cpp/connection.h"
#include "silhouette/client.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette::client {

namespace {

constexpr absl::Duration kSceneWatchVeryLong = absl::Hours(24 * 3650);
// Most messages that wait to be taken; the server keeps what follows, up to its own limit.
constexpr size_t kMostWaitingNews = 64;

}  // namespace

class SceneWatch::Impl {
 public:
  // Begins at once.
  Impl(std::shared_ptr<const Connection> connection, absl::Duration timeout, bool images)
      : connection_(std::move(connection)), timeout_(timeout) {
    request_.set_include_images(images);
    thread_ = std::jthread([this] {
      const absl::Status ended = Run();
      {
        const std::lock_guard lock(mutex_);
        ended_ = cancelled_ ? absl::CancelledError("the watch was cancelled") : ended;
      }
      changed_.notify_all();
    });
  }

  ~Impl() { Cancel(); }

  absl::StatusOr<v1::WatchScenesResponse> Next(absl::Duration timeout) {
    const absl::Duration bounded = std::clamp(timeout, absl::ZeroDuration(), kSceneWatchVeryLong);
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, absl::ToChronoNanoseconds(bounded),
                           [this] { return !news_.empty() || ended_; })) {
      return absl::DeadlineExceededError(
          absl::StrCat("nothing new came within ", SpokenTimeout(timeout)));
    }
    if (news_.empty()) return *ended_;
    v1::WatchScenesResponse next = std::move(news_.front());
    news_.pop_front();
    lock.unlock();
    changed_.notify_all();
    return next;
  }

  void Cancel() {
    {
      const std::lock_guard lock(mutex_);
      cancelled_ = true;
    }
    changed_.notify_all();
    cancellation_.Cancel();
  }

 private:
  // Runs the call to its end. Returns why it ended.
  absl::Status Run() {
    if (absl::Status usable = RequireCallable(timeout_); !usable.ok()) return usable;
    grpc::ClientContext context;
    const Cancellation::Call call(cancellation_, context);
    const auto reader = connection_->scenes().WatchScenes(&context, request_);
    const absl::Status ended = connection_->ReadAll<v1::WatchScenesResponse>(
        *reader, context, absl::InfiniteDuration(), [&](const v1::WatchScenesResponse& news) {
          std::unique_lock lock(mutex_);
          changed_.wait(lock, [this] { return news_.size() < kMostWaitingNews || cancelled_; });
          news_.push_back(news);
          lock.unlock();
          changed_.notify_all();
          return absl::OkStatus();
        });
    if (!ended.ok()) return ended;
    return absl::UnavailableError(
        absl::StrCat("the server at ", connection_->address(), " ended the watch"));
  }

  const std::shared_ptr<const Connection> connection_;
  const absl::Duration timeout_;
  v1::WatchScenesRequest request_;
  Cancellation cancellation_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<v1::WatchScenesResponse> news_;
  bool cancelled_ = false;
  std::optional<absl::Status> ended_;  // never OK
  std::jthread thread_;                // last: it uses the others
};

SceneWatch::SceneWatch(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SceneWatch::~SceneWatch() = default;
SceneWatch::SceneWatch(SceneWatch&&) noexcept = default;
SceneWatch& SceneWatch::operator=(SceneWatch&&) noexcept = default;
absl::StatusOr<v1::WatchScenesResponse> SceneWatch::Next(absl::Duration timeout) {
  return impl_->Next(timeout);
}
void SceneWatch::Cancel() { impl_->Cancel(); }

SceneWatch Client::WatchScenes(bool images) const {
  return SceneWatch(std::make_unique<SceneWatch::Impl>(connection_, timeout_, images));
}

}  // namespace silhouette::client
