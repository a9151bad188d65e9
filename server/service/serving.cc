// SPDX-License-Identifier: Apache-2.0
#include "server/service/serving.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/service/serving_settings.h"

namespace silhouette {

void ScenePublisher::LogDefects(const Scene& scene) {
  std::set<Reason> reasons;
  std::string messages;
  for (const SceneDefect& defect : scene.defects) {
    reasons.insert(defect.reason);
    absl::StrAppend(&messages, messages.empty() ? "" : "; ", defect.message);
  }
  const std::lock_guard lock(mutex_);
  if (scene.id < logged_scene_) return;  // overtaken by a newer one
  logged_scene_ = scene.id;
  switch (log_.Note(reasons, scene.arrived.running)) {
    case FaultLog<Reason>::News::kNone:
      return;
    case FaultLog<Reason>::News::kFault:
      spdlog::warn("scene {} is not good: {}", scene.id, messages);
      return;
    case FaultLog<Reason>::News::kRecovered:
      spdlog::info("scenes are good again, as scene {}", scene.id);
  }
}

void ScenePublisher::PrepareSpace(const ServedDatabase& whole, const Scene& scene) const {
  const Policy policy = DefaultPolicy(settings_, whole);
  if (!IsSound(policy.preset)) return;
  const ServedDatabase* variant = whole.Variant(scene.variant);
  if (variant == nullptr || variant->sound() == nullptr || scene.Blocked() != Reason::kNone) return;
  scene.possible_space.Get(variant->sound(), scene.obstacle_images, scene.joints, {},
                           MaxOccludedViews(policy, whole.views()));
}

absl::StatusOr<SharedScene> ScenePublisher::Publish(
    Scene scene, const std::shared_ptr<const ServedDatabase>& database) {
  absl::StatusOr<SharedScene> published = scenes_.Publish(std::move(scene), database);
  if (!published.ok()) return published;
  LogDefects(**published);
  PrepareSpace(*database, **published);
  return published;
}

WorkerPool::WorkerPool(int threads, size_t queue) : queue_(queue) {
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { Work(); });
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

bool WorkerPool::Run(std::function<void()> task) {
  {
    const std::lock_guard lock(mutex_);
    if (tasks_.size() >= queue_) return false;
    tasks_.push_back(std::move(task));
  }
  changed_.notify_one();
  return true;
}

void WorkerPool::Work() {
  for (;;) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return closing_ || !tasks_.empty(); });
    if (tasks_.empty()) return;
    const std::function<void()> task = std::move(tasks_.front());
    tasks_.pop_front();
    lock.unlock();
    task();
  }
}

absl::Status Guarded(const std::function<absl::Status()>& work) {
  try {
    return work();
  } catch (const std::exception& error) {
    spdlog::error("internal error: {}", error.what());
    return absl::InternalError("internal error of the server; its log says more");
  }
}

absl::Status TooBusy() { return absl::ResourceExhaustedError("the server is busy; try again"); }

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), std::string(status.message()));
}

grpc::ServerUnaryReactor* AnswerHere(grpc::CallbackServerContext* context,
                                     const std::function<absl::Status()>& work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(ToGrpc(Guarded(work)));
  return reactor;
}

grpc::ServerUnaryReactor* AnswerOnWorker(Serving& serving, grpc::CallbackServerContext* context,
                                         std::function<absl::Status()> work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const bool accepted = serving.workers.Run([=, work = std::move(work)] {
    reactor->Finish(ToGrpc(context->IsCancelled() ? absl::CancelledError() : Guarded(work)));
  });
  if (!accepted) reactor->Finish(ToGrpc(TooBusy()));
  return reactor;
}

Policy DefaultPolicy(const ServingSettings& settings, const ServedDatabase& database) {
  Policy policy = settings.policy;
  if (settings.choose_preset) policy.preset = database.BestPreset();
  return policy;
}

}  // namespace silhouette
