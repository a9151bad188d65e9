// The shared map in one process's memory: whole updates or none, whatever is written meanwhile and
// whatever the memory holds.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <iostream>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "clients/shared_map/reader.h"
#include "clients/shared_map/writer.h"

namespace silhouette::shared_map {
namespace {

using Outcome = Reader::Outcome;
using Half = std::array<uint64_t, kPlacesPerTile / 64>;

constexpr uint64_t kTiles = 3;
constexpr uint64_t kPairs = kTiles * kPlacesPerTile / 64;
const std::string kDescription = "what it is of";
const ClockId kClock{.boot = {7, 8}, .time_namespace = 9};

// The states of update u: all words of a kind are the same, and tell u from its neighbours.
uint64_t FreeWord(uint64_t u) { return u * 0x9e3779b97f4a7c15; }

Stamp StampOf(uint64_t u) {
  return {.reason = 0,
          .scene = u,
          .taken = -static_cast<int64_t>(u),
          .valid_until = static_cast<int64_t>(2 * u),
          .reason_after = u % 3,
          .scene_time = static_cast<int64_t>(3 * u),
          .cells = static_cast<Cells>(u % 3)};
}

struct Memory {
  Memory() : words(layout.FileBytes() / sizeof(uint64_t)) {
    writer.emplace(words, layout, kDescription, kClock);
  }

  void Publish(uint64_t u) {
    Half free;
    Half occupied;
    Half free_cells;
    free_cells.fill(FreeWord(u) & FreeWord(u + 1));
    free.fill(FreeWord(u));
    occupied.fill(~FreeWord(u));
    writer->Publish(StampOf(u), "region " + std::to_string(u), [&](uint64_t) {
      return Writer::TileStates{free, occupied, free_cells};
    });
  }

  const Layout layout{.tiles = kTiles, .description_bytes = kDescription.size()};
  std::vector<uint64_t> words;
  std::optional<Writer> writer;
};

// All of an update, and whether it is one.
struct Seen {
  Stamp stamp;
  std::string names;
  std::vector<uint64_t> states;

