// SPDX-License-Identifier: Apache-2.0
#include "server/service/serving.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/service/serving_settings.h"

namespace silhouette {

RegionLog::RegionLog(SceneStore& scenes, Clock clock)
    : scenes_(scenes),
      clock_(std::move(clock)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

void RegionLog::Watch() {
  {
    const std::lock_guard lock(mutex_);
    watching_ = true;
  }
  changed_.notify_one();
}

void RegionLog::Run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return watching_; }) && !stop.stop_requested()) {
    changed_.wait_for(lock, stop, kPeriod, [] { return false; });
    try {
      watching_ = TellEnded();
    } catch (const std::exception& error) {
      spdlog::error("internal error: {}", error.what());
    }
  }
}

bool RegionLog::TellEnded() {
  const Moment now = clock_();
  for (const AllowedRegion& region : scenes_.TakeEnded(now)) {
    spdlog::info("allowed region '{}' has ended{}", region.name,
                 region.end > now.running ? " with its database" : "");
  }
  return !scenes_.Newest(now).regions->regions.empty();
}

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
  if (reasons == logged_reasons_) return;
  if (reasons.empty()) {
    spdlog::info("scene {} is good again", scene.id);
  } else {
    spdlog::warn("scene {} is not good: {}", scene.id, messages);
  }
  logged_reasons_ = std::move(reasons);
}

void ScenePublisher::PrepareSpace(const ServedDatabase& whole, const Scene& scene) const {
  if (!IsSound(DefaultPolicy(settings_, whole).preset)) return;
  const ServedDatabase* variant = whole.Variant(scene.variant);
  if (variant == nullptr || variant->sound() == nullptr || scene.Blocked() != Reason::kNone) return;
  scene.possible_space.Get(variant->sound(), scene.obstacle_images, scene.joints, {});
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

Policy DefaultPolicy(const ServingSettings& settings, const ServedDatabase& database) {
  Policy policy = settings.policy;
  if (settings.choose_preset) policy.preset = database.BestPreset();
  return policy;
}

}  // namespace silhouette
