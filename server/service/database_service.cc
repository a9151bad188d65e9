#include "server/service/database_service.h"

#include "server/service/messages.h"

namespace silhouette {

grpc::ServerUnaryReactor* DatabaseService::GetDatabase(grpc::CallbackServerContext* context,
                                                       const v1::GetDatabaseRequest*,
                                                       v1::GetDatabaseResponse* response) {
  return AnswerHere(context, [this, response] {
    const Served served = serving_.scenes.Newest(serving_.settings.clock());
    ToMessage(*served.database, DefaultPolicy(serving_.settings, *served.database), response);
    return grpc::Status::OK;
  });
}

}  // namespace silhouette
