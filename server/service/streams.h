// SPDX-License-Identifier: Apache-2.0
// Calls that are answered again whenever what answers rest on has changed.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "db/status/status_macros.h"
#include "server/scene/configuration_space.h"
#include "server/service/calls.h"
#include "server/service/messages.h"
#include "server/service/serving.h"
#include "server/service/watch_hub.h"
#include "silhouette/v1/collision_service.pb.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {

// How many scenes were published between two reported ones, by their ids; 0: none was.
inline uint64_t ScenesSkipped(uint64_t last, uint64_t now) {
  return last != 0 && now > last ? now - last - 1 : 0;
}

// Works on one update at a time, by a worker thread, and begins the next one only when all of it
// has been taken by the transport: a slow caller does not delay others, and has at most one
// update waiting. The next one is of the newest scene then.
//
// Who does not take a part for ServingSettings::longest_write is cut off.
//
// Keeps itself alive until the call is over.
template <typename Response>
class WatchWriter : public grpc::ServerWriteReactor<grpc::ByteBuffer>,
                    public Watcher,
                    public std::enable_shared_from_this<WatchWriter<Response>> {
 public:
  // `place`: among the streams of its client, kept until the call is over.
  WatchWriter(Serving& serving, grpc::CallbackServerContext* context, Clients::Place place)
      : serving_(serving),
        context_(context),
        client_(ClientOf(*context)),
        place_(std::move(place)) {}

  // Once, when the call comes.
  void Start() {
    self_ = this->shared_from_this();
    serving_.watches.Add(self_);
    Tell(0);  // the hub's first word is 1
  }

  void Tell(uint64_t version) final {
    std::unique_lock lock(mutex_);
    told_ = std::max(told_, version + Beside());
    if (step_ == Step::kWriting && Clock::now() > write_end_) context_->TryCancel();
    GoOn(lock);
  }

  void End() final {
    Stop(absl::UnavailableError("the server stops; watch again when it is back"));
  }

 protected:
  // Prepares an update of what is served now. False: there is nothing to tell. An error ends the
  // call.
  virtual absl::StatusOr<bool> Prepare() = 0;

  // Counts, and never goes back: changes that this watcher waits for beside those of the hub.
  virtual uint64_t Beside() const { return 0; }

  // The next part of the update, in `message`, which is clear. False: it was the last one.
  virtual bool NextPart(Response& message) = 0;

  Serving& serving() const { return serving_; }
  // Whether the update that is worked on is of no use any more: the caller is gone, or the server
  // stops.
  bool cancelled() {
    if (context_->IsCancelled()) return true;
    const std::lock_guard lock(mutex_);
    return ending_.has_value();
  }

 private:
  using Clock = std::chrono::steady_clock;
  enum class Step { kWaiting, kWorking, kWriting, kOver };

  // What the call is to end with; it goes on until it waits.
  void Stop(const absl::Status& status) {
    std::unique_lock lock(mutex_);
    if (!ending_) ending_ = status;
    GoOn(lock);
  }

  // From kWaiting to whatever is next.
  void GoOn(std::unique_lock<std::mutex>& lock) {
    if (step_ != Step::kWaiting) return;
    if (ending_) {
      step_ = Step::kOver;
      lock.unlock();
      this->Finish(ToGrpc(*ending_));
    } else if (told_ != done_) {
      // If too much waits already, the hub's next word comes soon.
      const bool accepted = serving_.watch_workers.Run(
          client_, 0, [self = this->shared_from_this()] { self->Work(); });
      if (accepted) step_ = Step::kWorking;
    }
  }

  void Work() {
    {
      const std::lock_guard lock(mutex_);
      done_ = told_;
    }
    bool something = false;
    const absl::Status status = Guarded([&]() -> absl::Status {
      if (cancelled()) return absl::CancelledError();
      ASSIGN_OR_RETURN(something, Prepare());
      return absl::OkStatus();
    });
    std::unique_lock lock(mutex_);
    if (!status.ok() && !ending_) ending_ = status;
    step_ = Step::kWaiting;
    if (!something || ending_) return GoOn(lock);
    step_ = Step::kWriting;
    Write(lock);
  }

  void Write(std::unique_lock<std::mutex>& lock) {
    write_end_ = Clock::now() + absl::ToChronoNanoseconds(serving_.settings.longest_write);
    lock.unlock();
    message_.Clear();
    more_ = NextPart(message_);
    WriteMessage(message_, &bytes_);
    lock.lock();  // so that who goes on after the write sees all of this
    lock.unlock();
    this->StartWrite(&bytes_);
  }

  void OnWriteDone(bool ok) final {
    std::unique_lock lock(mutex_);
    if (!ok && !ending_) ending_ = absl::CancelledError();  // the caller is gone
    if (more_ && !ending_) return Write(lock);
    step_ = Step::kWaiting;
    GoOn(lock);
  }

  void OnCancel() final { Stop(absl::CancelledError()); }

  void OnDone() final {
    place_.reset();
    const std::shared_ptr<Watcher> last = std::move(self_);  // perhaps a worker still holds it
  }

  Serving& serving_;
  grpc::CallbackServerContext* const context_;
  const std::string client_;
  Clients::Place place_;
  std::shared_ptr<WatchWriter> self_;
  Response message_;
  grpc::ByteBuffer bytes_;  // of the message
  bool more_ = false;
  std::mutex mutex_;
  Step step_ = Step::kWaiting;
  Clock::time_point write_end_;
  uint64_t told_ = 0;
  std::optional<uint64_t> done_;
  std::optional<absl::Status> ending_;
};

