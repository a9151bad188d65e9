// SPDX-License-Identifier: Apache-2.0
#include "common/parallel/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace silhouette {

bool ParallelWhile(size_t count, const std::function<bool(size_t)>& work, size_t most_threads) {
  std::atomic<size_t> next = 0;
  std::atomic<bool> stopped = false;
  std::mutex mutex;
  std::exception_ptr failure;  // guarded by the mutex
  const auto work_off = [&] {
    try {
      for (size_t i = next++; i < count && !stopped; i = next++) {
        if (!work(i)) stopped = true;
      }
    } catch (...) {
      stopped = true;
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> helpers;
    const size_t threads =
        std::min({size_t{std::thread::hardware_concurrency()}, most_threads, count});
    for (size_t i = 1; i < threads; ++i) helpers.emplace_back(work_off);
    work_off();
  }
  if (failure) std::rethrow_exception(failure);
  return !stopped;
}

void ParallelFor(size_t count, const std::function<void(size_t)>& work, size_t most_threads) {
  ParallelWhile(
      count,
      [&](size_t i) {
        work(i);
        return true;
      },
      most_threads);
}

}  // namespace silhouette
