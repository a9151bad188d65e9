// Work on many equal parts, with a few threads.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace silhouette::paper {

// Calls work(worker, i) once for every i below `count`, worker 0 being the calling thread, which
// also calls on_progress(done) now and then, and at the end; when that returns false, no further
// part is begun. Rethrows the first exception of a worker. Returns whether all is done and nobody
// wished to stop.
inline bool InParallel(int threads, uint64_t count, const std::function<void(int, uint64_t)>& work,
                       const std::function<bool(uint64_t)>& on_progress) {
  std::atomic<uint64_t> next{0};
  std::atomic<uint64_t> done{0};
  std::atomic<bool> stop{false};
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work_off = [&](int worker) {
    try {
      for (uint64_t i = next++; i < count && !stop; i = next++) {
        work(worker, i);
        const uint64_t now = ++done;
        if (worker == 0 && !on_progress(now)) stop = true;
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
  return on_progress(done) && !stop;
}

}  // namespace silhouette::paper
