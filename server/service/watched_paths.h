// SPDX-License-Identifier: Apache-2.0
// The paths that clients watch, and what they were told last.
#pragma once

#include <atomic>
#include <cstdint>
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
  // `changes`: counts its end.
  WatchedPath(uint64_t its_id, std::string of_client, v1::CheckPathRequest of_request,
              std::shared_ptr<std::atomic<uint64_t>> changes)
      : id(its_id),
        client(std::move(of_client)),
        request(std::move(of_request)),
        changes_(std::move(changes)) {}
  ~WatchedPath() { changes_->fetch_add(1); }
  WatchedPath(const WatchedPath&) = delete;
  WatchedPath& operator=(const WatchedPath&) = delete;

  struct Told {
    v1::WatchPathResponse response;
    absl::Duration at;  // running clock, when it was made
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

  const uint64_t id;
  const std::string client;
  const v1::CheckPathRequest request;

 private:
  const std::shared_ptr<std::atomic<uint64_t>> changes_;
  mutable std::mutex mutex_;
  std::shared_ptr<const Told> told_;
};

// Thread-safe.
class WatchedPaths {
 public:
  // Forgotten when the last other reference goes.
  std::shared_ptr<WatchedPath> Add(std::string client, v1::CheckPathRequest request) {
    const std::lock_guard lock(mutex_);
    std::erase_if(paths_, [](const std::weak_ptr<WatchedPath>& old) { return old.expired(); });
    auto path =
        std::make_shared<WatchedPath>(++last_id_, std::move(client), std::move(request), changes_);
    paths_.push_back(path);
    return path;
  }

  // After an answer was noted.
  void CountAnswer() { changes_->fetch_add(1); }
  // How many answers and ends there were, for those who look at all paths.
  uint64_t changes() const { return changes_->load(); }

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
  uint64_t last_id_ = 0;
  // Shared with the paths, of which some may outlive this.
  const std::shared_ptr<std::atomic<uint64_t>> changes_ =
      std::make_shared<std::atomic<uint64_t>>(0);
};

}  // namespace silhouette
