// The clients' side of a shared map (layout.h), in memory that it lies in. Trusts no word of it: a
// map that is damaged, or written by somebody hostile, gives wrong states at worst. A part of the
// pure core.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "clients/shared_map/layout.h"

namespace silhouette::shared_map {

// Used by any number of threads.
class Reader {
 public:
  // `memory`: a whole file, which outlives this. std::invalid_argument, in words that follow the
  // name of the file, if it is not a shared map or one that this library cannot read.
  explicit Reader(std::span<const uint64_t> memory);

  uint64_t tiles() const { return tiles_; }
  const ClockId& clock() const { return clock_; }
  std::string_view description() const { return description_; }

  bool closed() const { return Load(memory_[kHeadClosed]) != 0; }

  // One update, while it lasts: what it gives counts only if Read() says so.
  class Update {
   public:
    Stamp stamp() const {
      return {.reason = Load(words_[kBufferReason]),
              .scene = Load(words_[kBufferScene]),
              .taken = static_cast<int64_t>(Load(words_[kBufferTaken])),
              .valid_until = static_cast<int64_t>(Load(words_[kBufferValidUntil])),
              .reason_after = Load(words_[kBufferReasonAfter]),
              .scene_time = static_cast<int64_t>(Load(words_[kBufferSceneTime])),
              .cells = static_cast<Cells>(Load(words_[kBufferCells]))};
    }
    // Of the allowed regions, one a line.
    std::string names() const;
    // The states of places 64 i to 64 i + 63, a bit each; i is less than 64 times tiles().
    uint64_t free(uint64_t i) const { return Load(words_[kStates + kWordsPerPlaces * i]); }
    uint64_t occupied(uint64_t i) const { return Load(words_[kStates + kWordsPerPlaces * i + 1]); }
    // Likewise of the cells that begin there, as far as cells() tells of any.
    uint64_t free_cells(uint64_t i) const {
      return Load(words_[kStates + kWordsPerPlaces * i + 2]);
    }
    Cells cells() const { return static_cast<Cells>(Load(words_[kBufferCells])); }

   private:
    friend class Reader;
    static constexpr size_t kStates = kStatesOffset / sizeof(uint64_t);
    explicit Update(const uint64_t* words) : words_(words) {}

    const uint64_t* words_;
  };

  enum class Outcome { kRead, kNone, kOvertaken };

  // Calls `read` with the newest update, anew where that was overwritten meanwhile, `tries` times
  // at most. kNone: there is no update yet. Only with kRead did the last call see one and the same
  // update from beginning to end.
  template <typename ReadUpdate>
  Outcome Read(const ReadUpdate& read, int tries = kTries) const {
    for (int i = 0; i < tries; ++i) {
      const uint64_t newest = Load(memory_[kHeadNewest]);
      if (newest == 0) return Outcome::kNone;
      const uint64_t* buffer = buffers_[newest % kBuffers];
      if (Load(buffer[kBufferSequence]) != 2 * newest) continue;
      read(Update(buffer));
      if (Load(buffer[kBufferSequence]) == 2 * newest) return Outcome::kRead;
    }
    return Outcome::kOvertaken;
  }

 private:
  // Of short reads: a server that writes has to come round twice for each.
  static constexpr int kTries = 1000;

  static uint64_t Load(const uint64_t& word) {
    return std::atomic_ref<uint64_t>(const_cast<uint64_t&>(word)).load(std::memory_order_acquire);
  }

  std::span<const uint64_t> memory_;
  uint64_t tiles_ = 0;
  ClockId clock_;
  std::string description_;
  const uint64_t* buffers_[kBuffers] = {};
};

}  // namespace silhouette::shared_map
