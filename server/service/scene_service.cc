// SPDX-License-Identifier: Apache-2.0
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "db/status/status_macros.h"
#include "server/gate/caller.h"
#include "server/scene/checker.h"
#include "server/scene/make_scene.h"
#include "server/service/calls.h"
#include "server/service/defects.h"
#include "server/service/messages.h"
#include "server/service/regions.h"
#include "server/service/serving.h"
#include "server/service/streams.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"

namespace silhouette {

namespace {

absl::Status CheckChange(const v1::ChangeVariantRequest& request,
                         const std::vector<std::string>& variants) {
  if (request.changing() != request.variant().empty()) {
    return absl::InvalidArgumentError(
        "send either the variant that the robot has, or that it is changing");
  }
  if (request.changing() || std::ranges::find(variants, request.variant()) != variants.end()) {
    return absl::OkStatus();
  }
  return FieldError("variant", absl::StrCat("the database has no variant '", request.variant(),
                                            "'; its variants are ", absl::StrJoin(variants, ", ")));
}

// Of scenes that are older than what is known now.
std::string WhyWithdrawn(const KnownVariant& known, const std::vector<std::string>& variants) {
  const absl::StatusOr<std::string> variant = known.OfLaterImages(variants);
  if (!variant.ok()) return std::string(variant.status().message());
  return absl::StrCat("the scene predates the switch to the variant '", *variant,
                      "'; wait for the next scene");
}

using v1::SceneService;
// Its methods take and return bytes (calls.h).
using SceneCalls = SceneService::WithRawCallbackMethod_PublishScene<
    SceneService::WithRawCallbackMethod_GetScene<SceneService::WithRawCallbackMethod_GetAcquisition<
        SceneService::WithRawCallbackMethod_ChangeVariant<
            SceneService::WithRawCallbackMethod_AllowRegion<
                SceneService::WithRawCallbackMethod_RevokeRegion<
                    SceneService::WithRawCallbackMethod_ListAllowedRegions<
                        SceneService::WithRawCallbackMethod_WatchScenes<
                            SceneService::Service>>>>>>>>;
using DatabaseCalls =
    v1::DatabaseService::WithRawCallbackMethod_GetDatabase<v1::DatabaseService::Service>;

// What the owner of the cameras calls.
class Scenes final : public SceneCalls {
 public:
  explicit Scenes(Serving& serving) : serving_(serving) {}

  grpc::ServerUnaryReactor* PublishScene(grpc::CallbackServerContext* context,
                                         const grpc::ByteBuffer* in,
                                         grpc::ByteBuffer* out) override {
    const Moment arrived = serving_.settings.clock();
    if (serving_.settings.live != nullptr) {
      return AnswerHere(serving_, context, [] {
        return absl::FailedPreconditionError(
            "the server takes images of the cell itself (--live), and scenes of two sources must "
            "not "
            "mix; start it without --live to publish scenes");
      });
    }
    return AnswerOn(
        serving_.scene_workers, serving_, context, *in,
        OnBytes<v1::PublishSceneRequest, v1::PublishSceneResponse>(
            in, out,
            [this, arrived, context](const v1::PublishSceneRequest& request,
                                     v1::PublishSceneResponse* response) -> absl::Status {
              const ServingSettings& settings = serving_.settings;
              ASSIGN_OR_RETURN(SceneInput input, SceneInputFrom(request, settings.scene, arrived));
              const std::shared_ptr<const ServedDatabase> database = serving_.scenes.database();
              serving_.repeated_images.TakeOut(*database, arrived, input);
              ASSIGN_OR_RETURN(Scene scene, MakeScene(*database, input, settings.scene,
                                                      settings.segmentation, arrived));
              ASSIGN_OR_RETURN(const SharedScene published,
                               serving_.publisher.Publish(std::move(scene), database));
              serving_.AuditFirst(CallerOf(*context), "scene.source", "publishes scenes");
              ToMessage(*published, /*include_planes=*/false,
                        DefectsOf(*published, settings, settings.clock()),
                        response->mutable_scene());
              return absl::OkStatus();
            }));
  }

