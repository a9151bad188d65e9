// SPDX-License-Identifier: Apache-2.0
#include "silhouette/local_space.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "clients/cpp/check_answers.h"
#include "clients/cpp/connection.h"
#include "clients/cpp/motion_in_map.h"
#include "clients/cpp/published.h"
#include "clients/cpp/server_clock.h"
#include "clients/cpp/space_assembly.h"
#include "clients/cpp/space_snapshot.h"
#include "silhouette/messages.h"

namespace silhouette::client {
namespace {

using Content = SpaceSnapshot::Content;

// Between attempts to connect: at first, and at most.
constexpr absl::Duration kShortestPause = absl::Milliseconds(100);
constexpr absl::Duration kLongestPause = absl::Seconds(2);

// Of a call that did not succeed.
Reason ReasonOfEnd(const absl::Status& end) {
  switch (end.code()) {
    case absl::StatusCode::kFailedPrecondition:
      return Reason::kNotCheckedHere;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kOutOfRange:
    case absl::StatusCode::kPermissionDenied:
    case absl::StatusCode::kResourceExhausted:
    case absl::StatusCode::kUnauthenticated:
    case absl::StatusCode::kUnimplemented:
      return Reason::kRefused;
    default:
      return Reason::kConnectionLost;
  }
}

// Of an update that cannot be used: it is of another cell (RequireSameCell), or `otherwise`.
Reason ReasonOfUnusable(const absl::Status& status, Reason otherwise) {
  return absl::IsFailedPrecondition(status) ? Reason::kRefused : otherwise;
}

std::shared_ptr<const SpaceSnapshot> SnapshotOf(Content content) {
  return std::make_shared<const SpaceSnapshot>(std::make_unique<const Content>(std::move(content)));
}

}  // namespace

class LocalSpace::Impl {
 public:
  Impl(const Client& client, std::shared_ptr<const Connection> connection, absl::Duration timeout,
       std::string variant, LocalSpaceOptions options)
      : client_(client),
        connection_(std::move(connection)),
        timeout_(timeout),
        variant_(std::move(variant)),
        options_(std::move(options)),
        published_(SnapshotOf({})) {
    if (options_.max_age <= absl::ZeroDuration()) {
      throw std::invalid_argument("max_age of a local space must be positive");
    }
    thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
  }

  ~Impl() {
    thread_.request_stop();
    cancellation_.Cancel();
  }

  const Published<SpaceSnapshot>& published() const { return published_; }

  std::shared_ptr<const SpaceSnapshot> Wait(uint64_t after, absl::Duration timeout) const {
    std::unique_lock lock(mutex_);
    const absl::Duration bounded = std::clamp(timeout, absl::ZeroDuration(), absl::Hours(24));
    changed_.wait_for(lock, absl::ToChronoNanoseconds(bounded),
                      [&] { return newest_.number > after; });
    return published_.Get();
  }

  LocalSpaceStatus status() const {
    const std::lock_guard lock(mutex_);
    return status_;
  }

  MotionVerdict Ask(const std::vector<Configuration>& motion, double path_resolution) const {
    const auto path = client_.CheckPath(motion, options_.policy, Clearance::kOmit, path_resolution);
    if (!path.ok()) {
      const bool lost = ReasonOfEnd(path.status()) == Reason::kConnectionLost;
      return UnknownMotion(lost ? Reason::kConnectionLost : Reason::kRefused, motion.front());
    }
    // What is unknown keeps its reason.
    if (path->verdict.state != State::kUnknown &&
        RunningClock::now() >= ValidityOf(path->basis, options_.max_age).until) {
      return UnknownMotion(Reason::kUpdateTooOld, motion.front());
    }
    const bool placed = !path->configuration.empty();
    MotionVerdict verdict =
        UnknownMotion(path->verdict.reason, placed ? path->configuration : motion.front());
    verdict.state = path->verdict.state;
    verdict.checked = path->checked;
    verdict.proof = path->proof;
    verdict.sampled_step = path->sampled_step;
    verdict.fraction = path->verdict.free() ? 0 : std::min(path->segment + path->fraction, 1.0);
    verdict.last_free = path->verdict.free() ? 1 : 0;
    return verdict;
  }

