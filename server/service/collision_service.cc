// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>

#include "db/status/status_macros.h"
#include "server/service/answers.h"
#include "server/service/calls.h"
#include "server/service/messages.h"
#include "server/service/space_writer.h"
#include "server/service/streams.h"
#include "silhouette/v1/collision_service.grpc.pb.h"

namespace silhouette {

namespace {

// Requests of more bytes are not answered at once: they have too many configurations.
constexpr size_t kMostBytesAtOnce = 16'384;

Stop CancelOf(const grpc::CallbackServerContext* context) {
  return [context] { return context->IsCancelled(); };
}

using v1::CollisionService;
// Its methods take and return bytes (calls.h).
using CollisionCalls = CollisionService::WithRawCallbackMethod_CheckConfigurations<
    CollisionService::WithRawCallbackMethod_CheckPath<
        CollisionService::WithRawCallbackMethod_GetConfigurationSpace<
            CollisionService::WithRawCallbackMethod_WatchConfigurationSpace<
                CollisionService::WithRawCallbackMethod_WatchPath<
                    CollisionService::WithRawCallbackMethod_StreamChecks<
                        CollisionService::WithRawCallbackMethod_Explain<
                            CollisionService::Service>>>>>>>;

// What planners ask. No reply says free unless a Checker of one database and one scene said so, and
// the scene was still good when the reply was ready.
class Collisions final : public CollisionCalls {
 public:
  explicit Collisions(Serving& serving) : serving_(serving) {}

  grpc::ServerUnaryReactor* CheckConfigurations(grpc::CallbackServerContext* context,
                                                const grpc::ByteBuffer* in,
                                                grpc::ByteBuffer* out) override {
    const bool small = in->Length() <= kMostBytesAtOnce;
    v1::CheckConfigurationsRequest typed;
    if (small && ReadRequest(*in, typed).ok() && AnsweredAtOnce(serving_, typed)) {
      return AnswerHere(serving_, context, [&]() -> absl::Status {
        v1::CheckConfigurationsResponse answer;
        RETURN_IF_ERROR(Answer(serving_, typed, CancelOf(context), &answer));
        WriteMessage(answer, out);
        return absl::OkStatus();
      });
    }
    return AnswerOn(serving_.workers, serving_, context, *in,
                    OnBytes<v1::CheckConfigurationsRequest, v1::CheckConfigurationsResponse>(
                        in, out, [this, context](const auto& request, auto* response) {
                          return Answer(serving_, request, CancelOf(context), response);
                        }));
  }

  grpc::ServerUnaryReactor* CheckPath(grpc::CallbackServerContext* context,
                                      const grpc::ByteBuffer* in, grpc::ByteBuffer* out) override {
    return AnswerOn(serving_.workers, serving_, context, *in,
                    OnBytes<v1::CheckPathRequest, v1::CheckPathResponse>(
                        in, out, [this, context](const auto& request, auto* response) {
                          return Answer(serving_, request, CancelOf(context), response);
                        }));
  }

  grpc::ServerWriteReactor<grpc::ByteBuffer>* GetConfigurationSpace(
      grpc::CallbackServerContext* context, const grpc::ByteBuffer* request) override {
    absl::StatusOr<Clients::Place> place = AdmitStream(serving_, *context);
    if (!place.ok()) {
      return new Refusal<grpc::ServerWriteReactor<grpc::ByteBuffer>>(place.status());
    }
    const std::string client = ClientOf(*context);
    const auto writer = SpaceWriter::Start(context, *std::move(place),
                                           serving_.settings.longest_write, serving_.watches);
    const bool accepted = serving_.workers.Run(client, request->Length(), [=, this] {
      const absl::Status status =
          context->IsCancelled() ? absl::CancelledError()
                                 : Guarded([&] { return SendSpace(context, *request, *writer); });
      if (!status.ok()) writer->Finish(ToGrpc(status));
    });
    if (!accepted) writer->Finish(ToGrpc(serving_.clients.TooBusy(client)));
    return writer.get();
  }

  grpc::ServerWriteReactor<grpc::ByteBuffer>* WatchConfigurationSpace(
      grpc::CallbackServerContext* context, const grpc::ByteBuffer* request) override {
    return StartWatch<SpaceWatch, v1::WatchConfigurationSpaceRequest>(serving_, context, *request);
  }

  grpc::ServerWriteReactor<grpc::ByteBuffer>* WatchPath(grpc::CallbackServerContext* context,
                                                        const grpc::ByteBuffer* request) override {
    return StartWatch<PathWatch, v1::CheckPathRequest>(serving_, context, *request);
  }

  grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* StreamChecks(
      grpc::CallbackServerContext* context) override {
    absl::StatusOr<Clients::Place> place = AdmitStream(serving_, *context);
    if (!place.ok()) {
      return new Refusal<grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>>(
          place.status());
    }
    const auto stream = std::make_shared<CheckStream>(serving_, context, *std::move(place));
    stream->Start();
    return stream.get();
  }

  grpc::ServerUnaryReactor* Explain(grpc::CallbackServerContext* context,
                                    const grpc::ByteBuffer* in, grpc::ByteBuffer* out) override {
    return AnswerOn(serving_.workers, serving_, context, *in,
                    OnBytes<v1::ExplainRequest, v1::ExplainResponse>(
                        in, out, [this](const auto& request, auto* response) {
                          return Answer(serving_, request, response);
                        }));
  }

 private:
  absl::Status SendSpace(const grpc::CallbackServerContext* context, const grpc::ByteBuffer& bytes,
                         SpaceWriter& writer) {
    v1::GetConfigurationSpaceRequest request;
    RETURN_IF_ERROR(ReadRequest(bytes, request));
    ASSIGN_OR_RETURN(const Deadline deadline, DeadlineOf(request));
    ASSIGN_OR_RETURN(
        const Served served,
        WithVariant(serving_.scenes.Newest(serving_.settings.clock()), request.variant()));
    ASSIGN_OR_RETURN(const Policy policy, PolicyFor(serving_, request.policy(), *served.database));
    ASSIGN_OR_RETURN(auto tiles, TilesFrom(request.tiles(), served.database->grid()));
    ASSIGN_OR_RETURN(const auto levels, ClearanceLevelsFrom(request));
    std::shared_ptr<const ConfigurationSpace> space;
    std::shared_ptr<const ClearanceSpace> clearances;
    v1::GetConfigurationSpaceResponse first;
    const bool cells = TellsCells(request.include_cells(), policy);
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
    ToMessage(served.database->grid(), serving_.settings, first.mutable_grid());
    first.set_unknown_reason(ToMessage(blocked));
    first.set_cells_exact(cells && space != nullptr && space->cells_exact());
    if (blocked != Reason::kNone) tiles.clear();
    writer.Send(std::move(first), std::move(space), std::move(clearances), cells, std::move(tiles));
    return absl::OkStatus();
  }

  Serving& serving_;
};

}  // namespace

std::unique_ptr<grpc::Service> NewCollisionService(Serving& serving) {
  return std::make_unique<Collisions>(serving);
}

}  // namespace silhouette