// Begins a call that `Kind` answers, or refuses it.
template <typename Kind, typename Request>
grpc::ServerWriteReactor<grpc::ByteBuffer>* StartWatch(Serving& serving,
                                                       grpc::CallbackServerContext* context,
                                                       const grpc::ByteBuffer& request) {
  Request typed;
  absl::StatusOr<Clients::Place> place = AdmitStream(serving, *context);
  absl::Status status = place.status();
  if (status.ok()) status = ReadRequest(request, typed);
  if (!status.ok()) return new Refusal<grpc::ServerWriteReactor<grpc::ByteBuffer>>(status);
  const auto watch = std::make_shared<Kind>(serving, context, *std::move(place), typed);
  watch->Start();
  return watch.get();
}

// WatchPath: one call.
class PathWatch final : public WatchWriter<v1::WatchPathResponse> {
 public:
  PathWatch(Serving& serving, grpc::CallbackServerContext* context, Clients::Place place,
            const v1::CheckPathRequest& request)
      : WatchWriter(serving, context, std::move(place)),
        path_(serving.watched_paths.Add(ClientOf(*context), request)) {}

 private:
  absl::StatusOr<bool> Prepare() override;
  bool NextPart(v1::WatchPathResponse& part) override;

  const std::shared_ptr<WatchedPath> path_;
  WatchedState told_of_;
  uint64_t last_scene_ = 0;
  v1::WatchPathResponse update_;
};

// WatchScenes: one call.
class SceneWatch final : public WatchWriter<v1::WatchScenesResponse> {
 public:
  SceneWatch(Serving& serving, grpc::CallbackServerContext* context, Clients::Place place,
             const v1::WatchScenesRequest& request);

 private:
  absl::StatusOr<bool> Prepare() override;
  bool NextPart(v1::WatchScenesResponse& part) override;
  uint64_t Beside() const override;

  // Each adds to the update what is new of it.
  void AddState(const Moment& now);
  void AddScenes();
  void AddImages();
  void AddPaths();

  const bool include_images_;
  // What was sent.
  WatchedState told_of_;
  uint64_t last_scene_ = 0;
  uint64_t last_images_ = 0;
  std::chrono::steady_clock::time_point images_sent_;
  std::map<uint64_t, std::shared_ptr<const WatchedPath::Told>> told_paths_;  // by id
  // The update that is being sent: its parts, the next one last.
  std::vector<v1::WatchScenesResponse> parts_;
};

// WatchConfigurationSpace: one call.
class SpaceWatch final : public WatchWriter<v1::WatchConfigurationSpaceResponse> {
 public:
  // Tiles in one part: about half a megabyte, somewhat more with free cells.
  static constexpr size_t kTilesPerPart = 512;

  SpaceWatch(Serving& serving, grpc::CallbackServerContext* context, Clients::Place place,
             const v1::WatchConfigurationSpaceRequest& request)
      : WatchWriter(serving, context, std::move(place)), request_(request) {}

 private:
  absl::StatusOr<bool> Prepare() override;
  bool NextPart(v1::WatchConfigurationSpaceResponse& part) override;

  const v1::WatchConfigurationSpaceRequest request_;
  // What the last update spoke of, and its map or an earlier one: the tiles that the caller has.
  WatchedState told_of_;
  uint64_t last_scene_ = 0;
  std::shared_ptr<const ConfigurationSpace> sent_;
  bool cells_ = false;  // with free cells
  // The update that is being sent.
  v1::WatchConfigurationSpaceResponse first_;
  std::vector<uint64_t> changed_;
  size_t next_ = 0;
};

// StreamChecks: one call.
// A refused question gets its error under its id. One that is too large or cannot be parsed ends
// the call, as does one of more than kReadForItsId bytes that the client's limits refuse: its id is
// not known. Reads a question only when the answer to the one before has been
// taken by the transport: a caller that does not read its answers does not delay others, and is cut
// off after `longest_write` of the settings. Keeps itself alive until the call is over.
class CheckStream final : public grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>,
                          public Watcher,
                          public std::enable_shared_from_this<CheckStream> {
 public:
  // `place`: as in WatchWriter.
  CheckStream(Serving& serving, grpc::CallbackServerContext* context, Clients::Place place)
      : serving_(serving),
        context_(context),
        client_(ClientOf(*context)),
        place_(std::move(place)) {}

  // Once, when the call comes.
  void Start();

  void Tell(uint64_t) override;
  void End() override;

 private:
  static constexpr size_t kReadForItsId = size_t{64} << 10;
  // The step to kOver, from kReading or at the end of kAnswering, finishes the call.
  enum class Step { kReading, kAnswering, kOver };

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnDone() override;

  // The answer to the question that was read, into answer_.
  absl::Status AnswerQuestion();
  // Sends what `answer` leaves in answer_, or its error.
  void Work(const std::function<absl::Status()>& answer);

  Serving& serving_;
  grpc::CallbackServerContext* const context_;
  const std::string client_;
  Clients::Place place_;
  std::shared_ptr<CheckStream> self_;
  grpc::ByteBuffer bytes_;  // that are read or written
  v1::StreamChecksRequest question_;
  v1::StreamChecksResponse answer_;
  std::mutex mutex_;
  Step step_ = Step::kReading;
  std::optional<std::chrono::steady_clock::time_point> write_end_;  // of the answer under way
  std::optional<absl::Status> ending_;
};

}  // namespace silhouette
