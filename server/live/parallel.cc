#include "server/live/parallel.h"

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace silhouette {

void ForEachAtOnce(size_t count, int threads, const std::function<void(size_t)>& work) {
  std::atomic<size_t> next = 0;
  const auto run = [&] {
    for (size_t i = next++; i < count; i = next++) work(i);
  };
  const size_t helpers = std::min(count, static_cast<size_t>(std::max(threads, 1)));
  std::vector<std::jthread> others;
  for (size_t i = 1; i < helpers; ++i) others.emplace_back(run);
  run();
}

}  // namespace silhouette
