#include "server/service/scene_service.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/scene/make_scene.h"
#include "server/service/messages.h"

namespace silhouette {
namespace {

// "12 pixels in 'left', 9 in 'top'"
std::string PixelCounts(const AllowedRegion& region, const ServedDatabase& database) {
  std::string counts;
  for (size_t view = 0; view < region.pixels.size(); ++view) {
    if (!region.pixels[view]) continue;
    absl::StrAppend(&counts, counts.empty() ? "" : ", ", region.pixels[view]->Count(),
                    counts.empty() ? " pixels in '" : " in '",
                    database.view_name(static_cast<int>(view)), "'");
  }
  return counts;
}

}  // namespace

grpc::ServerUnaryReactor* SceneService::PublishScene(grpc::CallbackServerContext* context,
                                                     const v1::PublishSceneRequest* request,
                                                     v1::PublishSceneResponse* response) {
  const Moment arrived = serving_.settings.clock();
  if (serving_.settings.live != nullptr) {
    return AnswerHere(context, [] {
      return grpc::Status(grpc::StatusCode::FAILED_PRECONDITION,
                          "the server takes images of the cell itself (--live), and scenes of two "
                          "sources must not mix; start it without --live to publish scenes");
    });
  }
  return AnswerOnWorker(serving_, context, [this, request, response, arrived]() -> grpc::Status {
    const ServingSettings& settings = serving_.settings;
    const absl::StatusOr<SceneInput> input = SceneInputFrom(*request);
    if (!input.ok()) return ToGrpc(input.status());
    const std::shared_ptr<const ServedDatabase> database = serving_.scenes.database();
    absl::StatusOr<Scene> scene =
        MakeScene(*database, *input, settings.scene, settings.segmentation, arrived);
    if (!scene.ok()) return ToGrpc(scene.status());
    const absl::StatusOr<SharedScene> published =
        serving_.publisher.Publish(*std::move(scene), database);
    if (!published.ok()) return ToGrpc(published.status());
    ToMessage(**published, /*include_planes=*/false, settings.scene, settings.clock(),
              response->mutable_scene());
    return grpc::Status::OK;
  });
}

grpc::ServerUnaryReactor* SceneService::GetScene(grpc::CallbackServerContext* context,
                                                 const v1::GetSceneRequest* request,
                                                 v1::GetSceneResponse* response) {
  const auto work = [this, request, response]() -> grpc::Status {
    const SharedScene scene = serving_.scenes.Find(request->id());
    if (scene == nullptr) {
      return {grpc::StatusCode::NOT_FOUND,
              request->id() == 0
                  ? "there is no scene; publish one"
                  : absl::StrCat("there is no scene ", request->id(), ", or no longer")};
    }
    ToMessage(*scene, request->include_planes(), serving_.settings.scene, serving_.settings.clock(),
              response->mutable_scene());
    return grpc::Status::OK;
  };
  return request->include_planes() ? AnswerOnWorker(serving_, context, work)
                                   : AnswerHere(context, work);
}

grpc::ServerUnaryReactor* SceneService::GetAcquisition(grpc::CallbackServerContext* context,
                                                       const v1::GetAcquisitionRequest*,
                                                       v1::GetAcquisitionResponse* response) {
  return AnswerHere(context, [this, response]() -> grpc::Status {
    if (serving_.settings.live == nullptr) {
      return {grpc::StatusCode::FAILED_PRECONDITION,
              "the server does not take images of the cell itself; start it with --live"};
    }
    ToMessage(serving_.settings.live->Status(), response->mutable_acquisition());
    return grpc::Status::OK;
  });
}

grpc::ServerUnaryReactor* SceneService::AllowRegion(grpc::CallbackServerContext* context,
                                                    const v1::AllowRegionRequest* request,
                                                    v1::AllowRegionResponse* response) {
  const Moment now = serving_.settings.clock();
  return AnswerOnWorker(serving_, context, [=, this]() -> grpc::Status {
    const std::shared_ptr<const ServedDatabase> database = serving_.scenes.database();
    absl::StatusOr<std::vector<std::optional<Mask>>> pixels = RegionPixelsFrom(*request, *database);
    if (!pixels.ok()) return ToGrpc(pixels.status());
    const absl::StatusOr<AllowedRegion> region = serving_.scenes.Allow(
        request->name(), *std::move(pixels), DurationFrom(request->duration()), now, database);
    if (!region.ok()) return ToGrpc(region.status());
    spdlog::info("{} allows region '{}' for {}: {}", context->peer(), region->name,
                 absl::FormatDuration(region->end - now.running), PixelCounts(*region, *database));
    serving_.region_log.Watch();
    ToMessage(*region, *database, serving_.settings.clock(), response->mutable_region());
    return grpc::Status::OK;
  });
}

grpc::ServerUnaryReactor* SceneService::RevokeRegion(grpc::CallbackServerContext* context,
                                                     const v1::RevokeRegionRequest* request,
                                                     v1::RevokeRegionResponse* response) {
  return AnswerHere(context, [=, this] {
    const bool was_in_force = serving_.scenes.Revoke(request->name(), serving_.settings.clock());
    if (was_in_force) spdlog::info("{} revokes region '{}'", context->peer(), request->name());
    response->set_was_in_force(was_in_force);
    return grpc::Status::OK;
  });
}

grpc::ServerUnaryReactor* SceneService::ListAllowedRegions(
    grpc::CallbackServerContext* context, const v1::ListAllowedRegionsRequest*,
    v1::ListAllowedRegionsResponse* response) {
  return AnswerHere(context, [this, response] {
    const Moment now = serving_.settings.clock();
    const Served served = serving_.scenes.Newest(now);
    for (const AllowedRegion& region : served.regions->regions) {
      ToMessage(region, *served.database, now, response->add_regions());
    }
    return grpc::Status::OK;
  });
}

}  // namespace silhouette
