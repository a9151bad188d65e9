#include "server/service/database_service.h"

#include "server/service/messages.h"

namespace silhouette {

grpc::ServerUnaryReactor* DatabaseService::GetDatabase(grpc::CallbackServerContext* context,
                                                       const v1::GetDatabaseRequest*,
                                                       v1::GetDatabaseResponse* response) {
  return AnswerHere(context, [this, response] {
    ToMessage(*serving_.scenes.Newest().database, serving_.settings.policy, response);
    return grpc::Status::OK;
  });
}

}  // namespace silhouette
