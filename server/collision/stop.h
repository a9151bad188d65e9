// SPDX-License-Identifier: Apache-2.0
// Giving up work that takes long.
#pragma once

#include <functional>

namespace silhouette {

// Asked now and again by work that takes long, by the thread that does it: whether to give up, as
// the caller is gone, its time is over or it asked for too much. Null: never.
using Stop = std::function<bool()>;

inline bool Stopped(const Stop& stop) { return stop && stop(); }

}  // namespace silhouette
