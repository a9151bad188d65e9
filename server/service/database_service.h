// DatabaseService: what the served database is.
#pragma once

#include "server/service/serving.h"
#include "silhouette/v1/database_service.grpc.pb.h"

namespace silhouette {

class DatabaseService final : public v1::DatabaseService::CallbackService {
 public:
  explicit DatabaseService(Serving& serving) : serving_(serving) {}

  grpc::ServerUnaryReactor* GetDatabase(grpc::CallbackServerContext* context,
                                        const v1::GetDatabaseRequest* request,
                                        v1::GetDatabaseResponse* response) override;

 private:
  Serving& serving_;
};

}  // namespace silhouette