 private:
  void Run(const std::stop_token& stop) {
    absl::Duration pause = kShortestPause;
    while (!stop.stop_requested()) {
      const uint64_t before = status().updates;
      Reason reason = Reason::kConnectionLost;
      const absl::Status ended = Subscribe(reason);
      if (stop.stop_requested()) return;
      Lose(ended, reason);
      pause = status().updates > before ? kShortestPause : std::min(2 * pause, kLongestPause);
      connection_->Pause(pause, stop);
    }
  }

  // Runs one stream to its end. Returns why it ended; `reason`: the same as a verdict's reason.
  absl::Status Subscribe(Reason& reason) {
    if (absl::Status usable = RequireCallable(timeout_); !usable.ok()) {
      reason = Reason::kRefused;
      return usable;
    }
    {
      const std::lock_guard lock(mutex_);
      ++status_.attempts;
    }
    v1::WatchConfigurationSpaceRequest request;
    *request.mutable_policy() = ToMessage(options_.policy);
    request.set_variant(variant_);
    request.mutable_tiles()->Add(options_.tiles.begin(), options_.tiles.end());
    request.set_obstacles(options_.obstacles);
    request.set_include_cells(options_.policy.off_grid != OffGrid::kNearest);
    grpc::ClientContext context;
    const Cancellation::Call call(cancellation_, context);
    const auto reader = connection_->collisions().WatchConfigurationSpace(&context, request);
    SpaceAssembly assembly;
    ServerClock clock(connection_, timeout_, cancellation_);
    std::optional<OffGridRule> rule;
    const absl::Status ended = connection_->ReadAll<v1::WatchConfigurationSpaceResponse>(
        *reader, context, absl::InfiniteDuration(),
        [&](const auto& part) { return Take(part, assembly, clock, rule, reason); });
    if (reason == Reason::kConnectionLost) reason = ReasonOfEnd(ended);
    if (!ended.ok()) return ended;
    return absl::UnavailableError("the server at " + connection_->address() +
                                  " ended the subscription");
  }

  // Publishes the update that `part` completes, if it does. Returns an error if the call must end.
  absl::Status Take(const v1::WatchConfigurationSpaceResponse& part, SpaceAssembly& assembly,
                    ServerClock& clock, std::optional<OffGridRule>& rule, Reason& reason) {
    const RunningClock::time_point received = RunningClock::now();
    absl::StatusOr<std::optional<SpaceUpdate>> update = assembly.Add(part);
    if (!update.ok()) {
      reason = Reason::kUpdateMalformed;
      return Malformed(connection_->address(), update.status().message());
    }
    if (!*update) return absl::OkStatus();
    const absl::Status usable = RequireBasis(variant_, (*update)->basis, *connection_);
    if (!usable.ok()) {
      reason = ReasonOfUnusable(usable, Reason::kUpdateMalformed);
      return usable;
    }
    const absl::StatusOr<RunningClock::time_point> made = clock.MadeAt((*update)->basis, received);
    if (!made.ok()) {
      reason = ReasonOfUnusable(made.status(), Reason::kAgeUnknown);
      return made.status();
    }
    if ((*update)->whole) rule.reset();
    // First, so that what is published is decided between grid points, too.
    if (!rule && (*update)->drawn == nullptr) {
      rule = AskForRule((*update)->basis.database_generation());
    }
    Take(**update, *made, rule);
    return absl::OkStatus();
  }