  grpc::ServerUnaryReactor* GetScene(grpc::CallbackServerContext* context,
                                     const grpc::ByteBuffer* in, grpc::ByteBuffer* out) override {
    const auto work = OnBytes<v1::GetSceneRequest, v1::GetSceneResponse>(
        in, out,
        [this](const v1::GetSceneRequest& request, v1::GetSceneResponse* response) -> absl::Status {
          const SharedScene scene = serving_.scenes.Find(request.id());
          if (scene == nullptr) {
            if (request.id() != 0) {
              return absl::NotFoundError(
                  absl::StrCat("there is no scene ", request.id(), ", or no longer"));
            }
            return absl::NotFoundError(WhyNoScene(Reason::kNoScene, serving_.settings));
          }
          const ServingSettings& settings = serving_.settings;
          ToMessage(*scene, request.include_planes(), DefectsOf(*scene, settings, settings.clock()),
                    response->mutable_scene());
          return absl::OkStatus();
        });
    return AnswerOn(serving_.scene_workers, serving_, context, *in, work);
  }

  grpc::ServerWriteReactor<grpc::ByteBuffer>* WatchScenes(
      grpc::CallbackServerContext* context, const grpc::ByteBuffer* request) override {
    return StartWatch<SceneWatch, v1::WatchScenesRequest>(serving_, context, *request);
  }

  grpc::ServerUnaryReactor* GetAcquisition(grpc::CallbackServerContext* context,
                                           const grpc::ByteBuffer* in,
                                           grpc::ByteBuffer* out) override {
    return AnswerHere(
        serving_, context,
        OnBytes<v1::GetAcquisitionRequest, v1::GetAcquisitionResponse>(
            in, out,
            [this](const v1::GetAcquisitionRequest&,
                   v1::GetAcquisitionResponse* response) -> absl::Status {
              if (serving_.settings.live == nullptr) {
                return absl::FailedPreconditionError(
                    "the server does not take images of the cell itself; start it with --live");
              }
              ToMessage(serving_.settings.live->Status(), response->mutable_acquisition());
              ToMessage(serving_.settings.live->known_variant(),
                        serving_.scenes.database()->variants(),
                        response->mutable_acquisition()->mutable_robot_variant());
              return absl::OkStatus();
            }));
  }

  grpc::ServerUnaryReactor* ChangeVariant(grpc::CallbackServerContext* context,
                                          const grpc::ByteBuffer* in,
                                          grpc::ByteBuffer* out) override {
    const Moment arrived = serving_.settings.clock();
    return AnswerHere(
        serving_, context,
        OnBytes<v1::ChangeVariantRequest, v1::ChangeVariantResponse>(
            in, out,
            [=, this](const v1::ChangeVariantRequest& request,
                      v1::ChangeVariantResponse* response) -> absl::Status {
              const std::shared_ptr<LiveRecord>& live = serving_.settings.live;
              if (live == nullptr) {
                return absl::FailedPreconditionError(
                    "the server does not take images of the cell itself (--live); publish scenes "
                    "that name "
                    "their variant");
              }
              const std::vector<std::string> variants = serving_.scenes.database()->variants();
              RETURN_IF_ERROR(CheckChange(request, variants));
              const std::lock_guard lock(changing_variant_);
              const bool is_new = request.changing()
                                      ? live->TellVariantChanging()
                                      : live->TellVariant(request.variant(), arrived.running);
              const KnownVariant known = live->known_variant();
              if (is_new) {
                serving_.scenes.Withdraw(WhyWithdrawn(known, variants), serving_.settings.clock());
                spdlog::info("{} reports that the robot's variant {}", context->peer(),
                             request.changing() ? "is changing" : "is '" + request.variant() + "'");
                serving_.Audit(
                    CallerOf(*context), "variant.change",
                    request.changing() ? "is changing" : "is '" + request.variant() + "'");
              }
              ToMessage(known, variants, response->mutable_robot_variant());
              response->set_last_scene_before(serving_.scenes.last_withdrawn());
              return absl::OkStatus();
            }));
  }