  bool Whole() const {
    if (stamp != StampOf(stamp.scene)) return false;
    if (names != "region " + std::to_string(stamp.scene)) return false;
    const uint64_t u = stamp.scene;
    const uint64_t cells = u % 3 == 0 ? 0 : FreeWord(u) & FreeWord(u + 1);
    for (size_t i = 0; i < states.size(); i += 3) {
      if (states[i] != FreeWord(u) || states[i + 1] != ~FreeWord(u)) return false;
      if (states[i + 2] != cells) return false;
    }
    return true;
  }
};

Seen SeenIn(const Reader::Update& update) {
  Seen seen{.stamp = update.stamp(), .names = update.names(), .states = {}};
  for (uint64_t i = 0; i < kPairs; ++i) {
    seen.states.push_back(update.free(i));
    seen.states.push_back(update.occupied(i));
    seen.states.push_back(update.free_cells(i));
  }
  return seen;
}

TEST(SharedMap, ReaderSeesTheNewestUpdate) {
  Memory memory;
  const Reader reader(memory.words);
  EXPECT_EQ(reader.tiles(), kTiles);
  EXPECT_EQ(reader.description(), kDescription);
  EXPECT_EQ(reader.clock(), kClock);
  EXPECT_FALSE(reader.closed());
  EXPECT_EQ(reader.Read([](const Reader::Update&) { FAIL(); }), Outcome::kNone);
  for (const uint64_t u : {1, 2, 3, 10}) {
    memory.Publish(u);
    Seen seen;
    EXPECT_EQ(reader.Read([&](const Reader::Update& update) { seen = SeenIn(update); }),
              Outcome::kRead);
    EXPECT_EQ(seen.stamp.scene, u);
    EXPECT_TRUE(seen.Whole());
  }
  memory.writer->Close(Closed::kStopped);
  EXPECT_TRUE(reader.closed());
}

TEST(SharedMap, WordsLieWhereTheFormatSays) {
  Memory memory;
  memory.Publish(5);
  memory.Publish(6);
  const auto bytes = [&](size_t at, size_t count) {
    return std::string(reinterpret_cast<const char*>(memory.words.data()) + at, count);
  };
  EXPECT_EQ(bytes(0, 8), std::string("silhmap\0", 8));
  const std::vector<uint64_t>& head = memory.words;
  EXPECT_EQ(head[1], 2u);
  EXPECT_EQ(head[2], head.size() * 8);
  EXPECT_EQ(head[3], kTiles);
  EXPECT_EQ(head[4], 4096u);
  EXPECT_EQ(head[5], kDescription.size());
  EXPECT_EQ(bytes(4096, kDescription.size()), kDescription);
  EXPECT_EQ(head[6], 8192u);
  EXPECT_EQ(head[7], 8192u + kTiles * 1536 + 3584);  // whole pages
  EXPECT_EQ(head[8], 7u);
  EXPECT_EQ(head[9], 8u);
  EXPECT_EQ(head[10], 9u);
  EXPECT_EQ(head[16], 0u);
  EXPECT_EQ(head[17], 2u);
  const uint64_t* buffer = head.data() + 8192 / 8;  // that of even updates
  EXPECT_EQ(buffer[0], 4u);
  EXPECT_EQ(buffer[1], 0u);
  EXPECT_EQ(buffer[2], 6u);
  EXPECT_EQ(buffer[3], static_cast<uint64_t>(-6));
  EXPECT_EQ(buffer[4], 12u);
  EXPECT_EQ(buffer[5], 0u);
  EXPECT_EQ(buffer[6], 18u);
  EXPECT_EQ(buffer[7], 8u);
  EXPECT_EQ(bytes(8192 + 64, 8), "region 6");
  EXPECT_EQ(buffer[528], 0u) << "nothing is told of cells";
  EXPECT_EQ(buffer[head[7] / 8 + 528], 2u);
  EXPECT_EQ(buffer[(8192 + head[7]) / 8 + 2], FreeWord(5) & FreeWord(6));
  EXPECT_EQ(buffer[8192 / 8 + 2], 0u);
  EXPECT_EQ(buffer[8192 / 8], FreeWord(6));
  EXPECT_EQ(buffer[8192 / 8 + 1], ~FreeWord(6));
  EXPECT_EQ(buffer[head[7] / 8], 2u) << "update 1 is in the other one";
  EXPECT_EQ(buffer[head[7] / 8 + 2], 5u);
}

TEST(SharedMap, ReaderThatIsOvertakenBeginsAnew) {
  Memory memory;
  memory.Publish(1);
  const Reader reader(memory.words);
  int calls = 0;
  Seen seen;
  const auto read = [&](const Reader::Update& update) {
    seen = SeenIn(update);
    // One update goes into the other buffer, the next one into that which is being read.
    if (++calls == 1) {
      memory.Publish(2);
      memory.Publish(3);
    }
  };
  EXPECT_EQ(reader.Read(read), Outcome::kRead);
  EXPECT_EQ(calls, 2);
  EXPECT_EQ(seen.stamp.scene, 3u);
  calls = 0;
  EXPECT_EQ(reader.Read(read, 1), Outcome::kOvertaken);
  // A single update leaves what is being read alone.
  const auto once = [&](const Reader::Update& update) {
    memory.Publish(4);
    seen = SeenIn(update);
  };
  EXPECT_EQ(reader.Read(once, 1), Outcome::kRead);
  EXPECT_EQ(seen.stamp.scene, 3u);
  EXPECT_TRUE(seen.Whole());
}

TEST(SharedMap, NoReaderSeesAMixtureWhileAWriterIsBusy) {
  Memory memory;
  memory.Publish(1);
  const Reader reader(memory.words);
  std::atomic<bool> stop = false;
  std::atomic<uint64_t> whole = 0;
  std::vector<std::thread> readers;
  for (int i = 0; i < 2; ++i) {
    readers.emplace_back([&, i] {
      std::mt19937 random(static_cast<unsigned>(i));
      uint64_t last = 0;
      while (!stop) {
        Seen seen;
        if (reader.Read([&](const Reader::Update& update) { seen = SeenIn(update); }) ==
            Outcome::kRead) {
          EXPECT_TRUE(seen.Whole()) << seen.stamp.scene;
          EXPECT_GE(seen.stamp.scene, last);
          last = seen.stamp.scene;
          ++whole;
        }
        uint64_t scene = 0;
        uint64_t free = 0;
        const uint64_t at = random() % kPairs;
        EXPECT_EQ(reader.Read([&](const Reader::Update& update) {
          scene = update.stamp().scene;
          free = update.free(at);
        }),
                  Outcome::kRead);
        EXPECT_EQ(free, FreeWord(scene));
      }
    });
  }
  // Some at once, some with pauses in which whole reads come to their end.
  uint64_t u = 1;
  for (; u < 3000 || whole < 100; ++u) {
    memory.Publish(u + 1);
    if (u % 8 == 0) std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  stop = true;
  for (std::thread& thread : readers) thread.join();
}

TEST(SharedMap, UpdateThatFailsHalfwayIsNeverSeen) {
  Memory memory;
  memory.Publish(1);
  const Reader reader(memory.words);
  const Half ones = [] {
    Half half;
    half.fill(~uint64_t{0});
    return half;
  }();
  const auto fails = [&](uint64_t tile) -> Writer::TileStates {
    if (tile == 1) throw std::runtime_error("no");
    return {ones, ones, ones};
  };
  EXPECT_THROW(memory.writer->Publish(StampOf(2), "", fails), std::runtime_error);
  Seen seen;
  const auto read = [&](const Reader::Update& update) { seen = SeenIn(update); };
  EXPECT_EQ(reader.Read(read), Outcome::kRead);
  EXPECT_EQ(seen.stamp.scene, 1u);
  memory.Publish(3);
  EXPECT_EQ(reader.Read(read), Outcome::kRead);
  EXPECT_TRUE(seen.Whole());
  EXPECT_EQ(seen.stamp.scene, 3u);
}

TEST(SharedMap, StatesAreLeftOutOnlyForAReason) {
  Memory memory;
  EXPECT_THROW(memory.writer->Publish({.scene = 1}, "", nullptr), std::invalid_argument);
  memory.writer->Publish({.reason = 2, .scene = 1}, "", nullptr);
  uint64_t reason = 0;
  const Reader reader(memory.words);
  reader.Read([&](const Reader::Update& update) { reason = update.stamp().reason; });
  EXPECT_EQ(reason, 2u);
}

TEST(SharedMap, NamesBeyondTheRoomAreLeftOutWhole) {
  Memory memory;
  std::string names;
  for (int i = 0; i < 64; ++i) names += std::string(64, static_cast<char>('0' + i)) + "\n";
  const auto told = [&](const std::string& given) {
    memory.writer->Publish({.reason = 2}, given, nullptr);
    std::string result;
    Reader(memory.words).Read([&](const Reader::Update& update) { result = update.names(); });
    return result;
  };
  EXPECT_EQ(told(names), names) << "as many as a server allows";
  EXPECT_EQ(told(names + "one more"), names.substr(0, names.size() - 1));
  EXPECT_EQ(told(std::string(5000, 'x')), "");
  EXPECT_EQ(told("a"), "a");
}

TEST(SharedMap, MemoryThatDoesNotFitIsRefused) {
  Memory memory;
  EXPECT_THROW(Writer(std::span(memory.words).first(512), memory.layout, kDescription, kClock),
               std::invalid_argument);
  EXPECT_THROW(Writer(memory.words, memory.layout, "longer than it was", kClock),
               std::invalid_argument);
}

std::string FaultOf(std::span<const uint64_t> words) {
  try {
    const Reader reader(words);
    return "";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

TEST(SharedMap, WhatIsNoSharedMapIsRefused) {
  Memory memory;
  const std::span<const uint64_t> words = memory.words;
  EXPECT_EQ(FaultOf(words), "");
  EXPECT_EQ(FaultOf({}), "is not a shared map of the configuration space");
  EXPECT_EQ(FaultOf(words.first(10)), "is not a shared map of the configuration space");
  EXPECT_EQ(FaultOf(std::vector<uint64_t>(words.size())),
            "is not a shared map of the configuration space");
  for (const size_t words_left : {size_t{512}, words.size() / 2, words.size() - 1}) {
    EXPECT_EQ(FaultOf(words.first(words_left)),
              "is a damaged shared map: its size is not what its head says");
  }
  memory.words[kHeadVersion] = 3;
  EXPECT_EQ(
      FaultOf(words),
      "is a shared map of format 3, and this program reads format 2: use programs of the same "
      "version");
}

TEST(SharedMap, DamagedMemoryIsReadWithoutHarm) {
  const unsigned seed = std::random_device()();
  std::cout << "seed " << seed << std::endl;
  std::mt19937_64 random(seed);
  int read = 0;
  for (int round = 0; round < 3000; ++round) {
    Memory memory;
    memory.Publish(1);
    memory.Publish(2);
    const std::array<size_t, 3> areas = {
        0, memory.layout.BufferOffset() / 8,
        (memory.layout.BufferOffset() + memory.layout.BufferDistance()) / 8};
    for (int i = 0; i < 3; ++i) {
      const size_t at = areas[random() % 3] + random() % 20;
      memory.words[at] = random() % 2 == 0 ? random() : uint64_t{1} << (random() % 64);
    }
    if (!FaultOf(memory.words).empty()) continue;
    const Reader reader(memory.words);
    Seen seen;
    if (reader.Read([&](const Reader::Update& update) { seen = SeenIn(update); }, 3) ==
        Outcome::kRead) {
      ++read;
    }
    EXPECT_LE(seen.names.size(), kMostNamesBytes);
  }
  EXPECT_GT(read, 100);
}

TEST(SharedMap, ClockOfThisMachineIsKnown) {
  const ClockId ours = ClockId::Ours();
  EXPECT_EQ(ours, ClockId::Ours());
  EXPECT_NE(ours.boot[0] | ours.boot[1], 0u);
  EXPECT_TRUE(ours.SameAs(ClockId::Ours()));
}

TEST(SharedMap, ClockOfAnUnknownBootIsTheSameAsNoOther) {
  const ClockId unknown{.boot = {0, 0}, .time_namespace = 9};
  EXPECT_FALSE(unknown.SameAs(unknown));
  EXPECT_FALSE(ClockId{}.SameAs(ClockId{}));
  EXPECT_FALSE(unknown.SameAs(kClock));
  EXPECT_FALSE(kClock.SameAs(unknown));
  EXPECT_TRUE(kClock.SameAs(kClock));
  const ClockId half{.boot = {0, 8}, .time_namespace = 9};
  EXPECT_TRUE(half.SameAs(half));
  EXPECT_FALSE(half.SameAs(kClock));
}

}  // namespace
}  // namespace silhouette::shared_map