  void Take(const SpaceUpdate& update, RunningClock::time_point made,
            const std::optional<OffGridRule>& rule) {
    Publish([&](Content& content) {
      const uint64_t number = content.number + 1;
      content = {.basis = FromMessage(update.basis, made),
                 .map = update.map,
                 .drawn = update.drawn,
                 .unknown = update.unknown,
                 .validity = {},
                 .rule = rule,
                 .number = number,
                 .skipped_scenes = update.skipped_scenes,
                 .tiles_changed = update.tiles_changed};
      content.validity = ValidityOf(content.basis, options_.max_age);
      status_.connected = true;
      status_.problem = absl::OkStatus();
      ++status_.updates;
      status_.skipped_scenes += update.skipped_scenes;
    });
  }

  void Lose(const absl::Status& problem, Reason reason) {
    Publish([&](Content& content) {
      // A repeated failure is no news.
      if (status_.connected || content.unknown != reason) ++content.number;
      content.unknown = reason;
      status_.connected = false;
      status_.problem = problem;
    });
  }

  // `change(content)` makes the next snapshot from the newest.
  template <typename Change>
  void Publish(const Change& change) {
    {
      const std::lock_guard lock(mutex_);
      change(newest_);
      published_.Replace(SnapshotOf(newest_));
    }
    changed_.notify_all();
  }

  // The server's rule off the grid, with this generation of the database.
  std::optional<OffGridRule> AskForRule(uint64_t generation) {
    grpc::ClientContext context;
    const Cancellation::Call call(cancellation_, context);
    const auto response =
        connection_->Call(context, &v1::DatabaseService::Stub::GetDatabase,
                          v1::GetDatabaseRequest(), std::min(timeout_, absl::Seconds(1)));
    if (!response.ok() || response->generation() != generation ||
        !connection_->RequireSameCell(*response).ok()) {
      return std::nullopt;
    }
    if (response->images() == "drawn") return OffGridRule{.drawn = true};
    return OffGridRuleOf(Effective(options_.policy, FromMessage(response->default_policy())),
                         response->views_size());
  }

  const Client client_;
  const std::shared_ptr<const Connection> connection_;
  const absl::Duration timeout_;
  const std::string variant_;
  const LocalSpaceOptions options_;
  Cancellation cancellation_;
  mutable std::mutex mutex_;
  mutable std::condition_variable_any changed_;
  Content newest_;  // what is published
  LocalSpaceStatus status_;
  Published<SpaceSnapshot> published_;
  std::jthread thread_;  // last: it uses the others
};

LocalSpace::LocalSpace(const Client& client, LocalSpaceOptions options)
    : impl_(std::make_unique<Impl>(client, client.connection_, client.timeout_, client.variant_,
                                   std::move(options))) {}
LocalSpace::~LocalSpace() = default;

State LocalSpace::StateAt(ConfigurationNumber number) const {
  return impl_->published().With(
      [number](const SpaceSnapshot& snapshot) { return snapshot.StateAt(number); });
}

Verdict LocalSpace::Check(std::span<const double> q, Basis* basis) const {
  const std::shared_ptr<const SpaceSnapshot> snapshot = Snapshot();
  if (basis != nullptr) *basis = snapshot->basis();
  return snapshot->Check(q);
}

MotionVerdict LocalSpace::CheckMotionOrAsk(std::span<const double> from, std::span<const double> to,
                                           double path_resolution) const {
  const MotionVerdict here = CheckMotion(from, to, path_resolution);
  const bool undecided = here.reason == Reason::kBetweenGridPoints ||
                         here.reason == Reason::kNotInMap || here.reason == Reason::kNotCheckedHere;
  if (here.state != State::kUnknown || !undecided) return here;
  return impl_->Ask({{from.begin(), from.end()}, {to.begin(), to.end()}}, path_resolution);
}

std::shared_ptr<const SpaceSnapshot> LocalSpace::Snapshot() const {
  return impl_->published().Get();
}

std::shared_ptr<const SpaceSnapshot> LocalSpace::WaitForUpdate(uint64_t after,
                                                               absl::Duration timeout) const {
  return impl_->Wait(after, timeout);
}

LocalSpaceStatus LocalSpace::status() const { return impl_->status(); }

}  // namespace silhouette::client
