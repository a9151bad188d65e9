#include "server/service/database_service.h"

#include "server/scene/checker.h"
#include "server/service/messages.h"

namespace silhouette {

grpc::ServerUnaryReactor* DatabaseService::GetDatabase(grpc::CallbackServerContext* context,
                                                       const v1::GetDatabaseRequest*,
                                                       v1::GetDatabaseResponse* response) {
  return AnswerHere(context, [this, response] {
    const std::shared_ptr<const ServedDatabase> database = serving_.scenes.database();
    ToMessage(*database, DefaultPolicy(serving_.settings, *database), response);
    if (const auto trust = serving_.scenes.trust()) {
      Served served;
      served.database = database;
      served.trust = trust;
      const bool holds = CalibrationReason(served, serving_.settings.clock()) == Reason::kNone;
      v1::CalibrationCheck& check = *response->mutable_calibration_check();
      check.set_holds(holds);
      check.set_message(trust->holds && !holds
                            ? "the check is too old, or of another calibration: " + trust->message
                            : trust->message);
    }
    return grpc::Status::OK;
  });
}

}  // namespace silhouette
