// SPDX-License-Identifier: Apache-2.0
#include "server/service/services.h"

#include <chrono>
#include <utility>

#include "server/service/answers.h"
#include "server/service/messages.h"
#include "server/service/space_writer.h"
#include "server/service/streams.h"

namespace silhouette {

grpc::ServerUnaryReactor* CollisionService::CheckConfigurations(
    grpc::CallbackServerContext* context, const v1::CheckConfigurationsRequest* request,
    v1::CheckConfigurationsResponse* response) {
  const auto work = [this, context, request, response] {
    return Answer(
        serving_, *request, [context] { return context->IsCancelled(); }, response);
  };
  return AnsweredAtOnce(serving_, *request) ? AnswerHere(context, work)
                                            : AnswerOnWorker(serving_, context, work);
}

grpc::ServerUnaryReactor* CollisionService::CheckPath(grpc::CallbackServerContext* context,
                                                      const v1::CheckPathRequest* request,
                                                      v1::CheckPathResponse* response) {
  return AnswerOnWorker(serving_, context,
                        [this, request, response] { return Answer(serving_, *request, response); });
}

grpc::ServerWriteReactor<v1::GetConfigurationSpaceResponse>*
CollisionService::GetConfigurationSpace(grpc::CallbackServerContext* context,
                                        const v1::GetConfigurationSpaceRequest* request) {
  auto* writer = new SpaceWriter();
  const auto work = [this, context, request, writer]() -> grpc::Status {
    const absl::StatusOr<Deadline> deadline = DeadlineOf(*request);
    if (!deadline.ok()) return ToGrpc(deadline.status());
    const absl::StatusOr<Served> found =
        WithVariant(serving_.scenes.Newest(serving_.settings.clock()), request->variant());
    if (!found.ok()) return ToGrpc(found.status());
    const Served& served = *found;
    const absl::StatusOr<Policy> policy = PolicyFor(serving_, request->policy(), *served.database);
    if (!policy.ok()) return ToGrpc(policy.status());
    absl::StatusOr<std::vector<uint64_t>> tiles =
        TilesFrom(request->tiles(), served.database->grid());
    if (!tiles.ok()) return ToGrpc(tiles.status());
    const absl::StatusOr<std::vector<double>> levels = ClearanceLevelsFrom(*request);
    if (!levels.ok()) return ToGrpc(levels.status());
    std::shared_ptr<const ConfigurationSpace> space;
    std::shared_ptr<const ClearanceSpace> clearances;
    v1::GetConfigurationSpaceResponse first;
    const bool cells = TellsCells(request->include_cells(), *policy);
    if (served.scene != nullptr) {
      space = serving_.spaces.Get(served, *policy);
      if (!levels->empty()) clearances = serving_.clearances.Get(served, *policy, space, *levels);
      const auto ready = [&](uint64_t tile) {
        return space->ready(tile) && (clearances == nullptr || clearances->ready(tile)) &&
               (!cells || space->cells_ready(tile));
      };
      const auto stop = [&] {
        return context->IsCancelled() || std::chrono::steady_clock::now() >= *deadline;
      };
      for (const uint64_t tile : *tiles) {
        if (stop()) break;
        space->tile(tile);
        if (clearances != nullptr) clearances->tile(tile);
      }
      if (cells) space->WorkOutCells(*tiles, stop);
      if (context->IsCancelled()) return grpc::Status::CANCELLED;
      first.set_tiles_left_out(std::erase_if(*tiles, [&](uint64_t tile) { return !ready(tile); }));
    }
    const Reason blocked = Conclude(serving_, served, *policy, first.mutable_basis());
    ToMessage(served.database->grid(), first.mutable_grid());
    first.set_unknown_reason(ToMessage(blocked));
    first.set_cells_exact(cells && space != nullptr && space->cells_exact());
    if (blocked != Reason::kNone) tiles->clear();
    writer->Send(std::move(first), std::move(space), std::move(clearances), cells,
                 *std::move(tiles));
    return grpc::Status::OK;
  };
  const bool accepted = serving_.workers.Run([context, writer, work] {
    const grpc::Status status = context->IsCancelled() ? grpc::Status::CANCELLED : Guarded(work);
    if (!status.ok()) writer->Finish(status);
  });
  if (!accepted) writer->Finish(TooBusy());
  return writer;
}

grpc::ServerWriteReactor<v1::WatchConfigurationSpaceResponse>*
CollisionService::WatchConfigurationSpace(grpc::CallbackServerContext* context,
                                          const v1::WatchConfigurationSpaceRequest* request) {
  const auto watch = std::make_shared<SpaceWatch>(serving_, context, *request);
  watch->Start();
  return watch.get();
}

grpc::ServerWriteReactor<v1::WatchPathResponse>* CollisionService::WatchPath(
    grpc::CallbackServerContext* context, const v1::CheckPathRequest* request) {
  const auto watch = std::make_shared<PathWatch>(serving_, context, *request);
  watch->Start();
  return watch.get();
}

grpc::ServerBidiReactor<v1::StreamChecksRequest, v1::StreamChecksResponse>*
CollisionService::StreamChecks(grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<CheckStream>(serving_, context);
  stream->Start();
  return stream.get();
}

grpc::ServerUnaryReactor* CollisionService::Explain(grpc::CallbackServerContext* context,
                                                    const v1::ExplainRequest* request,
                                                    v1::ExplainResponse* response) {
  return AnswerOnWorker(serving_, context,
                        [this, request, response] { return Answer(serving_, *request, response); });
}

}  // namespace silhouette
