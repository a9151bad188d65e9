// Threads for the work that must not block gRPC's own.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace silhouette {

class WorkerPool {
 public:
  // `threads` at least 1; `queue`: how many tasks may wait for a thread.
  WorkerPool(int threads, size_t queue);
  // Finishes all tasks, the waiting ones too.
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Runs the task some time later; false, and it will not run, if the queue is full. The task must
  // not throw. May be called from any thread.
  bool Run(std::function<void()> task);

 private:
  void Work();

  const size_t queue_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;
  bool closing_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace silhouette
