// SPDX-License-Identifier: Apache-2.0
#include "server/service/worker_pool.h"

#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

namespace silhouette {

WorkerPool::WorkerPool(WorkerPoolSettings settings) : settings_(std::move(settings)) {
  for (int i = 0; i < settings_.threads; ++i) threads_.emplace_back([this] { Work(); });
}

void WorkerPool::Finish() {
  {
    const std::lock_guard lock(mutex_);
    closing_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

bool WorkerPool::Run(const std::string& client, size_t bytes, std::function<void()> task) {
  {
    const std::lock_guard lock(mutex_);
    const auto of_client = tasks_.find(client);
    const size_t waiting = of_client == tasks_.end() ? 0 : of_client->second.size();
    const bool full =
        waiting_ >= settings_.queue || waiting_bytes_ + bytes > settings_.queued_bytes;
    if (closing_ || waiting >= settings_.queue_per_client || (full && client != kServer)) {
      return false;
    }
    if (waiting == 0) turns_.push_back(client);
    tasks_[client].push_back({bytes, std::move(task)});
    ++waiting_;
    waiting_bytes_ += bytes;
  }
  changed_.notify_one();
  return true;
}

void WorkerPool::Work() {
  pthread_setname_np(pthread_self(), settings_.name.c_str());
  if (settings_.nice != 0) {
    // Of this thread alone, as Linux has it.
    const int present = getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
    setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), present + settings_.nice);
  }
  for (;;) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return closing_ || !turns_.empty(); });
    if (turns_.empty()) return;
    const auto client = tasks_.find(turns_.front());
    turns_.pop_front();
    const Task task = std::move(client->second.front());
    client->second.pop_front();
    if (client->second.empty()) {
      tasks_.erase(client);
    } else {
      turns_.push_back(client->first);
    }
    --waiting_;
    waiting_bytes_ -= task.bytes;
    lock.unlock();
    task.run();
  }
}

}  // namespace silhouette