  grpc::ServerUnaryReactor* AllowRegion(grpc::CallbackServerContext* context,
                                        const grpc::ByteBuffer* in,
                                        grpc::ByteBuffer* out) override {
    const Moment arrived = serving_.settings.clock();
    return AnswerOn(
        serving_.scene_workers, serving_, context, *in,
        OnBytes<v1::AllowRegionRequest, v1::AllowRegionResponse>(
            in, out,
            [=, this](const v1::AllowRegionRequest& request, v1::AllowRegionResponse* response) {
              return Answer(serving_, CallerOf(*context), request, arrived, response);
            }));
  }

  grpc::ServerUnaryReactor* RevokeRegion(grpc::CallbackServerContext* context,
                                         const grpc::ByteBuffer* in,
                                         grpc::ByteBuffer* out) override {
    return AnswerHere(
        serving_, context,
        OnBytes<v1::RevokeRegionRequest, v1::RevokeRegionResponse>(
            in, out,
            [=, this](const v1::RevokeRegionRequest& request, v1::RevokeRegionResponse* response) {
              return Answer(serving_, CallerOf(*context), request, response);
            }));
  }

  grpc::ServerUnaryReactor* ListAllowedRegions(grpc::CallbackServerContext* context,
                                               const grpc::ByteBuffer* in,
                                               grpc::ByteBuffer* out) override {
    return AnswerHere(
        serving_, context,
        OnBytes<v1::ListAllowedRegionsRequest, v1::ListAllowedRegionsResponse>(
            in, out,
            [this](const v1::ListAllowedRegionsRequest&, v1::ListAllowedRegionsResponse* response) {
              const Moment now = serving_.settings.clock();
              const Served served = serving_.scenes.Newest(now);
              for (const AllowedRegion& region : served.regions->regions) {
                ToMessage(region, *served.database, now, response->add_regions());
              }
              return absl::OkStatus();
            }));
  }

 private:
  Serving& serving_;
  // Held from when a change of the variant is recorded until older scenes are withdrawn.
  std::mutex changing_variant_;
};

// What the served database is.
class Databases final : public DatabaseCalls {
 public:
  explicit Databases(Serving& serving) : serving_(serving) {}

  grpc::ServerUnaryReactor* GetDatabase(grpc::CallbackServerContext* context,
                                        const grpc::ByteBuffer* in,
                                        grpc::ByteBuffer* out) override {
    return AnswerHere(
        serving_, context,
        OnBytes<v1::GetDatabaseRequest, v1::GetDatabaseResponse>(
            in, out, [this](const v1::GetDatabaseRequest&, v1::GetDatabaseResponse* response) {
              const std::shared_ptr<const ServedDatabase> database = serving_.scenes.database();
              ToMessage(*database, serving_.settings, response);
              Served served;
              served.database = database;
              served.trust = serving_.scenes.trust();
              if (served.trust != nullptr || !database->calibration_doubt().empty()) {
                const auto doubt = CalibrationDoubt(served, serving_.settings.clock());
                v1::CalibrationCheck& check = *response->mutable_calibration_check();
                check.set_holds(!doubt);
                check.set_message(doubt ? *doubt : served.trust->message);
              }
              return absl::OkStatus();
            }));
  }

 private:
  Serving& serving_;
};

}  // namespace

std::unique_ptr<grpc::Service> NewSceneService(Serving& serving) {
  return std::make_unique<Scenes>(serving);
}

std::unique_ptr<grpc::Service> NewDatabaseService(Serving& serving) {
  return std::make_unique<Databases>(serving);
}

}  // namespace silhouette
