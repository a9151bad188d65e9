#include "server/service/database_service.h"

#include "server/service/messages.h"

namespace silhouette {

grpc::ServerUnaryReactor* DatabaseService::GetDatabase(grpc::CallbackServerContext* context,
                                                       const v1::GetDatabaseRequest*,
                                                       v1::GetDatabaseResponse* response) {
  return AnswerHere(context, [this, response] {
    const std::shared_ptr<const ServedDatabase> database = serving_.scenes.database();
    ToMessage(*database, DefaultPolicy(serving_.settings, *database), response);
    return grpc::Status::OK;
  });
}

}  // namespace silhouette
