#include "server/service/serving.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

namespace silhouette {

grpc::Status Guarded(const std::function<grpc::Status()>& work) {
  try {
    return work();
  } catch (const std::exception& error) {
    spdlog::error("internal error: {}", error.what());
    return {grpc::StatusCode::INTERNAL, "internal error of the server; its log says more"};
  }
}

grpc::Status TooBusy() {
  return {grpc::StatusCode::RESOURCE_EXHAUSTED, "the server is busy; try again"};
}

grpc::ServerUnaryReactor* AnswerHere(grpc::CallbackServerContext* context,
                                     const std::function<grpc::Status()>& work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(Guarded(work));
  return reactor;
}

grpc::ServerUnaryReactor* AnswerOnWorker(Serving& serving, grpc::CallbackServerContext* context,
                                         std::function<grpc::Status()> work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const bool accepted = serving.workers.Run([=, work = std::move(work)] {
    reactor->Finish(context->IsCancelled() ? grpc::Status::CANCELLED : Guarded(work));
  });
  if (!accepted) reactor->Finish(TooBusy());
  return reactor;
}

}  // namespace silhouette
