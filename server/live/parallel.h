// The same work on several things at once.
#pragma once

#include <cstddef>
#include <functional>

namespace silhouette {

// Does `work(i)` for each i below `count`, on up to `threads` threads, the caller's among them.
// Returns when all is done. `work` must not throw.
void ForEachAtOnce(size_t count, int threads, const std::function<void(size_t)>& work);

}  // namespace silhouette
