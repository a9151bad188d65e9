// SPDX-License-Identifier: Apache-2.0
// Many equal parts of work on several threads.
#pragma once

#include <cstddef>
#include <functional>

namespace silhouette {

// One per processor, at least 1.
int AllThreads();

// Calls work(worker, i) once for every i below `count`, in any order, with `threads` threads.
// Worker 0 is the calling thread. Once a call returns false, no further one begins. Rethrows the
// first exception. Returns whether all calls were made and returned true.
bool ParallelFor(size_t count, int threads, const std::function<bool(int worker, size_t i)>& work);

// The same on all processors.
bool ParallelFor(size_t count, const std::function<bool(size_t i)>& work);

}  // namespace silhouette
