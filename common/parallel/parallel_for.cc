// SPDX-License-Identifier: Apache-2.0
#include "common/parallel/parallel_for.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace silhouette {

int AllThreads() { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

bool ParallelFor(size_t count, int threads, const std::function<bool(int worker, size_t i)>& work) {
  std::atomic<size_t> next{0};
  std::atomic<bool> stop{false};
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work_off = [&](int worker) {
    try {
      for (size_t i = next++; i < count && !stop; i = next++) {
        if (!work(worker, i)) stop = true;
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
      stop = true;
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (int worker = 1; worker < threads; ++worker) helpers.emplace_back(work_off, worker);
    work_off(0);
  }
  if (failure) std::rethrow_exception(failure);
  return !stop;
}

bool ParallelFor(size_t count, const std::function<bool(size_t i)>& work) {
  return ParallelFor(count, AllThreads(), [&](int, size_t i) { return work(i); });
}

}  // namespace silhouette
