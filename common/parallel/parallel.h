// SPDX-License-Identifier: Apache-2.0
// Loops on all processors.
#pragma once

#include <cstddef>
#include <functional>
#include <limits>

namespace silhouette {

// Calls work(i) once for every i below `count`, in this thread and in others: as many as there are
// processors, at most `most_threads`. Once a call returns false or throws, no further one begins.
// Rethrows the first exception. Returns whether every call returned true.
//
// The threads are the loop's own. A pool's thread that waits for a loop takes up other work, which
// may wait for a lock that the loop's caller holds.
bool ParallelWhile(size_t count, const std::function<bool(size_t)>& work,
                   size_t most_threads = std::numeric_limits<size_t>::max());

// The same with all of the calls.
void ParallelFor(size_t count, const std::function<void(size_t)>& work,
                 size_t most_threads = std::numeric_limits<size_t>::max());

}  // namespace silhouette
