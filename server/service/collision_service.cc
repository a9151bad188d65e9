// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <memory>
#include <utility>

#include "db/status/status_macros.h"
#include "server/service/answers.h"
#include "server/service/messages.h"
#include "server/service/space_writer.h"
#include "server/service/streams.h"
#include "silhouette/v1/collision_service.grpc.pb.h"

namespace silhouette {

namespace {

Stop CancelOf(const grpc::CallbackServerContext* context) {
  return [context] { return context->IsCancelled(); };
}

// What planners ask. No reply says free unless a Checker of one database and one scene said so, and
// the scene was still good when the reply was ready.
class CollisionService final : public v1::CollisionService::CallbackService {
 public:
  explicit CollisionService(Serving& serving) : serving_(serving) {}

  grpc::ServerUnaryReactor* CheckConfigurations(
      grpc::CallbackServerContext* context, const v1::CheckConfigurationsRequest* request,
      v1::CheckConfigurationsResponse* response) override {
    const auto work = [this, context, request, response] {
      return Answer(serving_, *request, CancelOf(context), response);
    };
    return AnsweredAtOnce(serving_, *request) ? AnswerHere(context, work)
                                              : AnswerOnWorker(serving_, context, work);
  }

  grpc::ServerUnaryReactor* CheckPath(grpc::CallbackServerContext* context,
                                      const v1::CheckPathRequest* request,
                                      v1::CheckPathResponse* response) override {
    return AnswerOnWorker(serving_, context, [this, context, request, response] {
      return Answer(serving_, *request, CancelOf(context), response);
    });
  }

  grpc::ServerWriteReactor<v1::GetConfigurationSpaceResponse>* GetConfigurationSpace(
      grpc::CallbackServerContext* context,
      const v1::GetConfigurationSpaceRequest* request) override {
    auto* writer = new SpaceWriter();
    const auto work = [this, context, request, writer]() -> absl::Status {
      ASSIGN_OR_RETURN(const Deadline deadline, DeadlineOf(*request));
      ASSIGN_OR_RETURN(
          const Served served,
          WithVariant(serving_.scenes.Newest(serving_.settings.clock()), request->variant()));
      ASSIGN_OR_RETURN(const Policy policy,
                       PolicyFor(serving_, request->policy(), *served.database));
      ASSIGN_OR_RETURN(auto tiles, TilesFrom(request->tiles(), served.database->grid()));
      ASSIGN_OR_RETURN(const auto levels, ClearanceLevelsFrom(*request));
      std::shared_ptr<const ConfigurationSpace> space;
      std::shared_ptr<const ClearanceSpace> clearances;
      v1::GetConfigurationSpaceResponse first;
      const bool cells = TellsCells(request->include_cells(), policy);
      if (served.scene != nullptr) {
        space = serving_.spaces.Get(served, policy);
        if (!levels.empty()) clearances = serving_.clearances.Get(served, policy, space, levels);
        const auto ready = [&](uint64_t tile) {
          return space->ready(tile) && (clearances == nullptr || clearances->ready(tile)) &&
                 (!cells || space->cells_ready(tile));
        };
        const auto stop = [&] {
          return context->IsCancelled() || std::chrono::steady_clock::now() >= deadline;
        };
        for (const uint64_t& tile : tiles) {
          if (!space->WorkOut({&tile, 1}, stop)) break;
          if (clearances != nullptr && !clearances->WorkOut({&tile, 1}, stop)) break;
        }
        if (cells) space->WorkOutCells(tiles, stop);
        if (context->IsCancelled()) return absl::CancelledError();
        first.set_tiles_left_out(std::erase_if(tiles, [&](uint64_t tile) { return !ready(tile); }));
      }
      const Reason blocked = Conclude(serving_, served, policy, first.mutable_basis());
      ToMessage(served.database->grid(), first.mutable_grid());
      first.set_unknown_reason(ToMessage(blocked));
      first.set_cells_exact(cells && space != nullptr && space->cells_exact());
      if (blocked != Reason::kNone) tiles.clear();
      writer->Send(std::move(first), std::move(space), std::move(clearances), cells,
                   std::move(tiles));
      return absl::OkStatus();
    };
    const bool accepted = serving_.workers.Run([context, writer, work] {
      const absl::Status status = context->IsCancelled() ? absl::CancelledError() : Guarded(work);
      if (!status.ok()) writer->Finish(ToGrpc(status));
    });
    if (!accepted) writer->Finish(ToGrpc(TooBusy()));
    return writer;
  }

  grpc::ServerWriteReactor<v1::WatchConfigurationSpaceResponse>* WatchConfigurationSpace(
      grpc::CallbackServerContext* context,
      const v1::WatchConfigurationSpaceRequest* request) override {
    const auto watch = std::make_shared<SpaceWatch>(serving_, context, *request);
    watch->Start();
    return watch.get();
  }

  grpc::ServerWriteReactor<v1::WatchPathResponse>* WatchPath(
      grpc::CallbackServerContext* context, const v1::CheckPathRequest* request) override {
    const auto watch = std::make_shared<PathWatch>(serving_, context, *request);
    watch->Start();
    return watch.get();
  }

  grpc::ServerBidiReactor<v1::StreamChecksRequest, v1::StreamChecksResponse>* StreamChecks(
      grpc::CallbackServerContext* context) override {
    const auto stream = std::make_shared<CheckStream>(serving_, context);
    stream->Start();
    return stream.get();
  }

  grpc::ServerUnaryReactor* Explain(grpc::CallbackServerContext* context,
                                    const v1::ExplainRequest* request,
                                    v1::ExplainResponse* response) override {
    return AnswerOnWorker(serving_, context, [this, request, response] {
      return Answer(serving_, *request, response);
    });
  }

 private:
  Serving& serving_;
};

}  // namespace

std::unique_ptr<grpc::Service> NewCollisionService(Serving& serving) {
  return std::make_unique<CollisionService>(serving);
}

}  // namespace silhouette
