// SPDX-License-Identifier: Apache-2.0
// Threads for the work that must not block gRPC's own.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace silhouette {

struct WorkerPoolSettings {
  std::string name;  // of the threads; at most 15 characters
  int threads = 1;   // at least 1
  // Tasks that may wait for a thread, in all and of one client.
  size_t queue = 256;
  size_t queue_per_client = 256;
  // Bytes of requests that may wait.
  size_t queued_bytes = size_t{256} << 20;
  // Added to the threads' niceness: with more, other threads that are ready get more of the
  // processors.
  int nice = 0;
};

// Takes the tasks of clients in turn, one of each: a client that asks much delays the others by one
// task per thread.
class WorkerPool {
 public:
  explicit WorkerPool(WorkerPoolSettings settings);
  ~WorkerPool() { Finish(); }
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // The client that stands for the server itself: of the limits, only queue_per_client is its.
  static constexpr char kServer[] = "";

  // Runs the task some time later; false, and it will not run, if a limit of the queue is reached.
  // `bytes`: of its request. The task must not throw. May be called from any thread.
  bool Run(const std::string& client, size_t bytes, std::function<void()> task);

  // Returns when all tasks have ended, the waiting ones too. From then on none is taken. For the
  // owner alone.
  void Finish();

 private:
  struct Task {
    size_t bytes = 0;
    std::function<void()> run;
  };

  void Work();

  const WorkerPoolSettings settings_;
  std::mutex mutex_;
  std::condition_variable changed_;
  // Of each client that has some, and the clients in the order in which it is their turn.
  std::map<std::string, std::deque<Task>> tasks_;
  std::deque<std::string> turns_;
  size_t waiting_ = 0;
  size_t waiting_bytes_ = 0;
  bool closing_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace silhouette
