// SPDX-License-Identifier: Apache-2.0
// The paths that clients watch, and what they were told last.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette {

// One watched path. Thread-safe.
class WatchedPath {
 public:
  WatchedPath(std::string of_client, v1::CheckPathRequest of_request)
      : client(std::move(of_client)), request(std::move(of_request)) {}

  struct Told {
    v1::WatchPathResponse response;
    absl::Duration at;  // running clock
  };
  void Note(v1::WatchPathResponse response, absl::Duration at) {
    auto told = std::make_shared<const Told>(Told{std::move(response), at});
    const std::lock_guard lock(mutex_);
    told_.swap(told);
  }
  // Null: nothing yet.
  std::shared_ptr<const Told> told() const {
    const std::lock_guard lock(mutex_);
    return told_;
  }

  const std::string client;
  const v1::CheckPathRequest request;

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Told> told_;
};

// Thread-safe.
class WatchedPaths {
 public:
  // Forgotten when the last other reference goes.
  void Add(const std::shared_ptr<WatchedPath>& path) {
    const std::lock_guard lock(mutex_);
    std::erase_if(paths_, [](const std::weak_ptr<WatchedPath>& old) { return old.expired(); });
    paths_.push_back(path);
  }

  // In the order in which they were added.
  std::vector<std::shared_ptr<const WatchedPath>> All() const {
    const std::lock_guard lock(mutex_);
    std::vector<std::shared_ptr<const WatchedPath>> all;
    for (const std::weak_ptr<WatchedPath>& path : paths_) {
      if (auto held = path.lock()) all.push_back(std::move(held));
    }
    return all;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::weak_ptr<WatchedPath>> paths_;
};

}  // namespace silhouette
