// SPDX-License-Identifier: Apache-2.0
// Callers of WatchConfigurationSpace, WatchPath and StreamChecks.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tests/server/service/test_server.h"

namespace silhouette {

struct SpaceUpdate {
  v1::WatchConfigurationSpaceResponse first;  // its first part
  uint64_t tiles = 0;                         // how many it sent
};

// Keeps the space as the updates leave it.
class SpaceWatching {
 public:
  explicit SpaceWatching(TestServer& server, const v1::WatchConfigurationSpaceRequest& request = {})
      : reader_(server.collision->WatchConfigurationSpace(&context_, request)) {}
  ~SpaceWatching() { Cancel(); }

  // Waits for the next update.
  SpaceUpdate Next() {
    SpaceUpdate update;
    v1::WatchConfigurationSpaceResponse part;
    bool first = true;
    do {
      part.Clear();
      EXPECT_TRUE(reader_->Read(&part));
      if (::testing::Test::HasFailure()) return update;
      if (first) update.first = part;
      if (first && part.whole()) free_.clear();
      if (first && part.whole()) free_cells_.clear();
      for (const v1::ConfigurationSpaceTile& tile : part.tiles()) {
        free_[tile.tile()] = tile.free();
        free_cells_[tile.tile()] = tile.free_cells();
      }
      update.tiles += static_cast<uint64_t>(part.tiles_size());
      first = false;
    } while (!part.last_part());
    return update;
  }

  // The bits of the free configurations, by tile.
  const std::map<uint64_t, std::string>& free() const { return free_; }

  // Those of the cells that are free; empty if they are not told.
  const std::map<uint64_t, std::string>& free_cells() const { return free_cells_; }

  void Cancel() { context_.TryCancel(); }

  // Reads to the end.
  grpc::Status Finish() {
    v1::WatchConfigurationSpaceResponse ignored;
    while (reader_->Read(&ignored)) {
    }
    return reader_->Finish();
  }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::WatchConfigurationSpaceResponse>> reader_;
  std::map<uint64_t, std::string> free_;
  std::map<uint64_t, std::string> free_cells_;
};

class PathWatching {
 public:
  PathWatching(TestServer& server, const std::vector<Configuration>& waypoints) {
    v1::CheckPathRequest request;
    for (const Configuration& q : waypoints) Set(q, request.add_waypoints());
    reader_ = server.collision->WatchPath(&context_, request);
  }
  ~PathWatching() { context_.TryCancel(); }

  v1::WatchPathResponse Next() {
    v1::WatchPathResponse update;
    EXPECT_TRUE(reader_->Read(&update));
    return update;
  }
  grpc::Status Finish() {
    v1::WatchPathResponse ignored;
    while (reader_->Read(&ignored)) {
    }
    return reader_->Finish();
  }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::WatchPathResponse>> reader_;
};

class Asking {
 public:
  explicit Asking(TestServer& server) : stream_(server.collision->StreamChecks(&context_)) {}
  ~Asking() { context_.TryCancel(); }

  void Send(uint64_t id, const Configuration& q) {
    v1::StreamChecksRequest request;
    request.set_id(id);
    Set(q, request.mutable_configurations()->add_configurations());
    Send(request);
  }
  // The server may be gone.
  void SendIfItCan(uint64_t id, const Configuration& q) {
    v1::StreamChecksRequest request;
    request.set_id(id);
    Set(q, request.mutable_configurations()->add_configurations());
    stream_->Write(request);
  }
  void Send(const v1::StreamChecksRequest& request) { EXPECT_TRUE(stream_->Write(request)); }

  v1::StreamChecksResponse Next() {
    v1::StreamChecksResponse answer;
    EXPECT_TRUE(stream_->Read(&answer));
    return answer;
  }
  void NoMore() { stream_->WritesDone(); }
  // Reads to the end.
  grpc::Status Finish() {
    v1::StreamChecksResponse ignored;
    while (stream_->Read(&ignored)) {
    }
    return stream_->Finish();
  }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamChecksRequest, v1::StreamChecksResponse>>
      stream_;
};

}  // namespace silhouette
